"""Runs the paper once for each reading, seed and rounding, and keeps every measurement of every run in one table.

A reading is the reference with one setting changed. A run is a process of its own, because TensorFlow chooses its rounding when it
starts. The stages that a reading does not touch come from the cache, and the table is written after every finished run.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from enhsim_tf.common.atomic_files import replace_file

READINGS: Mapping[str, Mapping[str, Any]] = {
    "reference": {},
    "he_uniform in every layer": {"initialisers": "he_uniform"},
    "no dropout": {"dropout": 0},
    "latent scale 4": {"latent_scale": 4},
    "latent scale 2 pi": {"latent_scale": 6.283185},
    "one update, 200 + 200 rows": {"update": "mixed 200 + 200"},
    "two updates of 200 rows": {"update": "two of 200"},
    "trailing average": {"average": "trailing"},
    "learning rate 0.01": {"learning_rate": 0.01},
    "15,000 windows": {"num_windows": 15_000},
}
ANOTHER = "oneDNN, another processor"
ROUNDINGS = {"oneDNN": "1", "Eigen": "0", ANOTHER: "1"}
"""Values of `TF_ENABLE_ONEDNN_OPTS`, by the library whose order of summation they choose, which also depends on the processor."""
TABLE = "measurements.parquet"
KEYS = ["reading", "rounding", "seed"]


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


def runs(num_reference: int, num_other: int, on_another: bool = False) -> list[Run]:
    """The runs in their order: all readings with one seed before the next seed, the reference with both roundings of the processor.

    Args:
        num_reference: Number of seeds of the reference.
        num_other: Number of seeds of every other reading.
        on_another: Whether this is another processor than that of the other runs; only the reference is run on it.
    """
    if on_another:
        return [Run("reference", ANOTHER, seed) for seed in range(num_reference)]
    planned = []
    for seed in range(max(num_reference, num_other)):
        for reading in READINGS:
            if seed < (num_reference if reading == "reference" else num_other):
                planned += [
                    Run(reading, rounding, seed)
                    for rounding in ("oneDNN", "Eigen")
                    if reading == "reference" or rounding == "oneDNN"
                ]
    return planned


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
    path = folder / TABLE
    table = (
        pd.read_parquet(path)
        if path.is_file()
        else pd.DataFrame(columns=[*KEYS, "claim", "name", "value"])
    )
    done = {Run(*row) for row in table[KEYS].drop_duplicates().itertuples(index=False)}
    for number, run in enumerate(planned, 1):
        tell(
            f"run {number} of {len(planned)}: {run.reading}, {run.rounding}, seed {run.seed}{' (in the table)' if run in done else ''}"
        )
        if run in done:
            continue
        measured = folder / "run.parquet"
        arguments = ["-m", "studies.readings.one", *run, budget, cache / run.rounding, measured]
        environment = os.environ | {"TF_ENABLE_ONEDNN_OPTS": ROUNDINGS[run.rounding]}
        subprocess.run([sys.executable, *map(str, arguments)], env=environment, check=True)
        table = (
            pd.concat([table, pd.read_parquet(measured)], ignore_index=True)
            if len(table)
            else pd.read_parquet(measured)
        )
        with replace_file(path) as temporary:
            table.to_parquet(temporary, compression="zstd", index=False)
        measured.unlink()
    return table
