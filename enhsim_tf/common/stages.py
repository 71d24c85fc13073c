"""Cached stages: each result is stored under a hash of what it depends on and reused by the next run.

A stage is a function that fills a folder. The folder is moved into place when it is complete. Its name contains a hash of the stage's
settings, of its version, of the stages before it, and of the versions of packages. A person raises the version when changed code changes
the result; code that was moved or renamed finds its results again. An interrupted run leaves only complete stages; the next run continues
after the last one and removes incomplete ones. `stage.json` holds the checksums of the files: a stage that was damaged since is reported
and run again.
"""

import hashlib
import importlib.metadata
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import make_folder, remove_leftovers, replace_file, replace_folder, sha256, write_json
from enhsim_tf.common.console import SILENT, Progress, time_left

VERSIONS = {name: importlib.metadata.version(name) for name in ("tensorflow", "keras", "numpy", "pandas", "scikit-learn")}


def default_cache() -> Path:
    """The default cache: `ENHSIM_TF_CACHE`, or `.cache` in the folder of a source checkout, or the user's cache folder."""
    if "ENHSIM_TF_CACHE" in os.environ:
        return Path(os.environ["ENHSIM_TF_CACHE"])
    checkout = Path(__file__).parents[2]
    return checkout / ".cache" if (checkout / "pyproject.toml").exists() else Path.home() / ".cache" / "enhsim_tf"


class Stages:
    """The stages of one run.

    Args:
        cache: Folder the stages are kept in.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.
        speaks: Whether a long stage also tells how far it is.
    """

    def __init__(self, cache: Path, fresh: bool = False, tell: Callable[[str], None] = print, speaks: bool = False):
        self.cache, self.fresh, self.tell = make_folder(cache), fresh, tell
        remove_leftovers(self.cache)
        self.seconds: dict[str, float] = {}
        self.cached: dict[str, bool] = {}
        self.progress = SILENT  # while a stage is done, its own
        self.speaks = speaks
        self._keys: dict[str, str] = {}

    def run(
        self,
        name: str,
        make: Callable[[Path], None],
        settings: Any,
        after: Iterable[str] = (),
        version: int = 1,
    ) -> Path:
        """Runs a stage, or finds it in the cache.

        Args:
            name: Name of the stage.
            make: Fills the folder it is given.
            settings: What the result depends on, anything with a faithful `repr`.
            after: Names of the stages whose results `make` reads.
            version: Version of the code; a person raises it when a change of the code changes the result.

        Returns:
            The folder with the stage's results.
        """
        depends = [name, repr(settings), version, VERSIONS, [self._keys[before] for before in after]]
        key = self._keys[name] = hashlib.sha256(json.dumps(depends).encode()).hexdigest()[:16]
        folder = self.cache / f"{name}-{key}"
        done, damage = (None, None) if self.fresh or not os.path.lexists(folder) else _read(folder, name)
        if damage is not None:
            self.tell(f"{name:12} damaged in the cache: {damage}; it is done again")
        self.cached[name] = done is not None
        if done is None:
            self.tell(f"{name:12} ...")
            began = time.perf_counter()
            # if two runs make the same stage, the first result is kept, because the other run may read it
            with replace_folder(folder, None if self.fresh else lambda path: _read(path, name)[1] is None) as temporary:
                self._make(name, make, temporary)
                done = {"stage": name, "seconds": time.perf_counter() - began, "sha256": _checksums(temporary)}
                write_json(temporary / "stage.json", done | {"checksum": _checksum(done)})
        self.seconds[name] = done["seconds"]
        self.tell(f"{name:12} {self.seconds[name]:7.1f} s{'  (from the cache)' if self.cached[name] else ''}")
        return folder

    def _make(self, name: str, make: Callable[[Path], None], folder: Path) -> None:
        """Fills the folder of a stage, which meanwhile finds its own progress here."""
        outer, self.progress = self.progress, Progress(self.tell if self.speaks else None, f"{name:12} ")
        try:
            make(folder)
        finally:
            self.progress = outer


class Turns:
    """Replicates or channels in turn: which of how many it is, and how long the others will take.

    That is judged by those that this run trained; before there is one, by those that it found done.

    Args:
        what: What they are, in the singular.
        total: How many.
        tell: Called with each line.
        clock: Seconds that only rise.
    """

    def __init__(self, what: str, total: int, tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic):
        self.what, self.total, self.tell, self.clock = what, total, tell, clock
        self.spent: dict[bool, list[float]] = {True: [], False: []}  # by whether it was found done
        self.began = self.turn_began = clock()

    def begin(self, name: str) -> None:
        """Tells that the next one begins, and its name."""
        self.turn_began = self.clock()
        self.tell(f"{self.what} {self._done + 1} of {self.total}: {name}")

    def end(self, stages: Stages) -> None:
        """Tells that one has ended, whose stages these were."""
        now = self.clock()
        self.spent[all(stages.cached.values())].append(now - self.turn_began)
        judged = self.spent[False] or self.spent[True]
        left = sum(judged) / len(judged) * (self.total - self._done)
        said = f"{self._done} of {self.total} {self.what}s in {now - self.began:.0f} s"
        self.tell(f"{said}; {time_left(left)}" if self._done < self.total else said)

    @property
    def _done(self) -> int:
        return len(self.spent[True]) + len(self.spent[False])


def _read(folder: Path, name: str) -> tuple[dict[str, Any] | None, str | None]:
    """What was written of a stage in its `stage.json`; or what is wrong with the stage."""
    try:
        done = json.loads((folder / "stage.json").read_text(encoding="utf-8"))
        checksum = done.pop("checksum")
        if checksum != _checksum(done) or done["stage"] != name:
            raise ValueError
        expected = done["sha256"]
    except FileNotFoundError:
        return None, "stage.json is missing"
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None, "stage.json is not as it was written"
    try:
        found = _checksums(folder)
    except OSError as error:
        return None, f"{Path(error.filename or folder).name} cannot be read"
    for file in sorted(expected.keys() | found.keys()):
        if expected.get(file) != found.get(file):
            wrong = "is missing" if file not in found else "is not of it" if file not in expected else "is not as it was written"
            return None, f"{file} {wrong}"
    return done, None


def _checksum(done: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(done, sort_keys=True).encode()).hexdigest()


def _checksums(folder: Path) -> dict[str, str]:
    """The checksum of each file of a stage but `stage.json`; hidden ones are the system's."""
    paths = [path for path in sorted(folder.rglob("[!.]*")) if path.is_file() and path != folder / "stage.json"]
    return {path.relative_to(folder).as_posix(): sha256(path) for path in paths}


def save_arrays(folder: Path, arrays: Mapping[str, Any], name: str = "arrays") -> None:
    """Stores arrays and numbers of a stage.

    Args:
        folder: Where.
        arrays: Arrays and numbers by name.
        name: Name of the file, without its `.npz`.
    """
    with replace_file(folder / f"{name}.npz") as temporary:
        np.savez_compressed(temporary, **{key: np.asarray(value) for key, value in arrays.items()})


def load_arrays(folder: Path, name: str = "arrays") -> dict[str, np.ndarray]:
    """The arrays and numbers that `save_arrays` stored; numbers are returned as arrays of shape `()`."""
    with np.load(folder / f"{name}.npz", allow_pickle=False) as archive:
        return dict(archive)
