"""Reads a recorded run of a user's simulator from a file or store, with the readers and the cleaning of telemetry.

The numeric columns are cleaned one by one and brought to one grid. Further columns, such as the name of a scenario, are carried
along: each sample has the value of the row nearest in time.
"""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.coarse_simulator.pairing import stretches
from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.telemetry.cleaning.clean import Cleaned, Cleaning, clean
from enhsim_tf.telemetry.cleaning.report import iso_time
from enhsim_tf.telemetry.cleaning.times import localize_times
from enhsim_tf.telemetry.registry import FILES
from enhsim_tf.telemetry.series import nanoseconds
from enhsim_tf.telemetry.sources import read_source
from enhsim_tf.telemetry.tables import read_table

_SAME_RATE = 1e-3  # relative difference of two intervals that count as the same
_TABLES = tuple(ending for ending, reader in FILES.items() if reader.endswith(":read_table_channels"))
_QUIET = ("columns left out", "time column", "time zone", "constant", "stuck", "quantised", "changing level", "time unit")


def read_recording(
    source: str | os.PathLike,
    columns: Sequence[str] | None = None,
    time: str | None = None,
    cleaning: Cleaning | None = None,
    interval_s: float | None = None,
) -> Recording:
    """Reads a recorded run.

    Args:
        source: A source of telemetry, see `sources.read_source`.
        columns: Names of the columns that are inputs of the enhancer. None: all columns that hold numbers.
        time: Name of a table's time column. None: it is detected.
        cleaning: How problems are treated. None: the defaults.
        interval_s: Sampling interval that the recording is brought to. Finer recordings are averaged and coarser ones are
            interpolated. None: its own interval.

    Returns:
        The recording. Its `carried` columns are the other columns of the table.

    Raises:
        InputError: If the source cannot be read, a column is missing, or the columns have no time in common.
    """
    cleaning, name = cleaning or Cleaning(), printable(Path(os.fspath(source)).name)
    repaired = [] if columns is None else _compare_columns(source, columns, name)
    raw = read_source(source, columns, time, cleaning)
    names = list(raw)
    cleaned = {each: clean(raw[each], cleaning) for each in names}
    own_s = cleaned[names[0]].report.interval_s
    has_time = cleaned[names[0]].longest.has_time
    notes = repaired + [
        f"{name}, {each}: {finding.text}"
        for each in names
        for finding in cleaned[each].report.findings
        if finding.kind not in _QUIET and finding.action != "accepted"
    ]
    grid_s = own_s if interval_s is None else float(interval_s)
    if not has_time and grid_s != 1.0:
        raise InputError(
            f"Expected a coarse run with times, one sample every {grid_s:g} s. Received: {name} without times. Add a time column."
        )
    if own_s < (1 - _SAME_RATE) * grid_s:
        cleaned = {each: clean(raw[each], dataclasses.replace(cleaning, interval_s=grid_s)) for each in names}
        notes.append(f"{name}: a sample every {own_s:g} s, averaged to one every {grid_s:g} s")
    elif own_s > (1 + _SAME_RATE) * grid_s:
        notes.append(f"{name}: a sample every {own_s:g} s, interpolated to one every {grid_s:g} s")
    base, values = _on_one_grid(cleaned, grid_s, name)
    kept = stretches(np.isfinite(values).all(axis=1))
    kept = [(first, stop) for first, stop in kept if stop - first >= 2]
    if not kept:
        raise InputError(
            f"Expected coarse columns that share some time. Received: {', '.join(names)[:120]} in {name} without any. Fill the gaps."
        )
    if len(kept) > 1:
        notes.append(f"{name}: gaps, at which the run is split into {len(kept)} parts")
    carried = _carried(Path(os.fspath(source)), names, raw[names[0]], cleaning, time)
    parts = []
    for first, stop in kept:
        rows = _nearest_rows(raw[names[0]], base, grid_s, np.arange(first, stop), cleaning) if carried else None
        parts.append(
            Run(values[first:stop], grid_s * first, {each: cells.iloc[rows].reset_index(drop=True) for each, cells in carried.items()})
        )
    start = iso_time(base) if has_time else None
    offset_s = 0.0 if has_time else base / 1e9
    parts = tuple(dataclasses.replace(part, offset_s=part.offset_s + offset_s) for part in parts)
    return Recording(parts, tuple(names), grid_s, start, name, tuple(printable(note) for note in notes))


def _compare_columns(source: str | os.PathLike, columns: Sequence[str], name: str) -> list[str]:
    """Refuses a table that lacks a wanted column, and says if the columns are in another order."""
    path = Path(os.fspath(source))
    if path.suffix.lower() not in _TABLES or not path.is_file():
        return []
    there = list(read_table(path)[0].columns)
    missing = [column for column in columns if column not in there]
    if missing:
        raise InputError(
            f"Expected the coarse columns {', '.join(columns)[:120]}. Received: {name} without {missing[0]!r} "
            f"(it has {', '.join(there)[:120]}). Record that column, or rename it."
        )
    places = [there.index(column) for column in columns]
    return [f"{name}: columns in another order than in the fit, matched by their names"] if places != sorted(places) else []


def _on_one_grid(cleaned: Mapping[str, Cleaned], grid_s: float, name: str) -> tuple[int, np.ndarray]:
    """Returns the time of the first grid point in nanoseconds, and all columns on the grid, NaN where a column has a gap."""
    begins = [int(nanoseconds(each.parts[0], 0, 1)[0]) for each in cleaned.values()]
    base = min(begins)
    spans = []
    for each in cleaned.values():
        for part in each.parts:
            first_s = (int(nanoseconds(part, 0, 1)[0]) - base) / 1e9
            spans.append(first_s + part.interval_s * (len(part) - 1))
    values = np.full((int(np.floor(max(spans) / grid_s + 1e-3)) + 1, len(cleaned)), np.nan, np.float32)
    times = grid_s * np.arange(len(values))
    for number, each in enumerate(cleaned.values()):
        for part in each.parts:
            first_s = (int(nanoseconds(part, 0, 1)[0]) - base) / 1e9
            position = (times - first_s) / part.interval_s
            nearest = np.round(position)
            position = np.where(np.abs(position - nearest) < 1e-3, nearest, position)  # samples on the grid stay unchanged
            inside = (position >= 0) & (position <= len(part) - 1)
            values[inside, number] = np.interp(position[inside], np.arange(len(part)), part.values)
    return base, values


def _carried(path: Path, names: Sequence[str], model: pd.Series, cleaning: Cleaning, time: str | None) -> dict[str, pd.Series]:
    """Returns the raw columns of a table that are neither inputs nor times, by name."""
    if path.suffix.lower() not in _TABLES or not path.is_file():
        return {}
    others = [name for name in read_table(path)[0].columns if name not in (*names, model.index.name) and not name.startswith("column ")]
    return {name: series.reset_index(drop=True) for name, series in read_source(path, others, time, cleaning).items()} if others else {}


def _nearest_rows(raw: pd.Series, base: int, grid_s: float, places: np.ndarray, cleaning: Cleaning) -> np.ndarray:
    """Returns, for each grid point, the number of the source's row that is nearest in time."""
    if isinstance(raw.index, pd.RangeIndex):
        return np.clip(places + base // 10**9 - raw.index.start, 0, len(raw) - 1)
    stamps = pd.DatetimeIndex(raw.index)
    if stamps.tz is None:
        stamps = localize_times(stamps, cleaning.timezone) if cleaning.timezone else stamps.tz_localize("UTC")
    rows = np.flatnonzero(stamps.notna())
    times = stamps[rows].as_unit("ns").asi8
    order = np.argsort(times, kind="stable")
    rows, times = rows[order], times[order]
    wanted = base + np.round(places * grid_s * 1e9).astype(np.int64)
    after = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    if len(times) == 1:
        return np.full(len(wanted), rows[0])
    nearer = np.where(wanted - times[after - 1] <= times[after] - wanted, after - 1, after)
    return rows[nearer]
