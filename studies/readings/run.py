"""Runs the paper once for each reading, seed and rounding, and keeps every measurement of every run
in one table.

A reading is the base with some settings changed. A run is a process of its own, because TensorFlow
chooses its rounding when it starts. The stages that a reading does not touch come from the cache,
and the table is written after every finished run.
"""

import itertools
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from studies.common.measurements import add_runs

BASE = "base"
AUTHOR = "author's configuration"
COLUMNS = (BASE, AUTHOR)
"""The readings that decide verdicts, beside the former base."""

FACTORS: Mapping[str, Mapping[str, Any]] = {
    "2 pi": {"latent_scale": 2 * math.pi},
    "two updates": {"update": "two of 200"},
    "no dropout": {"dropout": 0},
    "he_uniform": {"initialisers": "he_uniform"},
    "no average": {"average": "none"},
}
"""Changes of the factorial."""


def _changed(names: tuple[str, ...]) -> dict[str, Any]:
    return {key: value for name in names for key, value in FACTORS[name].items()}


FACTORIAL = {
    " + ".join(names) or BASE: _changed(names)
    for number in (0, 2, 4)
    for names in itertools.combinations(FACTORS, number)
}
"""Half of all combinations, those with an even number of changes: resolution V, in which neither
single changes nor pairs of them are confounded with each other.
"""
SINGLE: Mapping[str, Mapping[str, Any]] = {
    "average over 15": {"moving_average": 15},
    "average over 51": {"moving_average": 51},
    "trailing average": {"average": "trailing"},
    "latent scale 1": {"latent_scale": 1},
    "learning rate 0.01": {"learning_rate": 0.01},
}
CONTROLS: Mapping[str, Mapping[str, Any]] = {
    f"{AUTHOR}, white noise": FACTORS["two updates"] | FACTORS["no average"],
    f"{AUTHOR}, 2 pi": FACTORS["two updates"] | FACTORS["2 pi"],
    f"{AUTHOR}, 5,000 iterations": FACTORS["two updates"] | {"iterations": 5_000},
}
"""What `studies.author_code` runs with the author's code."""
FORMER = "former base"
KEPT: Mapping[str, Mapping[str, Any]] = {
    FORMER: {"latent_scale": 1},
    "15,000 windows": {"num_windows": 15_000},
}
"""Readings that an earlier version ran, and that are not run again. The former base also showed its
GAN 1,500 rows again and again; C2 is wall time, and C4 was measured otherwise. Of 15,000 windows,
C1 and C3 are kept.
"""
DECIDING = (*COLUMNS, FORMER)
READINGS = {BASE: {}, AUTHOR: FACTORS["two updates"]} | FACTORIAL | SINGLE | CONTROLS | KEPT
ANOTHER = "oneDNN, another processor"
ROUNDINGS = {"oneDNN": "1", "Eigen": "0", ANOTHER: "1"}
"""Values of `TF_ENABLE_ONEDNN_OPTS`, by the library whose order of summation they choose, which
also depends on the processor.
"""
TABLE = "measurements.parquet"


class Run(NamedTuple):
    """One run of the paper.

    Args:
        reading: One of `READINGS`.
        rounding: One of `ROUNDINGS`.
        seed: The seed.
    """

    reading: str
    rounding: str
    seed: int

    @property
    def words(self) -> str:
        """The run without its seed, in words."""
        return f"{self.reading}, {self.rounding}"


KEYS = list(Run._fields)


def runs(num_columns: int, num_others: int, on_another: bool = False) -> list[Run]:
    """The runs in their order: all readings with one seed before the next seed, both columns first,
    and at last the columns with another rounding.

    Args:
        num_columns: Number of seeds of the columns, and of the control with white noise.
        num_others: Number of seeds of every other reading, of 5,000 iterations at most three.
        on_another: Whether this is another processor than that of the first runs.
    """
    white, _, long = CONTROLS
    seeds = dict.fromkeys((*COLUMNS, white), num_columns) | {long: min(num_others, 3)}

    def of_seeds(readings: Iterable[str], rounding: str) -> list[Run]:
        return [
            Run(reading, rounding, seed)
            for seed in range(max(num_columns, num_others))
            for reading in readings
            if seed < seeds.get(reading, num_others)
        ]

    planned = [reading for reading in READINGS if reading not in KEPT]
    if on_another:
        return of_seeds(planned, ANOTHER)
    return of_seeds(planned, "oneDNN") + of_seeds(COLUMNS, "Eigen")


def collect(
    planned: list[Run], budget: str, cache: Path, folder: Path, tell: Callable[[str], None]
) -> pd.DataFrame:
    """Does the runs that the table does not have yet.

    Args:
        planned: The runs.
        budget: `smoke` or `full`.
        cache: Folder of cached stages; each rounding has its own part of it.
        folder: Folder of the table.
        tell: Called with a line about each run.

    Returns:
        The table: one row for each measurement of each claim in each run.
    """
    path = folder / "run.parquet"

    def measure(run: Run) -> pd.DataFrame:
        arguments = ["-m", "studies.readings.one", *run, budget, cache / run.rounding, path]
        environment = os.environ | {"TF_ENABLE_ONEDNN_OPTS": ROUNDINGS[run.rounding]}
        subprocess.run([sys.executable, *map(str, arguments)], env=environment, check=True)
        table = pd.read_parquet(path)
        path.unlink()
        return table

    return add_runs(planned, measure, folder / TABLE, tell)
