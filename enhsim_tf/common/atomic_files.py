"""Files and folders that appear whole or not at all, and their checksums.

Everything the package writes goes to a temporary name beside its destination and is renamed when it is complete:
a killed process leaves either the old content or the new, never a half. A folder that takes the place of another is
exchanged with it in one step where the system can do that (Linux, on its usual file systems). Elsewhere it takes two
renames; of a process that is killed between them the old content stands aside, and the next `replace_folder` or
`remove_leftovers` puts it back.
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
_MAX_CHARACTERS = 160  # of a file name, encoded: with what two temporary names add (40 each) it stays below the 255 of most file systems
_KEPT = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)  # names that Windows keeps for itself
_HERE, _RENAME_EXCHANGE = -100, 2  # AT_FDCWD and the flag, see renameat2(2)
_OLD_S = 24 * 3600  # no process writes nothing for so long


def _temporary(path: Path, kind: str = "tmp") -> Path:
    return path.with_name(f".{path.name}.{_host()}.{os.getpid()}.{uuid.uuid4().hex[:8]}.{kind}")


@functools.cache
def _host() -> str:
    """What says where a process number means something: this machine, and on it this container. 17 letters, without dots."""
    name, container = socket.gethostname(), "/proc/self/ns/pid"
    whole = name + (os.readlink(container) if os.path.islink(container) else "")
    return f"{re.sub(r'[^A-Za-z0-9-]', '-', name)[:8]}-{hashlib.sha256(whole.encode(errors='replace')).hexdigest()[:8]}"


def encode_name(name: str) -> str:
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
    if not 1 <= len(found) <= _MAX_CHARACTERS:
        raise InputError(
            f"Expected a channel name of 1 to {_MAX_CHARACTERS} letters (signs and letters beyond ASCII count for three or more). "
            f"Received: {name[:60]!r} with {len(found)}. Rename it, or name the other channels."
        )
    return found


def make_folder(path: str | os.PathLike) -> Path:
    """Creates `path` with its parents and returns it; `InputError` where it cannot be a writable folder."""
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
    """Yields a temporary path; when the block ends well, the file written there takes the name `path`."""
    path = Path(path)
    temporary = _temporary(path).with_suffix(path.suffix)  # writers that look at the suffix see the right one
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replace_folder(path: str | os.PathLike, keep: Callable[[Path], bool] | None = None) -> Iterator[Path]:
    """Yields a temporary folder; when the block ends well, it takes the name `path`, replacing what stood there.

    Args:
        path: The folder.
        keep: Asked of what stands there at the end; where it says so, that stays, and the new content is dropped: whoever
            reads the work of another process does not lose it while reading.
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
                with contextlib.suppress(FileNotFoundError):  # another process has moved it meanwhile
                    os.replace(path, old)
            try:
                os.replace(temporary, path)
                return
            except OSError:
                if not os.path.lexists(path):
                    raise
                _remove(old)  # another process has put its own there meanwhile
    finally:
        _remove(temporary)
        if os.path.lexists(old):
            if os.path.lexists(path):
                _remove(old)
            else:  # interrupted between the two renames: what is aside is all that there is
                os.replace(old, path)


def _exchange(first: Path, second: Path) -> bool:
    """Lets two files or folders change their names in one step, so that whoever reads one finds it at every moment.

    Returns:
        Whether it was done; not every system and file system can.
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
    """Removes what killed processes left in a folder under temporary names, and puts back what they had only moved aside.

    A process of this machine that is dead left its own for certain, and one that is alive is at work. A folder that
    belongs to neither may be of another machine that shares this one, and goes when nothing was written to it for a day.

    Args:
        folder: Where `replace_folder` and `replace_file` were to make theirs.
        name: Only those that were to take this name.
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
    """The time by the clock that stamps the files of a folder, which may be another machine's; in seconds since 1970."""
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
