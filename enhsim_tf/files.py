"""Files and folders that appear whole or not at all, and their checksums.

Everything the package writes goes to a temporary name beside its destination and is renamed when it is complete:
a killed process leaves either the old content or the new, never a half.
"""

import contextlib
import hashlib
import json
import os
import re
import shutil
import socket
import time
import urllib.parse
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from enhsim_tf.errors import InputError

_LEFT = re.compile(r"\..*?\.(?:(?P<host>[\w-]+)\.(?P<process>\d+)\.)?[0-9a-f]{8}\.tmp")
_MOST_LETTERS = 180  # of a file name, encoded: with what temporary names add it stays below the 255 of most file systems
_KEPT = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)  # names that Windows keeps for itself
_OLD_S = 24 * 3600  # no process writes nothing for so long


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{_host()}.{os.getpid()}.{uuid.uuid4().hex[:8]}.tmp")


def _host() -> str:
    """This machine's name, short and without dots: a process number means nothing on another."""
    return re.sub(r"[^\w-]", "-", socket.gethostname())[:20] or "host"


def encoded(name: str) -> str:
    """A name, such as a channel's, as that of a file or folder; `urllib.parse.unquote` turns it back.

    It is percent-encoded: no name can leave a folder, hide in it, or be one that a system keeps for itself.

    Raises:
        InputError: If the name is empty, too long for a file, or no Unicode.
    """
    try:
        found = urllib.parse.quote(name, safe=" ").replace(".", "%2E")
    except UnicodeEncodeError:
        raise InputError(f"Expected a channel name of Unicode characters. Received: {name[:60]!r}. Rename it.") from None
    found = re.sub("^ +| +$", lambda spaces: "%20" * len(spaces[0]), found)  # which Windows takes away
    if _KEPT.fullmatch(found):
        found = f"%{ord(found[0]):02X}{found[1:]}"
    if not 1 <= len(found) <= _MOST_LETTERS:
        raise InputError(
            f"Expected a channel name of 1 to {_MOST_LETTERS} letters (signs and letters beyond ASCII count for three or more). "
            f"Received: {name[:60]!r} with {len(found)}. Rename it, or name the other channels."
        )
    return found


def make_folder(path: str | os.PathLike) -> Path:
    """Creates `path` with its parents and returns it; `InputError` where it cannot be a writable folder."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = _temporary(path / "probe")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"Expected a folder that can be written to. Received: {path} ({error.strerror}). Name another.") from None
    return path


@contextlib.contextmanager
def replace_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary path; when the block ends well, the file written there takes the name `path`."""
    path = Path(path)
    temporary = _temporary(path).with_suffix(path.suffix)  # writers that look at the suffix see the right one
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replace_folder(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary folder; when the block ends well, it takes the name `path`, replacing what stood there."""
    path = Path(path)
    make_folder(path.parent)
    temporary, old = _temporary(path), _temporary(path)
    temporary.mkdir()
    try:
        yield temporary
        if path.exists():
            os.replace(path, old)
        try:
            os.replace(temporary, path)
        except OSError:
            if old.exists():
                os.replace(old, path)
            raise
    finally:
        for left in (temporary, old):
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)


def remove_leftovers(folder: str | os.PathLike) -> None:
    """Removes the temporary folders that killed processes left in a folder.

    A process of this machine that is dead left its own for certain. Any other may belong to another machine that shares
    the folder, and goes when nothing was written to it for a day.

    Args:
        folder: Where `replace_folder` was to make its folders.
    """
    for left in Path(folder).glob(".*.tmp"):
        named = _LEFT.fullmatch(left.name)
        if named is None or not left.is_dir() or left.is_symlink():
            continue
        is_dead = named["host"] == _host() and not _is_alive(int(named["process"]))
        if is_dead or _last_written(left) < time.time() - _OLD_S:
            shutil.rmtree(left, ignore_errors=True)


def _is_alive(process: int) -> bool:
    if os.name != "posix":  # elsewhere asking would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # somebody else's, or no number of a process
        return True
    return True


def _last_written(folder: Path) -> float:
    """When anything in a folder was last written, in seconds since 1970; now, where it is being moved away meanwhile."""
    try:
        return max(path.stat().st_mtime for path in (folder, *folder.rglob("*")))
    except OSError:
        return time.time()


def write_json(path: str | os.PathLike, content: Any) -> None:
    """Writes `content` as indented JSON, whole or not at all."""
    with replace_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def sha256(path: str | os.PathLike) -> str:
    """The SHA-256 checksum of a file, as hexadecimal text."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
