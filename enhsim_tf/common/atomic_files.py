"""Atomic writing of files and folders, and checksums.

Everything the package writes goes to a temporary path beside its destination and is renamed when it is complete. A killed
process therefore leaves either the old content or the new content, never a part of it. On Linux, a folder that replaces
another one is exchanged with it in a single step, if the file system supports this. Elsewhere the exchange takes two renames:
if the process is killed between them, the old content remains under a temporary name, and the next call of `replace_folder` or
`remove_leftovers` restores it.
"""

import contextlib
import ctypes
import functools
import hashlib
import json
import os
import re
import shutil
import socket
import sys
import time
import urllib.parse
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from enhsim_tf.common.errors import InputError

_LEFT = re.compile(r"\.(?P<name>.*?)\.(?P<host>[\w-]+)\.(?P<process>\d+)\.[0-9a-f]{8}(?P<suffix>\.\w+|)")
_MAX_CHARACTERS = 160  # of an encoded name; two temporary names add 40 each, and most file systems allow 255
_KEPT = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)  # names reserved by Windows
_HERE, _RENAME_EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE, see renameat2(2)
_OLD_S = 24 * 3600  # every running process writes at least once in this time


def _temporary(path: Path, kind: str = "tmp") -> Path:
    return path.with_name(f".{path.name}.{_host()}.{os.getpid()}.{uuid.uuid4().hex[:8]}.{kind}")


@functools.cache
def _host() -> str:
    """Identifies the machine and container in which a process number is valid: at most 17 characters, without dots."""
    name, container = socket.gethostname(), "/proc/self/ns/pid"
    identity = name + (os.readlink(container) if os.path.islink(container) else "")
    return f"{re.sub(r'[^A-Za-z0-9-]', '-', name)[:8]}-{hashlib.sha256(identity.encode(errors='replace')).hexdigest()[:8]}"


def encode_name(name: str) -> str:
    """Percent-encodes a name, such as a channel's, for use as a file or folder name.

    The result cannot point outside its folder, is not hidden, and is not a name that Windows reserves.
    `urllib.parse.unquote` restores the original name.

    Args:
        name: The name.

    Returns:
        The encoded name.

    Raises:
        InputError: If the name is empty, too long for a file, or not valid Unicode.
    """
    try:
        found = urllib.parse.quote(name, safe=" ").replace(".", "%2E")
    except UnicodeEncodeError:
        raise InputError(f"Expected a channel name of Unicode characters. Received: {name[:60]!r}. Rename it.") from None
    found = re.sub("^ +| +$", lambda spaces: "%20" * len(spaces[0]), found)  # Windows strips them
    if _KEPT.fullmatch(found):
        found = f"%{ord(found[0]):02X}{found[1:]}"
    if not 1 <= len(found) <= _MAX_CHARACTERS:
        raise InputError(
            f"Expected a channel name of 1 to {_MAX_CHARACTERS} letters (signs and letters beyond ASCII count for three or more). "
            f"Received: {name[:60]!r} with {len(found)}. Rename it, or name the other channels."
        )
    return found


def make_folder(path: str | os.PathLike) -> Path:
    """Creates a folder with its parents.

    Args:
        path: The folder.

    Returns:
        The folder as a `Path`.

    Raises:
        InputError: If the folder cannot be created or written to.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = _temporary(path / "probe.tmp")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"Expected a folder that can be written to. Received: {path} ({error.strerror}). Name another.") from None
    return path


@contextlib.contextmanager
def replace_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary path. If the block succeeds, the file written there replaces `path`; if it fails, `path` stays unchanged.

    Args:
        path: The file to write.
    """
    path = Path(path)
    temporary = _temporary(path).with_suffix(path.suffix)  # some writers choose the format by the suffix
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replace_folder(path: str | os.PathLike, keep: Callable[[Path], bool] | None = None) -> Iterator[Path]:
    """Yields a temporary folder. If the block succeeds, that folder replaces `path`; if it fails, `path` stays unchanged.

    Args:
        path: The folder to write.
        keep: Called with `path` before it is replaced. If it returns True, the existing folder is kept and the new one is
            discarded, so that a process that is reading the existing folder does not lose it.
    """
    path = Path(path)
    make_folder(path.parent)
    remove_leftovers(path.parent, path.name)
    temporary, old = _temporary(path), _temporary(path, "old")
    temporary.mkdir()
    try:
        yield temporary
        while True:
            if os.path.lexists(path):
                if keep is not None and keep(path):
                    return
                if _exchange(temporary, path):
                    return
                with contextlib.suppress(FileNotFoundError):  # another process has moved it in the meantime
                    os.replace(path, old)
            try:
                os.replace(temporary, path)
                return
            except OSError:
                if not os.path.lexists(path):
                    raise
                _remove(old)  # another process has written the folder in the meantime
    finally:
        _remove(temporary)
        if os.path.lexists(old):
            if os.path.lexists(path):
                _remove(old)
            else:  # interrupted between the two renames: only the old content exists
                os.replace(old, path)


def _exchange(first: Path, second: Path) -> bool:
    """Exchanges two files or folders in one step, so that readers find a complete one at every moment.

    Returns:
        Whether they were exchanged. Not every system and file system supports this.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):  # a C library without it
        return False
    return rename(_HERE, os.fsencode(first), _HERE, os.fsencode(second), _RENAME_EXCHANGE) == 0


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def remove_leftovers(folder: str | os.PathLike, name: str | None = None) -> None:
    """Removes the temporary files of killed processes, and restores old content that they had only moved aside.

    A temporary file of this machine is removed if its process is dead and kept if its process is alive. A temporary folder of
    another machine, which may share the file system, is removed if nothing was written to it for a day.

    Args:
        folder: The folder in which `replace_folder` or `replace_file` was writing.
        name: Considers only temporary files for this destination name. None: for every name.
    """
    folder = Path(folder)
    for left in folder.glob(".*"):
        named = _LEFT.fullmatch(left.name)
        if named is None or (name is not None and named["name"] != name):
            continue
        if named["host"] == _host() and int(named["process"]) != os.getpid():
            is_left = not _is_alive(int(named["process"]))
        else:
            is_left = left.is_dir() and not left.is_symlink() and _last_written(left) < _now(folder) - _OLD_S
        if not is_left:
            continue
        if named["suffix"] == ".old" and not os.path.lexists(folder / named["name"]):
            with contextlib.suppress(OSError):  # another process was quicker
                os.replace(left, folder / named["name"])
        else:
            _remove(left)


def _now(folder: Path) -> float:
    """The current time of the file system's clock, which may be another machine's, in seconds since 1970."""
    probe = _temporary(folder / "probe.tmp")
    try:
        probe.touch()
        return probe.stat().st_mtime
    except OSError:
        return time.time()
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    if os.name != "posix":  # on Windows, os.kill with signal 0 would end the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # the process belongs to another user, or the number is out of range
        return True
    return True


def _last_written(folder: Path) -> float:
    """Time of the last change in a folder, in seconds since 1970; the current time if the folder is being moved away."""
    try:
        return max(path.stat().st_mtime for path in (folder, *folder.rglob("*")))
    except OSError:
        return time.time()


def write_json(path: str | os.PathLike, content: Any) -> None:
    """Writes `content` atomically as indented JSON.

    Args:
        path: The file.
        content: Anything that JSON can express, without NaN and infinity.
    """
    with replace_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def sha256(path: str | os.PathLike) -> str:
    """The SHA-256 checksum of a file, as hexadecimal text."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
