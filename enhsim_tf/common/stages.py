"""Cached stages: each result is stored under a hash of what it depends on and reused by the next
run.

A stage is a function that fills a folder, which is moved into place when it is complete. Its name
contains a hash of the stage's settings and version, of the stages before it, and of the versions of
packages. A person raises the version when changed code changes the result. An interrupted run
leaves only complete stages, after which the next one continues. `stage.json` holds the checksums of
the files: a stage that was damaged since is reported and run again.
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

from enhsim_tf.common.atomic_files import (
    make_folder,
    remove_leftovers,
    replace_file,
    replace_folder,
    sha256,
    write_json,
)
from enhsim_tf.common.console import SILENT, Progress

VERSIONS = {
    name: importlib.metadata.version(name)
    for name in ("tensorflow", "keras", "numpy", "pandas", "scikit-learn")
}


def default_cache() -> Path:
    """The default cache: `ENHSIM_TF_CACHE`, or `.cache` in the folder of a source checkout, or the
    user's cache folder.
    """
    if "ENHSIM_TF_CACHE" in os.environ:
        return Path(os.environ["ENHSIM_TF_CACHE"])
    checkout = Path(__file__).parents[2]
    return (
        checkout / ".cache"
        if (checkout / "pyproject.toml").exists()
        else Path.home() / ".cache" / "enhsim_tf"
    )


class Stages:
    """The stages of one run.

    Args:
        cache: Folder the stages are kept in.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.
        speaks: Whether a long stage also tells how far it is.
    """

    def __init__(
        self,
        cache: Path,
        fresh: bool = False,
        tell: Callable[[str], None] = print,
        speaks: bool = False,
    ):
        self.cache = make_folder(cache)
        self.fresh = fresh
        self.tell = tell
        self.speaks = speaks
        remove_leftovers(self.cache)
        self.seconds: dict[str, float] = {}
        self.cached: dict[str, bool] = {}
        self.progress = SILENT  # of the stage that is being run
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
            version: Version of the code; a person raises it when a change of the code changes the
                result.

        Returns:
            The folder with the stage's results.
        """
        depends = [
            name,
            repr(settings),
            version,
            VERSIONS,
            [self._keys[before] for before in after],
        ]
        key = self._keys[name] = hashlib.sha256(json.dumps(depends).encode()).hexdigest()[:16]
        folder = self.cache / f"{name}-{key}"
        is_there = not self.fresh and os.path.lexists(folder)
        done = _read(folder) if is_there else None
        if is_there and done is None:
            self.tell(f"{name:12} damaged in the cache; it is done again")
        self.cached[name] = done is not None
        if done is None:
            done = self._run(name, make, folder)
        self.seconds[name] = done["seconds"]
        self.tell(
            f"{name:12} {self.seconds[name]:7.1f} "
            f"s{'  (from the cache)' if self.cached[name] else ''}"
        )
        return folder

    def _run(self, name: str, make: Callable[[Path], None], folder: Path) -> dict[str, Any]:
        """Fills the folder of a stage and returns what its `stage.json` holds."""
        self.tell(f"{name:12} ...")
        began = time.perf_counter()
        outer = self.progress
        # if two runs make the same stage, the first result is kept, because the other run may read
        # it
        with replace_folder(
            folder, keep=lambda path: not self.fresh and _read(path) is not None
        ) as temporary:
            self.progress = Progress(self.tell, f"{name:12} ") if self.speaks else SILENT
            try:
                make(temporary)
            finally:
                self.progress = outer
            done = {"seconds": time.perf_counter() - began, "sha256": _checksums(temporary)}
            write_json(temporary / "stage.json", done)
        return done


def _read(folder: Path) -> dict[str, Any] | None:
    """The `stage.json` of a stage; None if a file is missing, changed or not the stage's."""
    try:
        done = json.loads((folder / "stage.json").read_text(encoding="utf-8"))
        return done if done["sha256"] == _checksums(folder) and done["seconds"] >= 0 else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _checksums(folder: Path) -> dict[str, str]:
    """The checksum of each file of a stage but `stage.json`; hidden ones are the system's."""
    paths = [
        path
        for path in sorted(folder.rglob("[!.]*"))
        if path.is_file() and path != folder / "stage.json"
    ]
    return {path.relative_to(folder).as_posix(): sha256(path) for path in paths}


def save_arrays(folder: Path, arrays: Mapping[str, Any], name: str = "arrays") -> None:
    """Stores arrays and numbers by name in the file `name`.npz of a stage."""
    with replace_file(folder / f"{name}.npz") as temporary:
        np.savez_compressed(temporary, **{key: np.asarray(value) for key, value in arrays.items()})


def load_arrays(folder: Path, name: str = "arrays") -> dict[str, np.ndarray]:
    """The arrays and numbers that `save_arrays` stored; numbers are returned as arrays of shape
    `()`.
    """
    with np.load(folder / f"{name}.npz", allow_pickle=False) as archive:
        return dict(archive)
