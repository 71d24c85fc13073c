"""Turns raw telemetry into regularly sampled telemetry, and reports every change.

Rows are sorted by time, duplicates are dropped, jittered times are snapped to a regular grid, short
gaps are filled, and the series is split at long gaps. Input that cannot be interpreted raises an
`InputError`. Every row that is left out is reported.
"""

import dataclasses
import functools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.options import UNITS_NS
from enhsim_tf.telemetry.cleaning.options import Cleaning as Cleaning
from enhsim_tf.telemetry.cleaning.quality_checks import describe_values
from enhsim_tf.telemetry.cleaning.raw import RawChannel
from enhsim_tf.telemetry.cleaning.regular_grid import regularise
from enhsim_tf.telemetry.cleaning.report import CleaningLog, Finding, Report
from enhsim_tf.telemetry.cleaning.times import (
    ClockError,
    Times,
    localize_times,
    refuse_steps_back,
)
from enhsim_tf.telemetry.series import (
    COUNTED,
    DATES,
    SAMPLES,
    Clock,
    Part,
    Telemetry,
    check_values,
    iso_time,
)

_LONGEST_NS = np.iinfo(np.int64).max  # between two times


@dataclasses.dataclass(frozen=True)
class Cleaned:
    """The result of `clean`.

    Args:
        telemetry: The channel, in regularly sampled parts.
        report: The log of everything that was accepted, repaired or left out.
    """

    telemetry: Telemetry
    report: Report

    @property
    def parts(self) -> list[Telemetry]:
        """The parts as telemetry of their own, in chronological order."""
        return self.telemetry.pieces()

    @property
    def longest(self) -> Telemetry:
        """The longest part."""
        return max(self.parts, key=len)


def clean(
    channel: RawChannel | pd.Series | np.ndarray,
    options: Cleaning | None = None,
    describe: bool = True,
) -> Cleaned:
    """Turns one raw channel into regularly sampled telemetry.

    Args:
        channel: The channel. Its values can be anything that can be parsed as numbers. The index of
            a Series holds the times: date-times, ISO 8601 text, or numbers since 1970. An array, or
            a series with a `RangeIndex`, has no times, and its samples are counted instead.
        options: How problems are treated. None: the defaults of `Cleaning`.
        describe: Whether the report says what is striking about the values, such as fill values.

    Returns:
        The regular parts and the cleaning report.

    Raises:
        InputError: If the input is not a series of numbers, or has no regularly sampled part.
    """
    options = options or Cleaning()
    raw = RawChannel.of(channel, options)
    values, bad, noted = parse_numbers(
        raw.cells,
        raw.name,
        options.drop_bad,
        options.decimal or raw.decimal,
        options.missing_values,
        raw.places,
    )
    if not len(values):
        raise InputError(
            f"Expected samples. Received: none from {raw.name}. Give a source that holds a series."
        )
    kind = SAMPLES if raw.times is None else COUNTED if raw.times.counts else DATES
    if raw.times is not None:
        log, rows, first = _rows_with_times(raw, values, options)
    elif options.interval_s is not None:
        raise InputError(
            f"Expected times with interval_s (--interval). Received: {raw.name} without any. Give "
            "a time column, or leave it out."
        )
    else:
        log = CleaningLog(raw.name, list(raw.findings), raw.places)
        found = Finding("clock", 1, "no clock: samples are counted", details={"column": None})
        log.findings.insert(0, found)
        first = raw.first * UNITS_NS["s"]
        numbers = np.arange(len(values))
        rows = pd.DataFrame({"time": numbers * UNITS_NS["s"], "value": values, "row": numbers})
    log.findings.extend(noted)

    parts, used, interval = regularise(rows, bad, log, options)
    if describe:
        describe_values(parts, values[np.isfinite(values)], log)

    # a clock begins with the first part, and samples are counted from 0
    begin = -first if kind == SAMPLES else parts[0].begin
    clock = Clock(interval / 1e9, 0 if kind == SAMPLES else first + round(begin), kind)
    telemetry = Telemetry(
        tuple(
            Part(
                part.values.astype(np.float32)[:, None],
                (part.begin - begin) / 1e9,
                measured=part.measured[:, None],
            )
            for part in parts
        ),
        (raw.name,),
        clock,
    )
    report = Report(
        raw.name,
        len(values),
        used,
        len(telemetry),
        len(parts),
        clock.interval_s,
        tuple(log.findings),
    )
    return Cleaned(telemetry, report)


def clean_all(
    channels: Mapping[str, RawChannel],
    options: Cleaning,
    describe: bool = True,
    failed: dict[str, Exception] | None = None,
) -> dict[str, Cleaned]:
    """Cleans channels by their names. One that cannot be used goes into `failed` with its error;
    without `failed`, the error is raised, and its last option names the other channels, unless
    they share what is wrong: their clock.
    """
    cleaned = {}
    errors: dict[str, InputError] = {}
    for name, raw in channels.items():
        try:
            usable = clean(raw, options, describe)
            check_values(usable.telemetry.values[:, 0], name)
            cleaned[name] = usable
        except InputError as error:
            if failed is None and isinstance(error, ClockError):
                raise
            errors[name] = error
    if failed is not None:
        failed.update(errors)
    elif errors:
        error = next(iter(errors.values()))
        others = [{"columns": list(cleaned)}] if cleaned else []
        raise InputError(error.message, [*error.options, *others], error.otherwise) from None
    return cleaned


def _rows_with_times(
    raw: RawChannel, values: np.ndarray, options: Cleaning
) -> tuple[CleaningLog, pd.DataFrame, int]:
    """Returns the cleaning log, the rows that have a time, in chronological order with times since
    the first, and the first.
    """
    counts = raw.times.counts
    zone = raw.times.zone
    local = raw.times.stamps.tz is None
    ordered = _in_order(raw.times, options.timezone if local else None)
    times = ordered.of_all
    has_all = len(ordered.rows) == len(times)
    log = CleaningLog(raw.name, list(raw.findings), raw.places, times, counts)
    if not has_all:
        bad = raw.times.bad
        had_time = raw.times.stamps.notna()
        for kind, mask, text in (
            ("bad times", bad, "rows whose time cannot be read"),
            ("missing times", ~had_time & ~bad, "rows without a time"),
            (
                "clock change",
                had_time & (times == pd.NaT.value),
                f"rows at ambiguous or nonexistent local times of {options.timezone}",
            ),
        ):
            log.add(kind, np.flatnonzero(mask), f"{text}: {{count}}")
    if not len(ordered.rows):
        raise InputError(
            f"Expected rows with times. Received: none in {raw.name}. Name another time column."
        )
    if ordered.last - ordered.first > _LONGEST_NS:
        raise ClockError(
            "Expected times within 292 years of each other. Received: times from "
            f"{iso_time(ordered.first)} to {iso_time(ordered.last)} in {raw.name}.",
            otherwise="a part of them",
        )
    if not ordered.is_rising:
        has_time = times != pd.NaT.value
        # rows that are there twice, as where exports overlap, do no harm
        twice = pd.DataFrame({"time": times, "value": values}).duplicated()
        rows = np.flatnonzero(has_time & ~twice & np.isfinite(values))
        is_told = not local or options.timezone is not None
        if counts or not is_told or options.same_time != "last":  # which corrects earlier rows
            refuse_steps_back(times[rows], rows, log, is_told)
        early = np.flatnonzero(has_time & (times < np.maximum.accumulate(times)))
        log.add("unsorted", early, "rows out of chronological order, sorted: {count}")
    if local:
        zone = f"{options.timezone or 'UTC'}, as none is stated"
    elif options.timezone and zone != "none":
        zone = f"{zone}, which goes before {options.timezone}"
    span = (
        f"from {ordered.first / 1e9:.10g} s to {ordered.last / 1e9:.10g} s"
        if counts
        else f"from {iso_time(ordered.first)} to {iso_time(ordered.last)}"
    )
    text = f"the clock is {raw.clock}: {raw.times.form}, zone {zone}, {span}"
    details = {"column": raw.clock, "form": raw.times.form, "zone": zone, "counts": counts}
    details |= {"first_ns": ordered.first, "last_ns": ordered.last}
    log.findings.insert(0, Finding("clock", 1, text, details=details))
    in_order = values if has_all and ordered.is_rising else values[ordered.rows]
    columns = {"time": ordered.since, "value": in_order, "row": ordered.rows}
    return log, pd.DataFrame(columns, copy=False), ordered.first


class _Ordered(NamedTuple):
    """The times of a table in nanoseconds, and its rows in chronological order."""

    of_all: np.ndarray  # times of all rows in the order of the source
    rows: np.ndarray  # the rows that have a time, in chronological order
    since: np.ndarray  # their times since the first
    first: int
    last: int
    is_rising: bool  # whether each of them is later than the one before it in the source


@functools.lru_cache(1)
def _in_order(times: Times, zone: str | None) -> _Ordered:
    """Orders the rows of a table. The last result is kept for the other channels of the table."""
    stamps = times.stamps if zone is None else localize_times(times.stamps, zone)
    of_all = stamps.as_unit("ns").asi8
    rows = np.flatnonzero(stamps.notna())
    steps = np.diff(of_all[rows])
    if (steps < 0).any():
        rows = rows[np.argsort(of_all[rows], kind="stable")]
    ordered = of_all[rows]
    first, last = (int(ordered[0]), int(ordered[-1])) if len(rows) else (0, 0)
    return _Ordered(of_all, rows, ordered - first, first, last, bool((steps > 0).all()))
