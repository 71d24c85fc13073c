"""Cached stages: each result is kept in a folder whose name says what it depends on, and reused by the next run.

A stage is a function that fills a folder. Its key is a hash of its name, a version that a person raises when the stage's code gives
other results, its settings, and the keys of the stages before it. A folder appears under its name only when it is complete, so an
interrupted run continues after the last finished stage. A folder whose files are not as they were written is reported and made again.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import make_folder, remove_leftovers, replace_folder, sha256, write_json

_RECORD = "stage.json"


def default_cache() -> Path:
    """The default cache: `ENHSIM_TF_CACHE`, or `.cache` in the folder of a source checkout, or the user's cache folder."""
    checkout = Path(__file__).parents[2]
    default = checkout / ".cache" if (checkout / "pyproject.toml").exists() else Path.home() / ".cache" / "enhsim_tf"
    return Path(os.environ.get("ENHSIM_TF_CACHE") or default)


class Stages:
    """The stages of one run.

    Args:
        cache: Folder in which the results are kept.
        fresh: Whether to make every stage again.
        tell: Called with a line about each stage.
    """

    def __init__(self, cache: Path, fresh: bool = False, tell: Callable[[str], None] = print):
        self.cache, self.fresh, self.tell = make_folder(cache), fresh, tell
        remove_leftovers(self.cache)
        self.seconds: dict[str, float] = {}  # how long each stage took when it was made
        self.cached: dict[str, bool] = {}  # whether it came from the cache
        self._keys: dict[str, str] = {}

    def run(
        self, name: str, make: Callable[[Path], None], settings: Mapping[str, Any], version: int = 1, after: Sequence[str] = ()
    ) -> Path:
        """Makes a stage, or finds it in the cache.

        Args:
            name: Name of the stage.
            make: Fills the folder that it is given.
            settings: What the result depends on, values that JSON can express.
            version: Raised by hand when `make` gives other results for the same settings.
            after: Names of the stages, run before, whose results `make` reads.

        Returns:
            The folder with the result.
        """
        depends = [name, version, dict(settings), [self._keys[before] for before in after]]
        key = self._keys[name] = hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()[:16]
        folder = self.cache / f"{name.replace(' ', '_')}-{key}"
        record = None if self.fresh else read_record(folder)
        self.cached[name] = record is not None
        if record is None:
            if folder.exists() and not self.fresh:
                self.tell(f"{name:12} is damaged in the cache; it is made again")
            self.tell(f"{name:12} ...")
            began = time.perf_counter()
            with replace_folder(folder) as temporary:
                make(temporary)
                record = {"seconds": time.perf_counter() - began, "settings": dict(settings), "sha256": _checksums(temporary)}
                write_json(temporary / _RECORD, record)
        self.seconds[name] = record["seconds"]
        self.tell(f"{name:12} {self.seconds[name]:7.1f} s{'  (from the cache)' if self.cached[name] else ''}")
        return folder


def read_record(folder: Path) -> dict[str, Any] | None:
    """What was written about a stage when it was made; None if it is missing or damaged."""
    try:
        record = json.loads((folder / _RECORD).read_text(encoding="utf-8"))
        return record if record["sha256"] == _checksums(folder) and record["seconds"] >= 0 else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _checksums(folder: Path) -> dict[str, str]:
    files = (path for path in sorted(folder.rglob("[!.]*")) if path.is_file() and path != folder / _RECORD)
    return {path.relative_to(folder).as_posix(): sha256(path) for path in files}


def save_arrays(folder: Path, arrays: Mapping[str, Any]) -> None:
    """Keeps arrays and numbers by name in the folder of a stage."""
    np.savez_compressed(folder / "arrays.npz", **{name: np.asarray(values) for name, values in arrays.items()})


def load_arrays(folder: Path) -> dict[str, np.ndarray]:
    """The arrays that `save_arrays` kept; numbers are arrays of shape `()`."""
    with np.load(folder / "arrays.npz", allow_pickle=False) as archive:
        return dict(archive)
