"""Discharges of real lithium-ion cells that age, on one grid: the cells of NASA's battery data set.

The data are not part of the project: B. Saha and K. Goebel (2007), "Battery Data Set", NASA
Prognostics Data Repository, NASA Ames Research Center. A folder holds one file a cell: a MATLAB
file as published, or a CSV of the discharges with a column `cycle_idx`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.common.errors import InputError

INTERVAL_S = 10.0
"""The grid in seconds. The recorder kept a sample every 9 to 19 s, mostly every 9 to 13."""
GROUPS: Mapping[str, tuple[float, tuple[str, ...]]] = {
    "24 C, 2 A": (24.0, ("B0005", "B0006", "B0007", "B0018")),
    "24 C, 4 A and 2 A": (24.0, ("B0033", "B0034", "B0036")),
    "43 C, 4 A": (43.0, ("B0029", "B0030", "B0031", "B0032")),
    "4 C, 1 A": (4.0, ("B0045", "B0046", "B0047", "B0048")),
}
"""For each group of cells that were tested alike, the temperature of the room in degrees Celsius,
and its cells.
"""
COLUMNS = ("voltage", "temperature", "current")
"""Columns of a discharge in volts, degrees Celsius and amperes; a discharging current is
positive.
"""
NUM_KNOWN = 10
"""Regular discharges of a new cell that are known."""
KNOWN = "known"
JUDGED = "judged"
ODD = "odd"
"""What a discharge is used for: the first `NUM_KNOWN` regular ones, the later regular ones, and all
whose capacity or values cannot be those of an ageing cell.
"""
_LOADED_A = 0.5  # a smaller current is rest
_LEAST_S = 640.0  # a shorter discharge has no window
_RAW = ("Voltage_measured", "Temperature_measured", "Current_measured", "Time")
# Physical limits under load: the charger stops at 4.2 V, and the rooms are between 4 and 43 degrees
_POSSIBLE = {"voltage": (0.0, 4.25), "temperature": (-10.0, 80.0), "current": (0.0, 4.5)}
_LONGEST_GAP_S = 60.0
_NEIGHBOURS = 21  # discharges whose median capacity says what is regular
_REGULAR = 0.85, 1.2  # smallest and largest capacity of a regular discharge, relative to the median


class Discharge(NamedTuple):
    """One discharge while the load is on.

    Args:
        number: Its number among the discharges of the cell, from 0.
        values: Float64 of shape `(samples, 3)` with `COLUMNS`, `INTERVAL_S` apart.
        capacity_ah: Time integral of the current in ampere-hours.
        is_possible: Whether all values are possible and no gap is longer than a minute.
        use: One of `KNOWN`, `JUDGED` and `ODD`.
    """

    number: int
    values: np.ndarray
    capacity_ah: float
    is_possible: bool
    use: str = ODD


class AgeingCell(NamedTuple):
    """A cell and its discharges.

    Args:
        name: Name of the cell.
        group: Name of its group in `GROUPS`.
        ambient_c: Temperature of the room in degrees Celsius.
        discharges: Its discharges in the order of time.
    """

    name: str
    group: str
    ambient_c: float
    discharges: tuple[Discharge, ...]

    def of_use(self, use: str) -> list[Discharge]:
        """The discharges of a use."""
        return [discharge for discharge in self.discharges if discharge.use == use]

    def loss(self, discharge: Discharge) -> float:
        """The share of the mean capacity of the known discharges that is lost in a discharge."""
        known = np.mean([known.capacity_ah for known in self.of_use(KNOWN)])
        return float(1 - discharge.capacity_ah / known)


def load_cells(folder: Path) -> list[AgeingCell]:
    """Reads the cells of `GROUPS` that a folder has, group by group.

    Raises:
        InputError: If there are not two cells of a group, or a file is not one of a cell.
    """
    cells = []
    for group, (ambient_c, names) in GROUPS.items():
        files = [(name, path) for name in names if (path := _file_of(folder, name)) is not None]
        if len(files) == 1:
            raise InputError(
                f"Expected two or more cells of the group {group!r}, since thresholds are set on "
                f"sisters. Received: only {files[0][0]} in {folder}. Add another one or remove it."
            )
        cells += [
            AgeingCell(name, group, ambient_c, _with_uses(read_discharges(path)))
            for name, path in files
        ]
    if not cells:
        raise InputError(
            f"Expected files of cells, such as B0005.csv or B0029.mat. Received: none in {folder}. "
            "Download the battery data set of NASA's Prognostics Data Repository."
        )
    return cells


def read_discharges(path: Path) -> list[Discharge]:
    """Reads the discharges of one cell that are longer than a window.

    Args:
        path: A published MATLAB file, or a CSV with the same columns and `cycle_idx`.

    Returns:
        The discharges in the order of time; none has a use yet.

    Raises:
        InputError: If the file is not one of a cell.
    """
    recorded = _of_matlab(path) if path.suffix == ".mat" else _of_csv(path)
    discharges = []
    for number, columns in enumerate(recorded):
        missing = [name for name in _RAW if name not in columns]
        if missing:
            raise InputError(
                f"Expected discharges with {', '.join(_RAW)}. Received: no {missing[0]} in {path}."
            )
        discharge = _discharge(number, *(np.ravel(columns[name]).astype(float) for name in _RAW))
        if discharge is not None:
            discharges.append(discharge)
    return discharges


def _file_of(folder: Path, name: str) -> Path | None:
    paths = [folder / f"{name}{suffix}" for suffix in (".mat", ".csv")]
    return next((path for path in paths if path.is_file()), None)


def _of_matlab(path: Path) -> list[Mapping[str, Any]]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        cycles = loadmat(path, simplify_cells=True)[path.stem]["cycle"]
        return [cycle["data"] for cycle in cycles if cycle["type"] == "discharge"]
    except (KeyError, TypeError, ValueError, NotImplementedError, MatReadError):
        raise InputError(
            f"Expected a cell of NASA's battery data set. Received: {path}, in which "
            f"{path.stem}.cycle is missing or has another form. Download the file again."
        ) from None


def _of_csv(path: Path) -> list[Mapping[str, Any]]:
    import pandas as pd

    table = pd.read_csv(path)
    if "cycle_idx" not in table:
        raise InputError(
            f"Expected a column cycle_idx that numbers the discharges. Received: none in {path}."
        )
    return [rows for _, rows in table.groupby("cycle_idx")]


def _discharge(
    number: int, volts: np.ndarray, celsius: np.ndarray, amperes: np.ndarray, seconds: np.ndarray
) -> Discharge | None:
    """Puts the part of a discharge under load on the grid; None if it is shorter than a window."""
    amperes = -amperes  # published as negative while the cell discharges
    loaded = np.flatnonzero(amperes > _LOADED_A)
    if not len(loaded) or seconds[loaded[-1]] - seconds[loaded[0]] < _LEAST_S:
        return None
    inside = slice(loaded[0], loaded[-1] + 1)
    times = seconds[inside] - seconds[loaded[0]]
    raw = dict(zip(COLUMNS, (volts[inside], celsius[inside], amperes[inside]), strict=True))
    is_possible = np.diff(times).max() <= _LONGEST_GAP_S and all(
        low <= raw[name].min() and raw[name].max() <= high
        for name, (low, high) in _POSSIBLE.items()
    )
    grid = np.arange(0.0, times[-1] + 1e-6, INTERVAL_S)
    values = np.stack([np.interp(grid, times, raw[name]) for name in COLUMNS], axis=1)
    current = np.where(raw["current"] > _LOADED_A, raw["current"], 0.0)
    return Discharge(number, values, float(np.trapezoid(current, times) / 3600), bool(is_possible))


def _with_uses(discharges: list[Discharge]) -> tuple[Discharge, ...]:
    """Says what each discharge is used for."""
    capacities = np.array([discharge.capacity_ah for discharge in discharges])
    number = min(_NEIGHBOURS, len(capacities))
    known = 0
    used = []
    for place, discharge in enumerate(discharges):
        first = int(np.clip(place - number // 2, 0, len(capacities) - number))
        relative = discharge.capacity_ah / np.median(capacities[first : first + number])
        use = ODD
        if discharge.is_possible and _REGULAR[0] <= relative <= _REGULAR[1]:
            use = KNOWN if known < NUM_KNOWN else JUDGED
            known += 1
        used.append(discharge._replace(use=use))
    return tuple(used)
