"""Dirty telemetry becomes regular telemetry, and a report of everything that was done to it.

Times are sorted, doubles taken out, jitter snapped to a regular grid, short gaps filled and long ones made the ends of
parts. What cannot be understood is refused in one line; no row is lost without being reported.
"""

import dataclasses
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.quality_checks import describe_values
from enhsim_tf.telemetry.cleaning.regular_grid import find_binned_segments, find_interval, find_regular_segments, regular_step_fraction
from enhsim_tf.telemetry.cleaning.report import CleaningLog, Report, finding_from_dict, iso_time
from enhsim_tf.telemetry.cleaning.resampling import (
    Rows,
    build_parts,
    drop_duplicate_timestamps,
    drop_missing_values,
    resample_to_common_interval,
)
from enhsim_tf.telemetry.cleaning.times import UNITS_NS, localize_times, parse_times, refuse_repeated_local_hour
from enhsim_tf.telemetry.series import Telemetry

_MIN_REGULAR_FRACTION = 0.4  # share of steps; times drawn at random reach 0.25
_CHOICES = {
    "on_bad_times": ("refuse", "drop"),
    "on_bad_values": ("refuse", "drop"),
    "same_time": ("mean", "first", "last", "refuse"),
    "other_rates": ("resample", "leave out"),
}


@dataclasses.dataclass(frozen=True)
class Cleaning:
    """What to do with dirty telemetry.

    Args:
        interval_s: Sampling interval in seconds; every row goes to the nearest place of this grid and rows that share one
            are averaged. None: the interval that most rows have.
        timezone: Zone of times without one, such as "Europe/Berlin". None: UTC, unless they show a local clock's change.
        time_unit: Unit of times that are numbers: D, h, min, s, ms, us or ns. None: told by their size.
        time_format: Format of times that are text, as `datetime.strptime` takes it. None: ISO 8601.
        on_bad_times: What is no time: "refuse", or "drop" its row.
        on_bad_values: What is no number: "refuse", or "drop" it like a missing value.
        decimal: "," where commas part the decimals even where they look like thousands.
        same_time: Which of different values of one time is taken: their "mean", the "first", the "last", or "refuse".
        max_jitter: How far a time may lie off the regular grid, in intervals, at most 0.5; beyond it the series is parted.
        max_fill: Longest gap that is filled by a straight line, in samples; longer ones part the series.
        other_rates: Stretches of another sampling rate: "resample" or "leave out".
        min_part: Shortest part that is kept, in samples.

    Raises:
        InputError: If an option is out of its range.
    """

    interval_s: float | None = None
    timezone: str | None = None
    time_unit: str | None = None
    time_format: str | None = None
    on_bad_times: str = "refuse"
    on_bad_values: str = "refuse"
    decimal: str | None = None
    same_time: str = "mean"
    max_jitter: float = 0.25
    max_fill: int = 5
    other_rates: str = "resample"
    min_part: int = 2

    def __post_init__(self):
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise InputError(f"Expected {name}, one of: {', '.join(choices)}. Received: {name}={getattr(self, name)!r}.")
        if self.interval_s is not None and not 1e-9 <= self.interval_s <= 1e9:
            raise InputError(f"Expected interval_s from 1e-9 to 1e9 seconds. Received: interval_s={self.interval_s}.")
        if not (0 <= self.max_jitter <= 0.5 and self.max_fill >= 0 and self.min_part >= 1):
            raise InputError(f"Expected 0 <= max_jitter <= 0.5, max_fill >= 0, min_part >= 1. Received: {self}.")
        if self.time_unit is not None and self.time_unit not in UNITS_NS:
            raise InputError(f"Expected time_unit, one of: {', '.join(UNITS_NS)}. Received: time_unit={self.time_unit!r}.")
        if self.decimal not in (None, ".", ","):
            raise InputError(f"Expected decimal, '.' or ','. Received: decimal={self.decimal!r}.")


@dataclasses.dataclass(frozen=True)
class Cleaned:
    """Regular telemetry and how it was come by.

    Args:
        parts: Regular segments on one clock, in the order of time: one interval, one start, each with its own offset.
        report: What was accepted, repaired and left out.
    """

    parts: list[Telemetry]
    report: Report

    @property
    def longest(self) -> Telemetry:
        """The longest part."""
        return max(self.parts, key=len)


def clean(series: pd.Series | np.ndarray, options: Cleaning | None = None) -> Cleaned:
    """Makes regular telemetry of a raw channel.

    Args:
        series: One channel: values of any kind that can be read as numbers, and as its index the times (date-times, ISO
            8601 text, numbers since 1970). With a `RangeIndex`, or as an array, its samples are counted. The unit of its
            values may stand in `series.attrs["unit"]`.
        options: What to do with what is dirty.

    Returns:
        The regular parts, and the report.

    Raises:
        InputError: If it is no series of numbers, or nothing regular is in it.
    """
    options = options or Cleaning()
    is_series = isinstance(series, pd.Series)
    name = "telemetry" if not is_series or series.name is None else str(series.name)
    about = series.attrs if is_series else {}
    values, bad, noted = parse_numbers(series, name, options.on_bad_values == "drop", options.decimal)
    if not len(values):
        raise InputError(f"Expected samples. Received: none from {name}. Give a source that holds a series.")
    has_time = is_series and not isinstance(series.index, pd.RangeIndex)
    if has_time:
        log, rows = _timed_rows(series.index, values, name, options, about)
    elif options.interval_s is not None:
        raise InputError(f"Expected interval_s with times only. Received: interval_s={options.interval_s} with {name}, which has none.")
    else:
        log = CleaningLog(None, map(finding_from_dict, about.get("findings", ())))
        numbers = np.arange(len(values))
        begin = series.index.start if is_series and series.index.step == 1 else 0  # a piece of a longer series keeps its clock
        rows = Rows((numbers + begin) * UNITS_NS["s"], values, numbers, np.ones(len(values), np.int64))
    log.findings += noted

    rows = drop_duplicate_timestamps(rows, bad, log, name, options.same_time)
    rows = drop_missing_values(rows, bad, log, name)
    base = int(rows.times[0])
    rows.times = rows.times - base
    if not has_time:
        interval = float(UNITS_NS["s"])
    elif options.interval_s is not None:
        interval = options.interval_s * 1e9
    elif len(rows) > 1:
        interval = find_interval(rows.times)
        if regular_step_fraction(rows.times, interval) < _MIN_REGULAR_FRACTION:
            raise InputError(
                f"Expected roughly regular times. Received: steps from {np.diff(rows.times).min() / 1e9:g} s to "
                f"{np.diff(rows.times).max() / 1e9:g} s without a rate that most have, in {name}. Give interval_s to average over."
            )
        rows = resample_to_common_interval(rows, interval, log, options.other_rates == "resample", options.max_fill)
    else:
        raise InputError(f"Expected at least 2 rows to tell the interval. Received: 1 usable row from {name}. Give interval_s.")
    if options.interval_s is not None:
        segments = find_binned_segments(rows.times, interval, options.max_fill + 1)
    else:
        segments = find_regular_segments(rows.times, interval, options.max_jitter, options.max_fill + 1)
    share = "mean" if options.interval_s is not None else options.same_time
    parts, used = build_parts(rows, segments, interval, log, name, share, options.max_fill, options.min_part)
    describe_values(parts, log)

    first = parts[0].begin if has_time else -base
    start = iso_time(base + round(first)) if has_time else None
    unit = str(about.get("unit", "1"))
    telemetry = [Telemetry(part.values.astype(np.float32), interval / 1e9, (part.begin - first) / 1e9, start, name, unit) for part in parts]
    report = Report(name, len(values), used, sum(map(len, telemetry)), len(telemetry), interval / 1e9, tuple(log.findings))
    return Cleaned(telemetry, report)


def _timed_rows(index: pd.Index, values: np.ndarray, name: str, options: Cleaning, about: dict[str, Any]) -> tuple[CleaningLog, Rows]:
    """Rows with a time, in the order of time."""
    stamps, bad, noted = parse_times(index, f"the times of {name}", options.on_bad_times == "drop", options.time_unit, options.time_format)
    had_time = stamps.notna()
    local = stamps.tz is None
    if local and options.timezone:
        stamps = localize_times(stamps, options.timezone)
    changed = had_time & stamps.isna()
    times = stamps.as_unit("ns").asi8 if stamps.tz is None else stamps.tz_convert("UTC").tz_localize(None).as_unit("ns").asi8
    log = CleaningLog(times, [*map(finding_from_dict, about.get("findings", ())), *noted])
    kept = np.flatnonzero(stamps.notna())
    unreadable, missing = np.flatnonzero(bad), np.flatnonzero(~had_time & ~bad)
    log.add("bad times", unreadable, "rows whose time cannot be read: {count}", rows_left_out=len(unreadable))
    log.add("missing times", missing, "rows without a time: {count}", rows_left_out=len(missing))
    lost = np.flatnonzero(changed)
    log.add("clock change", lost, f"rows at times that {options.timezone} has twice or never: {{count}}", rows_left_out=len(lost))
    if not len(kept):
        raise InputError(f"Expected rows with times. Received: none in {name}. Name another time column.")
    if local:
        zone = options.timezone or "UTC"
        log.add("time zone", (), f"times without a zone, taken as {zone}: {{count}}", count=len(kept))
        if options.timezone is None:
            refuse_repeated_local_hour(times[kept], kept, log, name)
    steps = np.diff(times[kept])
    if len(steps) and (steps <= 0).all() and (steps < 0).any():
        log.add("descending", (), "rows in falling order of time, turned round: {count}", count=len(kept))
    else:
        early = kept[1:][times[kept][1:] < np.maximum.accumulate(times[kept])[:-1]]
        log.add("unsorted", early, "rows that stood after later ones, sorted: {count}")
    kept = kept[np.argsort(times[kept], kind="stable")]
    return log, Rows(times[kept], values[kept], kept, np.ones(len(kept), np.int64))
