"""Labelled series of public data sets: SMAP and MSL in telemanom's layout, and SKAB in its own."""

import dataclasses
import functools
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.windows import runs_of
from studies.public_benchmarks.telemanom import LABELS, Ranges, load_channel, read_labels

SPACECRAFT = "SMAP and MSL"
SKAB = "SKAB"
"""The data sets, within which series are compared."""
DEVELOPMENT = frozenset(
    (
        *("A-1", "A-2", "A-3", "A-5", "A-9", "C-1", "C-2", "D-9", "E-1", "E-7", "E-10", "F-4"),
        *("F-7", "F-8", "G-1", "G-4", "G-6", "M-2", "M-4", "P-1", "P-3", "P-11", "P-15", "R-1"),
        *("S-1", "T-1", "T-3", "T-5", "T-9", "valve1"),
    )
)
"""Channels, and the folder of SKAB, on which settings may be chosen. All others only judge."""
NOMINAL_ROWS = 400
"""Rows of an experiment of SKAB that are learnt, as in its published protocol."""
_ABOUT_ROWS = ("anomaly", "changepoint")  # columns of SKAB that are no channels


@dataclasses.dataclass(frozen=True, eq=False)
class Series:
    """A series with labels.

    Args:
        name: Its name within the data set, for example `A-1` or `valve1/3`.
        data_set: `SPACECRAFT` or `SKAB`.
        nominal: What is learnt, float32 of shape `(samples, channels)`.
        judged: What is judged, of the same channels.
        events: Labelled samples of `judged`, as half-open ranges in the order of time.
    """

    name: str
    data_set: str
    nominal: np.ndarray
    judged: np.ndarray
    events: Ranges

    @property
    def is_development(self) -> bool:
        """Whether settings may be chosen on it."""
        return self.name.partition("/")[0] in DEVELOPMENT


def find_series(folders: Sequence[str | os.PathLike]) -> dict[str, Callable[[], Series]]:
    """Finds the series of folders in either layout.

    Returns:
        For each name a function that loads the series. It raises InputError if a file cannot be
        used or no sample that is judged has a label.

    Raises:
        InputError: If a folder has neither layout, or a name occurs twice.
    """
    found: dict[str, Callable[[], Series]] = {}
    for folder in map(Path, folders):
        if (folder / LABELS).is_file():
            here = {
                name: functools.partial(_spacecraft, folder, name, labels)
                for name, labels in read_labels(folder).items()
            }
        else:
            paths = sorted(path for path in folder.glob("*/*.csv") if _is_experiment(path))
            here = {
                f"{path.parent.name}/{path.stem}": functools.partial(_skab, path) for path in paths
            }
        if not here:
            raise InputError(
                f"Expected a folder with train/, test/ and {LABELS}, as of SMAP and MSL, or with "
                "folders of CSV files with semicolons and the columns "
                f"{' and '.join(_ABOUT_ROWS)}, as of SKAB. Received: {folder}. Name such a folder."
            )
        if twice := sorted(set(here) & set(found)):
            raise InputError(
                f"Expected series of different names. Received: {twice[0]} in two folders. Name "
                "one of these folders."
            )
        found |= here
    return found


def _spacecraft(folder: Path, name: str, labels: Ranges) -> Series:
    return _labelled(Series(name, SPACECRAFT, *load_channel(folder, name, labels)))


def _is_experiment(path: Path) -> bool:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return set(_ABOUT_ROWS) <= set(file.readline().strip().split(";"))


def _skab(path: Path) -> Series:
    import pandas as pd

    try:
        table = pd.read_csv(path, sep=";", encoding="utf-8-sig").drop(
            columns="datetime", errors="ignore"
        )
        values = table.drop(columns=list(_ABOUT_ROWS)).to_numpy(np.float32)
        labels = table[_ABOUT_ROWS[0]].to_numpy(np.float64)
    except ValueError as error:  # pandas raises kinds of it
        raise InputError(
            f"Expected a table of numbers. Received: {str(error).splitlines()[0]} in {path}. "
            "Correct the file."
        ) from None
    if (
        len(values) <= NOMINAL_ROWS
        or not np.isfinite(values).all()
        or not np.isin(labels, (0, 1)).all()
    ):
        raise InputError(
            f"Expected over {NOMINAL_ROWS} rows of finite numbers, with labels 0 and 1. Received: "
            f"{len(values)} rows in {path}, {int((~np.isfinite(values)).sum())} values not finite, "
            f"{int((~np.isin(labels, (0, 1))).sum())} labels of another kind. Correct the file."
        )
    events = tuple(runs_of(labels[NOMINAL_ROWS:] == 1))
    name = f"{path.parent.name}/{path.stem}"
    return _labelled(Series(name, SKAB, values[:NOMINAL_ROWS], values[NOMINAL_ROWS:], events))


def _labelled(series: Series) -> Series:
    if not series.events:
        raise InputError(
            f"Expected a labelled sample among those that are judged. Received: none of "
            f"{series.name}. Leave the series out."
        )
    return series
