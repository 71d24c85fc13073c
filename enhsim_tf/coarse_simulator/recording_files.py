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

from enhsim_tf.coarse_simulator.recording import SAME_RATE, Recording, Run
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.telemetry.cleaning.clean import Cleaned, Cleaning, clean
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.regular_grid import find_interval, regular_step_fraction
from enhsim_tf.telemetry.cleaning.report import ROWS, iso_time
from enhsim_tf.telemetry.cleaning.times import localize_times
from enhsim_tf.telemetry.series import Telemetry, nanoseconds
from enhsim_tf.telemetry.sources import Source, read_source
from enhsim_tf.telemetry.windows import runs_of

_NO_INPUTS = (
    "labels",
    "quality flags",
    "row numbers",
    "further clocks",
    "own columns",
    "columns left out",
)  # kinds of such columns
_FEW_ODD = (
    0.002  # share of steps that are no whole number of intervals, above which a run is interpolated
)


def read_recording(
    source: Source,
    columns: Sequence[str] | None = None,
    time: str | None = None,
    cleaning: Cleaning | None = None,
    interval_s: float | None = None,
    start: str | None = None,
) -> Recording:
    """Reads a recorded run.

    Args:
        source: A source of telemetry, see `sources.read_source`.
        columns: Names of the columns that are inputs of the enhancer. None: all columns that hold numbers.
        time: Name of a table's time column. None: it is detected.
        cleaning: How problems are treated. None: the defaults. Of several values at one time, as at an event, the last is taken.
        interval_s: Sampling interval that the recording is brought to. Finer recordings are averaged and coarser ones are
            interpolated, as are those with steps of any length. None: its own interval.
        start: Time of the recording's zero in UTC, as ISO 8601 text, if its times count from zero. None: they are those of the telemetry.

    Returns:
        The recording. Its `carried` columns are the other columns of the table.

    Raises:
        InputError: If the source cannot be read, a column is missing, or the columns have no time in common.
    """
    cleaning, name = dataclasses.replace(cleaning or Cleaning(), same_time="last"), "the coarse run"
    if not isinstance(source, pd.DataFrame | pd.Series):
        name = printable(
            Path(os.fspath(source if isinstance(source, str | os.PathLike) else source[0])).name
        )
    given = read_source(source, columns, time, cleaning)
    raw, stepped = _at_equal_steps(given, interval_s, cleaning)
    names, cleaned = list(raw), {each: clean(raw[each], cleaning) for each in raw}
    first = cleaned[names[0]].report
    own_s, has_time, notes = first.interval_s, cleaned[names[0]].longest.has_time, []
    for each, found in cleaned.items():
        notes += [
            f"{name}, {each}: {finding.text}"
            for finding in found.report.findings
            if finding.action != "accepted"
        ]
    notes += [f"{name}: {finding.text}" for finding in first.findings if finding.kind in _NO_INPUTS]
    notes += [f"{name}: {stepped}"] if stepped else []
    grid_s = own_s if interval_s is None else float(interval_s)
    if not has_time and grid_s != 1.0:
        raise InputError(
            f"Expected a coarse run with times, one sample every {grid_s:g} s. Received: {name} without times. Add a time column."
        )
    if own_s < (1 - SAME_RATE) * grid_s:
        cleaned = {
            each: clean(raw[each], dataclasses.replace(cleaning, interval_s=grid_s))
            for each in names
        }
        notes.append(f"{name}: a sample every {own_s:g} s, averaged to one every {grid_s:g} s")
    elif own_s > (1 + SAME_RATE) * grid_s:
        notes.append(f"{name}: a sample every {own_s:g} s, interpolated to one every {grid_s:g} s")
    base, values = _on_one_grid(cleaned, grid_s)
    shared = [
        (begin, end) for begin, end in runs_of(np.isfinite(values).all(axis=1)) if end - begin >= 2
    ]
    if not shared:
        raise InputError(
            f"Expected coarse columns that share some time. Received: {', '.join(names)[:120]} in {name} without any. Fill the gaps."
        )
    if len(shared) > 1:
        notes.append(f"{name}: gaps, at which the run is split into {len(shared)} parts")
    used, offset_s = (*names, given[names[0]].index.name), 0.0 if has_time else base / 1e9
    table = given.rows_of(names[0])
    others = [
        each
        for each in (() if table is None else table)
        if each not in used and not each.startswith(("column ", "Unnamed: "))
    ]
    parts = []
    for begin, end in shared:
        rows = (
            _nearest_rows(given[names[0]], base, grid_s, np.arange(begin, end), cleaning)
            if others
            else []
        )
        carried = {each: table[each].iloc[rows].reset_index(drop=True) for each in others}
        parts.append(Run(values[begin:end], grid_s * begin + offset_s, carried))
    if start is not None:
        if not cleaned[names[0]].longest.counts:
            raise InputError(
                f"Expected start (--coarse-start) with times that count from zero. Received: {name}, which has dates or no times. Leave it out."
            )
        base += _begin_ns(Telemetry(np.zeros(1, np.float32), start=start))
    return Recording(
        tuple(parts),
        tuple(names),
        grid_s,
        iso_time(base) if has_time else None,
        name,
        tuple(map(printable, notes)),
    )


def _at_equal_steps(
    raw: Mapping[str, pd.Series], interval_s: float | None, cleaning: Cleaning
) -> tuple[dict[str, pd.Series], str]:
    """Interpolates a run whose solver chose its steps, or wrote events between its steps, and says so; other runs stay as they are."""
    first = next(iter(raw.values()))
    if cleaning.interval_s is not None or not isinstance(first.index, pd.DatetimeIndex):
        return dict(raw), ""
    times = np.unique(first.index.dropna().as_unit("ns").asi8)
    if len(first) > 2 * len(times):  # not only an event at each step
        raise InputError(
            f"Expected a time for each row of the coarse run. Received: {len(first):,} rows with {len(times):,} different times. If the clock lost "
            "digits, export it as text; if they belong to several series, give one of them."
        )
    interval = find_interval(times) if len(times) > 2 else 1.0
    regular = regular_step_fraction(times, interval) if len(times) > 2 else 1.0
    if regular > 1 - _FEW_ODD:
        return dict(raw), ""
    steps = np.diff(times)
    if interval_s is not None:
        interval = interval_s * 1e9
    elif regular < 0.5:
        interval = float(np.median(steps))
    grid = times[0] + np.round(
        np.arange(np.floor((times[-1] - times[0]) / interval + 1e-6) + 1) * interval
    ).astype(np.int64)
    return {name: _interpolated(series, grid, cleaning) for name, series in raw.items()}, (
        f"steps from {steps.min() / 1e9:.4g} s to {steps.max() / 1e9:.4g} s, interpolated to one every {interval / 1e9:.6g} s; "
        f"of {len(first) - len(times):,} rows at the time of another, the last was taken"
    )


def _interpolated(series: pd.Series, grid: np.ndarray, cleaning: Cleaning) -> pd.Series:
    """Interpolates a series linearly at times in nanoseconds."""
    decimal, places = (
        cleaning.decimal or series.attrs.get("decimal"),
        series.attrs.get("places", ROWS),
    )
    values, _, _ = parse_numbers(
        series, str(series.name), cleaning.drop_bad, decimal, cleaning.missing_values, places
    )
    times = series.index.as_unit("ns").asi8
    there = np.isfinite(values) & series.index.notna()
    known = pd.Series(values[there]).groupby(times[there]).last()
    if not len(known):
        return series
    inside = grid[(grid >= known.index[0]) & (grid <= known.index[-1])]
    index = pd.DatetimeIndex(
        inside.view("datetime64[ns]"),
        name=series.index.name,
        tz=None if series.index.tz is None else "UTC",
    )
    found = pd.Series(
        np.interp(inside, known.index.to_numpy(np.float64), known.to_numpy()),
        index=index,
        name=series.name,
    )
    found.attrs = {key: value for key, value in series.attrs.items() if key != "places"}
    return found


def _on_one_grid(cleaned: Mapping[str, Cleaned], grid_s: float) -> tuple[int, np.ndarray]:
    """Returns the time of the first grid point in nanoseconds, and all columns on the grid, NaN where a column has a gap."""
    base = min(_begin_ns(each.parts[0]) for each in cleaned.values())
    columns = []
    for name, each in cleaned.items():
        runs = tuple(
            Run(part.values[:, None], (_begin_ns(part) - base) / 1e9) for part in each.parts
        )
        columns.append(Recording(runs, (name,), each.parts[0].interval_s))
    end_s = max(
        each.parts[-1].offset_s + each.interval_s * (len(each.parts[-1]) - 1) for each in columns
    )
    times = grid_s * np.arange(int(np.floor(end_s / grid_s + 1e-3)) + 1)
    return base, np.concatenate([each.at(times) for each in columns], axis=1)


def _begin_ns(part: Telemetry) -> int:
    return int(nanoseconds(part, 0, 1)[0])


def _nearest_rows(
    raw: pd.Series, base: int, grid_s: float, places: np.ndarray, cleaning: Cleaning
) -> np.ndarray:
    """Returns, for each grid point, the number of the series' row that is nearest in time."""
    if isinstance(raw.index, pd.RangeIndex):
        return np.clip(places + base // 10**9 - raw.index.start, 0, len(raw) - 1)
    stamps = pd.DatetimeIndex(raw.index)
    if stamps.tz is None:
        stamps = localize_times(stamps, cleaning.timezone or "UTC")
    rows = np.flatnonzero(stamps.notna())
    known = pd.DataFrame({"time": stamps[rows].as_unit("ns").asi8, "row": rows}).sort_values(
        "time", kind="stable"
    )
    wanted = pd.DataFrame({"time": base + np.round(places * grid_s * 1e9).astype(np.int64)})
    return pd.merge_asof(wanted, known, on="time", direction="nearest")["row"].to_numpy()
