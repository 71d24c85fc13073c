"""Atomic writing of files and folders, and checksums.

Everything the package writes goes to a temporary path beside its destination and is renamed when it
is complete. A folder that replaces another one takes two renames, and several files that belong
together take as many. A killed process leaves the old content or the new content, never a part of
it; if it is killed between the renames, the next call of `replace_folder` or `remove_leftovers`
brings the old content back.
"""

import contextlib
import hashlib
import json
import os
import re
import shutil
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import filelock

from enhsim_tf.common.errors import InputError

_LEFT = re.compile(r"\.(?P<name>.+)\.(?P<kind>[0-9a-f]{8}|old|undo)\.enhsim_tf(\.\w+)?")


def _beside(path: Path, suffix: str = "", kind: str | None = None) -> Path:
    """The path beside a destination where its new content is written, or its `old` content waits,
    or where several files are listed that are replaced together, to `undo` that.
    """
    return path.with_name(f".{path.name}.{kind or uuid.uuid4().hex[:8]}.enhsim_tf{suffix}")


@contextlib.contextmanager
def _locked(path: Path, blocking: bool = True) -> Iterator[None]:
    """Holds a lock beside a path. The operating system releases it when this process ends for any
    reason.
    """
    with filelock.FileLock(path.with_name(f"{path.name}.lock"), blocking=blocking) as lock:
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                # while it is held: filelock notices that the file is another, and tries again
                os.unlink(lock.lock_file)


def make_folder(path: str | os.PathLike) -> Path:
    """Creates a folder with its parents, and returns its path.

    Raises:
        InputError: If the folder cannot be created or written to.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = _beside(path / "probe")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"Expected a folder that can be written to. Received: {path} ({error.strerror}). Name "
            "another."
        ) from None
    return path


@contextlib.contextmanager
def removing_empty(*paths: str | os.PathLike | None) -> Iterator[None]:
    """Removes folders and their parents after the block if they are new and empty, as where input
    was refused after the folder of the output had been made. None is no folder.
    """
    whole = [Path(os.path.abspath(path)) for path in paths if path is not None]
    new = [
        folder for path in whole for folder in (path, *path.parents) if not os.path.lexists(folder)
    ]
    try:
        yield
    finally:
        for folder in filter(Path.is_dir, new):
            with contextlib.suppress(OSError):  # it is not empty
                folder.rmdir()


@contextlib.contextmanager
def replace_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary path. If the block succeeds, the file written there replaces `path`; if it
    fails, `path` stays unchanged.
    """
    with replace_files(path) as (temporary,):
        yield temporary


@contextlib.contextmanager
def replace_files(*paths: str | os.PathLike) -> Iterator[list[Path]]:
    """Yields a temporary path for each of several files that belong together. If the block
    succeeds, the files written there replace `paths`; if it fails, or one of them cannot be
    replaced, all stay unchanged.
    """
    finals = [Path(path) for path in paths]
    with contextlib.ExitStack() as left:
        temporaries = [_beside(path, path.suffix) for path in finals]  # some writers look at it
        for temporary in temporaries:
            left.enter_context(_locked(temporary))
            left.callback(temporary.unlink, missing_ok=True)
        yield temporaries
        if len(finals) == 1:
            os.replace(temporaries[0], finals[0])
            return
        undo = _beside(finals[0], kind="undo")
        olds = [_beside(path, kind="old") for path in finals]
        for path in (undo, *olds):
            left.enter_context(_locked(path))
        _undo(undo)
        write_json(
            undo,
            {
                os.path.relpath(temporary, undo.parent): os.path.relpath(path, undo.parent)
                for temporary, path in zip(temporaries, finals, strict=True)
            },
        )
        try:
            for old, path in zip(olds, finals, strict=True):
                if os.path.lexists(path):
                    os.replace(path, old)
            for temporary, path in zip(temporaries, finals, strict=True):
                os.replace(temporary, path)
            undo.unlink()
        finally:
            _undo(undo)
            for path in finals:
                _restore(path)


def _undo(undo: Path) -> None:
    """Removes the new files that a failed or killed process has put into place without the others
    of theirs, and brings the old ones back.
    """
    if not undo.exists():
        return
    for temporary, name in json.loads(undo.read_text(encoding="utf-8")).items():
        path = undo.parent / name
        if not os.path.lexists(undo.parent / temporary):
            path.unlink(missing_ok=True)
        _restore(path)
    undo.unlink()


@contextlib.contextmanager
def replace_folder(
    path: str | os.PathLike, keep: Callable[[Path], bool] = lambda path: False
) -> Iterator[Path]:
    """Yields a temporary folder. If the block succeeds, that folder replaces `path`; if it fails,
    `path` stays unchanged.

    Args:
        path: The folder to write.
        keep: Called with an existing `path` before it is replaced. If it returns True, the new
            folder is discarded, so that a process that is reading the existing one does not lose
            it.
    """
    path = Path(path)
    make_folder(path.parent)
    remove_leftovers(path.parent, path.name)
    temporary = _beside(path)
    old = _beside(path, kind="old")
    with _locked(temporary):
        try:
            temporary.mkdir()
            yield temporary
            with _locked(old):
                _restore(path)
                if not os.path.lexists(path) or not keep(path):
                    try:
                        if os.path.lexists(path):
                            os.replace(path, old)
                        os.replace(temporary, path)
                    finally:
                        _restore(path)
        finally:
            _remove(temporary)


def _restore(path: Path) -> None:
    """Brings the old content back if there is no new content, and otherwise removes it."""
    old = _beside(path, kind="old")
    if os.path.lexists(path):
        _remove(old)
    elif os.path.lexists(old):
        os.replace(old, path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def remove_leftovers(folder: str | os.PathLike, name: str | None = None) -> None:
    """Removes what killed processes left in a folder, of this name if one is given, and restores
    old content that they had moved aside.
    """
    folder = Path(folder)
    paths = {
        path.with_name(path.name.removesuffix(".lock")) for path in folder.glob(".*.enhsim_tf*")
    }
    # what is to be undone comes first: it needs the others
    for left in sorted(paths, key=lambda path: not path.match("*.undo.enhsim_tf")):
        named = _LEFT.fullmatch(left.name)
        if named is None or name not in (None, named["name"]):
            continue
        # a running process holds the lock
        with contextlib.suppress(filelock.Timeout), _locked(left, blocking=False):
            if named["kind"] == "undo":
                _undo(left)
            elif named["kind"] == "old":
                _restore(folder / named["name"])
            else:
                _remove(left)


def write_json(path: str | os.PathLike, content: Any) -> None:
    """Writes `content` atomically as indented JSON, which has neither NaN nor infinity."""
    with replace_file(path) as temporary:
        temporary.write_text(
            json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8"
        )


def sha256(path: str | os.PathLike) -> str:
    """The SHA-256 checksum of a file, as hexadecimal text."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
