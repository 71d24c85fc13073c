"""Says what each column of a table is: clock, label, quality flag, row number, key of several
series, or channel.
"""

import dataclasses
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from enhsim_tf.telemetry.cleaning.numbers import is_missing
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.times import Times, parse_times
from enhsim_tf.telemetry.reading.clock import (
    NO_TIME,
    find_clock,
    further_clocks,
    offset_of,
    refuse_other_zone,
    refuse_own_clocks,
    unit_of,
)
from enhsim_tf.telemetry.reading.clock_parts import Clock
from enhsim_tf.telemetry.reading.clock_values import is_epoch
from enhsim_tf.telemetry.reading.column_names import is_unnamed, names_series, words_of
from enhsim_tf.telemetry.reading.contents import Contents, contents_of
from enhsim_tf.telemetry.reading.repeated_parts import one_after_another, refuse_restarts
from enhsim_tf.telemetry.reading.text_files import Table

_LABELS = set(
    (
        "anomaly anomalies anomalous isanomaly label labels outlier outliers attack fault faulty "
        "changepoint groundtruth"
    ).split()
)
_FLAGS = set("quality qc qa flag flags valid validity mask".split())
_ROWS = set(
    (
        "index idx row rows rownumber record recordnumber id no nr sample samples number entry "
        "scan seq counter"
    ).split()
)
_TESTS = set("test run cycle trial experiment file filename batch lap segment part".split())
_NORMAL = set("0 false no normal nominal ok none good benign healthy regular inlier".split())
_ANOMALOUS = set("1 true yes anomaly anomalous attack fault faulty abnormal outlier".split())
_LABELLED = {"severity", "onset", "end", "mask"}
# columns that give away a file of the commands
_WRITTEN = (_LABELLED, {"value", "score", "flag"}, {"copy", "value", "out_of_range"})
# what these have beside the values
_OWN = _LABELLED.union("scenario enhanced score score_after flag out_of_range".split())
_MAX_STATES = 10  # a label or flag has at most this many different values


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Layout(Table):
    """A table, and what its columns are."""

    clock: Clock
    times: Times | None  # of the clock; None if samples are counted
    channels: tuple[str, ...]
    words: tuple[str, ...]  # which may tell several series apart
    # the other columns by the kind of finding that reports them; "labels" mark anomalous rows
    left_out: Mapping[str, Sequence[str]]


def lay_out(
    table: Table, columns: Sequence[str] | None, time: str | None, options: Cleaning
) -> Layout:
    """Says what each column of a table, in which no name repeats, is; raises an `InputError` if the
    clock cannot be told.

    `columns` are those that were asked for as channels, and `time` is the name of the time column
    or `NO_TIME`.
    """
    asked = set(columns or ())
    contents = contents_of(table, asked, options.time_format)
    kinds = contents.kinds
    numbers = contents.numbers
    roles = dict.fromkeys(asked, "")  # of each column; that of a channel is ""
    _take(roles, _roles_without_clock(contents, asked, options))
    refuse_own_clocks(contents, asked)
    if time is None:
        free = {name: kind for name, kind in kinds.items() if not roles.get(name)}
        values = {name: values for name, values in numbers.items() if name not in roles}
        clock = find_clock(dataclasses.replace(contents, kinds=free, numbers=values))
    else:
        clock = Clock() if time == NO_TIME else Clock((time,), table.frame[time])
    times = _times_of(clock, table, options) if clock.columns else None
    further = further_clocks(contents, clock, times)
    _take(roles, {"clock": clock.columns, "further clocks": further})
    if times is not None and not times.zone and options.timezone is None:
        refuse_other_zone(times, contents, further.difference(clock.columns))
    free_numbers = {name: values for name, values in numbers.items() if name not in roles}
    has_names = "column 1" not in kinds
    counted = [
        name
        for name, values in free_numbers.items()
        if _counts(values, bool(clock.columns), has_names and is_unnamed(name))
    ]
    # if the only column counts, it is the channel
    if len(counted) < sum(not roles.get(name) for name in numbers):
        _take(roles, {"row numbers": counted})
    channels = [name for name in numbers if not roles.get(name)] if columns is None else columns
    words = tuple(name for name in contents.of_kind("words") if not roles.get(name))
    if columns is None:
        _take(roles, {"columns left out": [name for name in kinds if name not in channels]})
    left_out: dict[str, list[str]] = {}
    for name in kinds:
        if roles.get(name, "") not in ("", "clock", "series", "parts"):
            left_out.setdefault(roles[name], []).append(name)
    if options.part_column is not None:
        times, said = one_after_another(table, times, options)
        table = dataclasses.replace(table, findings=(*table.findings, said))
    elif options.series_column is None:
        counters = left_out.get("row numbers", ()) if time is None else ()
        # sensors and places may stand one below the other
        tests = [
            name
            for name in words
            if not names_series(name) and (len(channels) > 1 or _TESTS.intersection(words_of(name)))
        ]
        refuse_restarts(contents, counters, times, tests)
    return Layout(
        **vars(table),
        clock=clock,
        times=times,
        channels=tuple(channels),
        words=words,
        left_out=left_out,
    )


def _take(roles: dict[str, str], names_by_role: Mapping[str, Iterable[str]]) -> None:
    """Gives roles to the columns that have none."""
    for role, names in names_by_role.items():
        for name in names:
            roles.setdefault(name, role)


def _roles_without_clock(
    contents: Contents, asked: Collection[str], options: Cleaning
) -> dict[str, Iterable[str]]:
    """Returns the columns that are told by their names and values alone, by their roles. A column
    of several roles has the first of them.
    """
    names = set(contents.kinds)
    is_written = any(marks <= names for marks in _WRITTEN)
    is_influx = {"result", "table", "_time"} <= names
    return {
        "labels": _labels_of(contents, asked, options),
        "series": options.series_column or (),
        "parts": names & {options.part_column},
        "own columns": _OWN & names if is_written else (),
        "quality flags": [
            name
            for name in contents.kinds
            if _words_of(name) & _FLAGS and _has_states(contents, name)
        ],
        "row numbers": [
            name
            for name, values in contents.numbers.items()
            if _numbers_rows(name, values) or is_influx and name == "table"
        ],
    }


def _times_of(clock: Clock, table: Table, options: Cleaning) -> Times:
    """Parses a clock, with what its other columns add and the zone that its name states."""
    form = options.time_format or unit_of(clock, table)
    what = f"the times {' and '.join(map(repr, clock.columns))} of {table.what}"
    times = parse_times(clock.cells, what, options.drop_bad, form, table.places)
    if clock.added is not None:
        stamps = times.stamps + pd.TimedeltaIndex(clock.added)
        times = dataclasses.replace(times, stamps=stamps)
    if times.zone:
        return times
    offset = offset_of(clock, table, options.timezone)
    if offset is None:
        return times
    stamps = (times.stamps - offset).tz_localize("UTC")
    return dataclasses.replace(times, stamps=stamps, zone="stated in its name")


def _words_of(name: str) -> set[str]:
    split = words_of(name)
    return {*split, *("".join(pair) for pair in zip(split, split[1:], strict=False))}


def _has_states(contents: Contents, name: str) -> bool:
    """Whether a column has only a few values, which are whole numbers or words."""
    kind = contents.kinds[name]
    if kind not in ("numbers", "words"):
        return False
    states = contents.frame[name].dropna().unique()
    if len(states) > _MAX_STATES:
        return False
    return kind == "words" or not any(isinstance(state, float) and state % 1 for state in states)


def _labels_of(contents: Contents, asked: Collection[str], options: Cleaning) -> list[str]:
    """Returns the columns that label anomalous rows: those that the options name, or those whose
    name and values show it.
    """
    if options.label_column is not None:
        return [] if options.label_column == (NO_TIME,) else list(options.label_column)
    found = [
        name
        for name in contents.kinds
        if name not in asked and _words_of(name) & _LABELS and _has_states(contents, name)
    ]
    return [*found, "mask"] if _LABELLED <= set(contents.kinds) - set(asked) else found


def _numbers_rows(name: str, values: np.ndarray) -> bool:
    """Whether a column numbers the rows: it has no name, or one that says so, and counts."""
    words = set(words_of(name))
    if not (words and words <= _ROWS or is_unnamed(name) and not is_epoch(values)):
        return False
    known = values[np.isfinite(values)]  # a blank line has no number
    return len(known) == 1 or bool(len(known)) and bool(np.mean(np.diff(known) == 1) >= 0.9)


def _counts(values: np.ndarray, has_clock: bool, is_index: bool) -> bool:
    """Whether a column numbers the rows by its values: it counts from 0 or 1 beside a clock, or it
    alone has no name (`is_index`) and holds different whole numbers that are no times.
    """
    if has_clock and len(values) > 2 and values[0] in (0, 1) and (np.diff(values) == 1).all():
        return True
    is_whole = is_index and not is_epoch(values) and not (values % 1).any()
    return is_whole and len(np.unique(values)) == len(values)


def anomalous(cells: pd.Series) -> np.ndarray | None:
    """Says which rows a column labels as anomalous: a mask, or None if its values do not show it.

    It holds true and false, 0 and others, -1 and 1 (where -1 is anomalous), or words such as
    "normal" and "attack".
    """
    missing = is_missing(cells.astype(object))
    words = cells.astype("str").str.strip().str.casefold().str.removesuffix(".0")
    given = words[~missing]
    if set(given) == {"-1", "1"}:
        return (words == "-1").to_numpy(bool)
    if not given.isin(_NORMAL).any() and not given.isin(_ANOMALOUS).all():
        return None
    return ~(words.isin(_NORMAL) | missing).to_numpy(bool)
