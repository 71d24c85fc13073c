"""Turns raw telemetry into regularly sampled telemetry, and reports every change.

Rows are sorted by time, duplicates are dropped, jittered times are snapped to a regular grid, short gaps are filled, and the
series is split at long gaps. Input that cannot be interpreted raises an `InputError`. Every row that is left out is reported.
"""

import dataclasses
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.options import UNITS_NS
from enhsim_tf.telemetry.cleaning.options import Cleaning as Cleaning
from enhsim_tf.telemetry.cleaning.quality_checks import describe_values
from enhsim_tf.telemetry.cleaning.regular_grid import regularise
from enhsim_tf.telemetry.cleaning.report import ROWS, CleaningLog, Finding, Report, iso_time
from enhsim_tf.telemetry.cleaning.times import localize_times, parse_times, refuse_steps_back
from enhsim_tf.telemetry.series import Telemetry


@dataclasses.dataclass(frozen=True)
class Cleaned:
    """The result of `clean`.

    Args:
        parts: Regularly sampled parts in chronological order. All share one interval and one start; each has its own offset.
        report: The log of everything that was accepted, repaired or left out.
    """

    parts: list[Telemetry]
    report: Report

    @property
    def longest(self) -> Telemetry:
        """The longest part."""
        return max(self.parts, key=len)


def clean(series: pd.Series | np.ndarray, options: Cleaning | None = None) -> Cleaned:
    """Turns one raw channel into regularly sampled telemetry.

    Args:
        series: The channel. Its values can be anything that can be parsed as numbers. Its index holds the times: date-times,
            ISO 8601 text, or numbers since 1970. An array, or a series with a `RangeIndex`, has no times, and its samples are
            counted instead.
        options: How problems are treated. None: the defaults of `Cleaning`.

    Returns:
        The regular parts and the cleaning report.

    Raises:
        InputError: If the input is not a series of numbers, or has no regularly sampled part.
    """
    options = options or Cleaning()
    is_series = isinstance(series, pd.Series)
    name = "telemetry" if not is_series or series.name is None else str(series.name)
    about = series.attrs if is_series else {}
    places, decimal = about.get("places", ROWS), options.decimal or about.get("decimal")
    values, bad, noted = parse_numbers(
        series, name, options.drop_bad, decimal, options.missing_values, places
    )
    if not len(values):
        raise InputError(
            f"Expected samples. Received: none from {name}. Give a source that holds a series."
        )
    has_time = is_series and not isinstance(series.index, pd.RangeIndex)
    if has_time:
        log, rows = _rows_with_times(series.index, values, name, options, about)
    elif options.interval_s is not None:
        raise InputError(
            f"Expected times with interval_s (--interval). Received: {name} without any. Give a time column, or leave it out."
        )
    else:
        log = CleaningLog(None, about.get("findings", ()), places)
        log.findings.insert(
            0, Finding("clock", 1, "no clock: samples are counted", details={"column": None})
        )
        numbers = np.arange(len(values))
        begin = (
            series.index.start if is_series and series.index.step == 1 else 0
        )  # a slice of a longer series keeps its sample numbers
        rows = pd.DataFrame(
            {"time": (numbers + begin) * UNITS_NS["s"], "value": values, "row": numbers}
        )
    log.findings += noted

    base = int(rows["time"].iloc[0])
    parts, used, interval = regularise(
        rows.assign(time=rows["time"] - base), bad, log, name, options
    )
    describe_values(parts, values[np.isfinite(values)], log)

    first = parts[0].begin if has_time else -base
    start = iso_time(base + round(first)) if has_time else None
    telemetry = [
        Telemetry(
            part.values.astype(np.float32), interval / 1e9, (part.begin - first) / 1e9, start, name
        )
        for part in parts
    ]
    report = Report(
        name,
        len(values),
        used,
        sum(map(len, telemetry)),
        len(telemetry),
        interval / 1e9,
        tuple(log.findings),
    )
    return Cleaned(telemetry, report)


def _rows_with_times(
    index: pd.Index, values: np.ndarray, name: str, options: Cleaning, about: dict[str, Any]
) -> tuple[CleaningLog, pd.DataFrame]:
    """Parses the times of a raw series and returns the cleaning log and the rows that have a time, in chronological order."""
    places = about.get("places", ROWS)
    parsed = parse_times(
        index, f"the times of {name}", options.drop_bad, options.time_format, places
    )
    stamps, bad, column = (
        parsed.stamps,
        parsed.bad,
        "the index" if index.name is None else repr(str(index.name)),
    )
    clock = about.get("clock") or {
        "column": column,
        "form": parsed.form,
        "zone": parsed.zone,
        "counts": parsed.counts,
    }
    had_time = stamps.notna()
    local = stamps.tz is None
    if local and options.timezone:
        stamps = localize_times(stamps, options.timezone)
    times = stamps.as_unit("ns").asi8
    log = CleaningLog(times, about.get("findings", ()), places, clock["counts"])
    for kind, mask, text in (
        ("bad times", bad, "rows whose time cannot be read"),
        ("missing times", ~had_time & ~bad, "rows without a time"),
        (
            "clock change",
            had_time & stamps.isna(),
            f"rows at ambiguous or nonexistent local times of {options.timezone}",
        ),
    ):
        log.add(kind, np.flatnonzero(mask), f"{text}: {{count}}", rows_left_out=int(mask.sum()))
    kept = np.flatnonzero(stamps.notna())
    if not len(kept):
        raise InputError(
            f"Expected rows with times. Received: none in {name}. Name another time column."
        )
    if clock["counts"] or local:
        refuse_steps_back(times[kept], kept, log, name, options.timezone is not None)
    if local:
        clock = clock | {"zone": f"{options.timezone or 'UTC'}, as none is stated"}
    elif options.timezone and clock["zone"] != "none":
        clock = clock | {"zone": f"{clock['zone']}, which goes before {options.timezone}"}
    early = kept[1:][times[kept][1:] < np.maximum.accumulate(times[kept])[:-1]]
    log.add("unsorted", early, "rows out of chronological order, sorted: {count}")
    kept = kept[np.argsort(times[kept], kind="stable")]
    first, last = int(times[kept[0]]), int(times[kept[-1]])
    span = (
        f"from {first / 1e9:.10g} s to {last / 1e9:.10g} s"
        if clock["counts"]
        else f"from {iso_time(first)} to {iso_time(last)}"
    )
    text = f"the clock is {clock['column']}: {clock['form']}, zone {clock['zone']}, {span}"
    log.findings.insert(
        0, Finding("clock", 1, text, details=clock | {"first_ns": first, "last_ns": last})
    )
    return log, pd.DataFrame({"time": times[kept], "value": values[kept], "row": kept})
