"""Reads a recorded run of a user's simulator from a file or store, with the readers and the
cleaning of telemetry.

The numeric columns are cleaned one by one and brought to one grid. Further columns, such as the
name of a scenario, are carried
along: each sample has the value of the row nearest in time.
"""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.raw import RawChannel
from enhsim_tf.telemetry.cleaning.regular_grid import find_interval, regular_step_fraction
from enhsim_tf.telemetry.cleaning.report import ROWS
from enhsim_tf.telemetry.cleaning.times import localize_times
from enhsim_tf.telemetry.joining import join_channels
from enhsim_tf.telemetry.reading.channels import Channels
from enhsim_tf.telemetry.series import SAME_RATE, Clock, Part, Telemetry
from enhsim_tf.telemetry.sources import Source, read_source

# kinds of such columns
_NO_INPUTS = (
    "labels",
    "quality flags",
    "row numbers",
    "further clocks",
    "own columns",
    "columns left out",
)
# share of steps that are no whole number of intervals, above which a run is interpolated
_FEW_ODD = 0.002
# options of commands that hold for the run, by those of reading telemetry
_OF_RUNS = {
    "time": "coarse_time",
    "columns": "coarse_column",
    "timezone": "timezone",
    "drop_bad": "drop_bad",
    "missing_values": "missing_values",
    "decimal": "decimal",
}


def read_recording(
    source: Source,
    columns: Sequence[str] | None = None,
    time: str | None = None,
    cleaning: Cleaning | None = None,
    interval_s: float | None = None,
    start: str | None = None,
) -> Telemetry:
    """Reads a recorded run.

    Args:
        source: A source of telemetry, see `sources.read_source`.
        columns: Names of the columns that are inputs of the enhancer. None: all columns that hold
            numbers.
        time: Name of a table's time column. None: it is detected.
        cleaning: How problems are treated. None: the defaults. Of several values at one time, as at
            an event, the last is taken.
        interval_s: Sampling interval that the recording is brought to. Finer recordings are
            averaged and coarser ones are interpolated, as are those with steps of any length. None:
            its own interval.
        start: Time of the recording's zero in UTC, as ISO 8601 text, if its times count from zero.
            None: they are those of the telemetry.

    Returns:
        The recording. Its `carried` columns are the other columns of the table.

    Raises:
        InputError: If the source cannot be read, a column is missing, or the columns have no time
            in common.
    """
    cleaning = dataclasses.replace(cleaning or Cleaning(), same_time="last")
    name = "the coarse run"
    if not isinstance(source, pd.DataFrame | pd.Series):
        name = printable(
            Path(os.fspath(source if isinstance(source, str | os.PathLike) else source[0])).name
        )
    try:
        given = read_source(source, columns, time, cleaning)
    except InputError as error:
        # what a command takes for the run; other options are those of the telemetry
        options = [
            {_OF_RUNS[key]: value for key, value in option.items()}
            for option in error.options
            if option.keys() <= _OF_RUNS.keys()
        ]
        raise InputError(error.message, options, error.otherwise or "another run") from None
    raw, stepped = _at_equal_steps(given, interval_s, cleaning)
    cleaned = {column: clean(raw[column], cleaning) for column in raw}
    first = next(iter(cleaned.values()))
    own_s = first.report.interval_s
    notes = [
        f"{name}, {column}: {finding.text}"
        for column, channel in cleaned.items()
        for finding in channel.report.findings
        if finding.action != "accepted"
    ]
    notes += [
        f"{name}: {finding.text}" for finding in first.report.findings if finding.kind in _NO_INPUTS
    ]
    notes += [f"{name}: {stepped}"] if stepped else []
    grid_s = own_s if interval_s is None else float(interval_s)
    if not first.telemetry.clock.has_time and grid_s != 1.0:
        raise InputError(
            f"Expected a coarse run with times, one sample every {grid_s:g} s. Received: {name} "
            "without times. Add a time column."
        )
    if own_s < (1 - SAME_RATE) * grid_s:
        means = dataclasses.replace(cleaning, interval_s=grid_s)
        cleaned = {column: clean(raw[column], means) for column in raw}
        notes.append(f"{name}: a sample every {own_s:g} s, averaged to one every {grid_s:g} s")
    joined = join_channels({column: channel.telemetry for column, channel in cleaned.items()})
    run = joined[0].long_enough(2)
    if len(joined) > 1 or run is None:
        raise InputError(
            f"Expected coarse columns that share some time. Received: {', '.join(raw)[:120]} in "
            f"{name} without any. Fill the gaps."
        )
    if own_s > (1 + SAME_RATE) * grid_s:
        run = _with_more_samples(run, grid_s)
        notes.append(f"{name}: a sample every {own_s:g} s, interpolated to one every {grid_s:g} s")
    if len(run.parts) > 1:
        notes.append(f"{name}: gaps, at which the run is split into {len(run.parts)} parts")
    clock = run.clock
    parts = _with_carried(run, given, cleaning)
    if start is not None:
        if not clock.counts:
            raise InputError(
                "Expected start (--coarse-start) with times that count from zero. Received: "
                f"{name}, which has dates or no times. Leave it out."
            )
        begin = Clock.of(clock.interval_s, start)
        clock = dataclasses.replace(begin, start_ns=begin.start_ns + clock.start_ns)
    return Telemetry(parts, run.columns, clock, name, tuple(map(printable, notes)))


def _with_more_samples(run: Telemetry, interval_s: float) -> Telemetry:
    """Interpolates each part of a run linearly to a smaller interval, all on one grid."""
    parts = []
    for part in run.parts:
        begin = (part.offset_s - run.offset_s) / interval_s
        end = begin + (len(part) - 1) * run.interval_s / interval_s
        grid = np.arange(np.ceil(begin - 1e-3), np.floor(end + 1e-3) + 1)
        times = run.offset_s + interval_s * grid
        parts.append(Part(run.at(times), float(times[0])))
    clock = dataclasses.replace(run.clock, interval_s=interval_s)
    return dataclasses.replace(run, parts=tuple(parts), clock=clock)


def _with_carried(run: Telemetry, given: Channels, cleaning: Cleaning) -> tuple[Part, ...]:
    """Returns the parts of a run with the other columns of its table."""
    first = given[run.columns[0]]
    table = given.rows_of(run.columns[0])
    used = (*run.columns, first.clock.strip("'"))
    others = [
        column
        for column in (() if table is None else table)
        if column not in used and not column.startswith(("column ", "Unnamed: "))
    ]
    if not others:
        return run.parts
    parts = []
    for piece in run.pieces():
        rows = _nearest_rows(first, piece.nanoseconds, cleaning)
        carried = {column: table[column].iloc[rows].reset_index(drop=True) for column in others}
        parts.append(dataclasses.replace(piece.parts[0], carried=carried))
    return tuple(parts)


def _at_equal_steps(
    raw: Mapping[str, RawChannel], interval_s: float | None, cleaning: Cleaning
) -> tuple[dict[str, RawChannel], str]:
    """Interpolates a run whose solver chose its steps, or wrote events between its steps, and says
    so; other runs stay as they are.
    """
    first = next(iter(raw.values()))
    if cleaning.interval_s is not None or first.times is None:
        return dict(raw), ""
    times = np.unique(first.times.stamps.dropna().as_unit("ns").asi8)
    num_rows = len(first.cells)
    if num_rows > 2 * len(times):  # not only an event at each step
        raise InputError(
            f"Expected a time for each row of the coarse run. Received: {num_rows:,} rows with "
            f"{len(times):,} different times. If the clock lost "
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
    return {name: _interpolated(channel, grid, cleaning) for name, channel in raw.items()}, (
        f"steps from {steps.min() / 1e9:.4g} s to {steps.max() / 1e9:.4g} s, interpolated to one "
        f"every {interval / 1e9:.6g} s; "
        f"of {num_rows - len(times):,} rows at the time of another, the last was taken"
    )


def _interpolated(channel: RawChannel, grid: np.ndarray, cleaning: Cleaning) -> RawChannel:
    """Interpolates a channel linearly at times in nanoseconds."""
    values, _, _ = parse_numbers(
        channel.cells,
        channel.name,
        cleaning.drop_bad,
        cleaning.decimal or channel.decimal,
        cleaning.missing_values,
        channel.places,
    )
    stamps = channel.times.stamps
    times = stamps.as_unit("ns").asi8
    there = np.isfinite(values) & stamps.notna()
    known = pd.Series(values[there]).groupby(times[there]).last()
    if not len(known):
        return channel
    inside = grid[(grid >= known.index[0]) & (grid <= known.index[-1])]
    index = pd.DatetimeIndex(inside.view("datetime64[ns]"), tz=None if stamps.tz is None else "UTC")
    values = np.interp(inside, known.index.to_numpy(np.float64), known.to_numpy())
    parsed = dataclasses.replace(channel.times, stamps=index, bad=np.zeros(len(index), bool))
    return dataclasses.replace(channel, cells=pd.Series(values), times=parsed, places=ROWS)


def _nearest_rows(raw: RawChannel, times: np.ndarray, cleaning: Cleaning) -> np.ndarray:
    """Returns, for each time in nanoseconds, the number of the channel's row that is nearest."""
    if raw.times is None:
        return np.clip(times // 10**9 - raw.first, 0, len(raw.cells) - 1)
    stamps = raw.times.stamps
    if stamps.tz is None:
        stamps = localize_times(stamps, cleaning.timezone or "UTC")
    rows = np.flatnonzero(stamps.notna())
    known = pd.DataFrame({"time": stamps[rows].as_unit("ns").asi8, "row": rows}).sort_values(
        "time", kind="stable"
    )
    wanted = pd.DataFrame({"time": times})
    return pd.merge_asof(wanted, known, on="time", direction="nearest")["row"].to_numpy()
