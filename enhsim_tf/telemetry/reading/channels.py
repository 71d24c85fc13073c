"""Reads the channels of a table, each with its times and with findings that say what was
decided.
"""

import dataclasses
import itertools
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS
from enhsim_tf.telemetry.cleaning.numbers import (
    format_cell,
    is_missing,
    is_text,
)
from enhsim_tf.telemetry.cleaning.options import FILE, Cleaning
from enhsim_tf.telemetry.cleaning.raw import RawChannel
from enhsim_tf.telemetry.cleaning.report import Finding, Places
from enhsim_tf.telemetry.cleaning.times import jumps_back
from enhsim_tf.telemetry.reading.clock import NO_TIME
from enhsim_tf.telemetry.reading.column_names import names_series
from enhsim_tf.telemetry.reading.columns import Layout, anomalous, lay_out
from enhsim_tf.telemetry.reading.files import read_table
from enhsim_tf.telemetry.reading.repeated_parts import files_of_rows
from enhsim_tf.telemetry.reading.text_files import Table

_SAID = {
    "row numbers": "columns that number the rows, not taken as channels",
    "quality flags": "columns of quality flags, not taken as channels unless they are named",
    "further clocks": "further columns of times, not taken as channels",
    "own columns": "columns that this tool wrote beside the values, not taken as channels",
    "columns left out": "columns without numbers",
}
_FIRST = "_field field series metric parameter signal variable sensor channel tag".split()
_OFF = set("off false no closed inactive low disabled disarmed stopped down idle 0 n".split())
_PAIR = re.compile(r"[A-Za-z]\w* ?[:=] ?[+-]?\d")  # a name and its value in one cell
_MAX_STATES = 10  # words of a column that are read as states
_MAX_SERIES = 500  # values of a column that tells series apart unasked
_OFTEN = 0.3  # share of the rows whose time repeats, above which a table may hold several series


class Channels(dict[str, RawChannel]):
    """Raw channels by name, with what their source holds beside them.

    Args:
        channels: The channels.
        table: The whole table that the channels are columns of; None if they are from another
            source.
    """

    def __init__(self, channels: Mapping[str, RawChannel], table: pd.DataFrame | None = None):
        super().__init__(channels)
        self.table = table

    def rows_of(self, name: str) -> pd.DataFrame | None:
        """The rows of the table that hold a channel: all of them, unless the table holds several
        series. None if there is no table.
        """
        rows = None if self.table is None else self[name].places.rows
        return self.table if rows is None else self.table.iloc[rows]


def read_table_channels(
    source: Path | Sequence[Path] | pd.DataFrame | pd.Series,
    columns: list[str] | None,
    time: str | None,
    options: Cleaning,
) -> Channels:
    """Reads columns of a table with their times; see `sources.read_source`, which calls it."""
    given = read_table(source, options)
    table = _with_different_names(given, columns, time, options)
    frame = table.frame
    # others are names of series
    named = list(columns) if columns is not None and set(columns) <= set(frame.columns) else None
    layout = lay_out(table, named, time, options)
    several = [name for name in layout.channels if name not in given.frame.columns]
    if columns is None and several:
        raise InputError(
            f"Expected channels of different names. Received: {', '.join(several[:8])} in "
            f"{table.what}, numbered here.",
            [{"columns": list(layout.channels)}, *({"columns": [name]} for name in several[:4])],
            "other names",
        )
    keys = [key for key in _keys_of(layout, options) if key not in (named or ())]
    findings = list(layout.findings)
    for kind, text in _SAID.items():
        used = (*keys, *(layout.words if options.states else ()))
        if names := [name for name in layout.left_out.get(kind, ()) if name not in used]:
            text += f": {', '.join(names[:8])}"
            if any(name in layout.words and _is_state(frame[name]) for name in names):
                text += " (--states reads states)"
            findings.append(Finding(kind, len(names), text))
    if keys:
        chosen, noted = _several_series(layout, keys, columns is None)
    else:
        _refuse_parallel_files(layout)
        names = layout.channels
        noted = []
        if options.states:
            frame, states, noted = _with_states(layout, named)
            names = (*(name for name in names if name not in layout.words), *states)
        chosen = {name: (name, None) for name in names}
    layout = dataclasses.replace(layout, frame=frame, findings=(*findings, *noted))
    if columns is not None and named is None:
        unknown = next((name for name in columns if name not in chosen), None)
        if unknown is not None:
            known = ", ".join(list(chosen)[:8]) or ", ".join(frame.columns[:8])
            raise InputError(
                f"Expected a channel of {table.what}: {known}. Received: {unknown!r}. Name one of "
                "these."
            )
        chosen = {name: chosen[name] for name in columns}
    if not chosen:
        _refuse_without_numbers(layout, bool(keys), options)
    channels = {name: _channel(layout, name, *place, options) for name, place in chosen.items()}
    return Channels(channels, frame)


def _several_series(
    layout: Layout, keys: Sequence[str], leave_out_empty: bool
) -> tuple[dict[str, tuple[str, np.ndarray]], list[Finding]]:
    """Returns the column and the rows of each of several series by its name, without those that
    have no numbers if `leave_out_empty`, and findings.
    """
    chosen = _name_series(layout, keys)
    findings = []
    if leave_out_empty and (
        empty := [name for name, place in chosen.items() if not _has_numbers(layout, *place)]
    ):
        chosen = {name: place for name, place in chosen.items() if name not in empty}
        text = f"series without numbers: {', '.join(empty[:8])}"
        findings.append(Finding("columns left out", len(empty), text))
    text = (
        f"series told apart by {', '.join(keys)}: {len(chosen):,} ({', '.join(list(chosen)[:6])})"
    )
    findings.append(Finding("series", len(chosen), text))
    return chosen, findings


def _refuse_without_numbers(layout: Layout, has_keys: bool, options: Cleaning) -> NoReturn:
    """Refuses a table without channels, and says what was left out."""
    frame = layout.frame
    others = (_with_cell(frame[name]) for names in layout.left_out.values() for name in names)
    left = [finding.text for finding in layout.findings if finding.kind == "files"]
    if named := ", ".join(others):
        left.append(f"left out: {named}")
    left = "".join(f"; {text}" for text in left)
    may_be_states = not options.states and any(_is_state(frame[name]) for name in layout.words)
    pairs = "only numbers below a line of names, with commas between them"
    other = "one number in each cell"
    if ".xls" in layout.what:
        other += ", with the saved values of formulas"
    raise InputError(
        f"Expected a column of numbers. Received: none in {layout.what} beside the times{left}.",
        [{"states": True} | ({"series_column": NO_TIME} if has_keys else {})]
        if may_be_states
        else (),
        pairs if _PAIR.search(left) else other,
    )


def _has_numbers(table: Table, column: str, rows: np.ndarray) -> bool:
    cells = table.frame[column].iloc[rows].dropna()
    return bool(len(cells)) and (
        not is_text(cells) or bool(cells.astype("str").str.contains(r"\d").any())
    )


def _is_state(cells: pd.Series) -> bool:
    """Whether a column of words has from two to ten."""
    return 2 <= cells.nunique() <= _MAX_STATES


def _with_states(
    layout: Layout, named: Sequence[str] | None
) -> tuple[pd.DataFrame, list[str], list[Finding]]:
    """Adds columns of 0 and 1 for columns of words: one for two words, otherwise one for each."""
    frame = layout.frame.copy(deep=False)
    names = []
    findings = []
    for name in layout.words if named is None else [name for name in named if name in layout.words]:
        cells = frame[name].astype("str").str.strip()
        cells = cells.mask(is_missing(frame[name].astype(object)))
        words = sorted(
            cells.dropna().unique(), key=lambda word: (word.casefold() not in _OFF, word)
        )
        if not _is_state(cells):
            continue
        made = {name: words[1]} if len(words) == 2 else {f"{name}={word}": word for word in words}
        for channel, word in made.items():
            frame[channel] = (cells == word).astype(np.float64).mask(cells.isna())
        names += made
        said = f"{words[0]} is 0, {words[1]} is 1" if len(words) == 2 else ", ".join(made)
        findings.append(Finding("states", len(made), f"words of {name!r} read as 0 and 1: {said}"))
    return frame, names, findings


def _refuse_parallel_files(layout: Layout) -> None:
    """Refuses files over the same times, which are no parts of one series."""
    if layout.times is None:
        return
    stamps = pd.Series(layout.times.stamps)
    file, names = files_of_rows(layout.places, len(stamps))
    if len(names) < 2:
        return
    spans = stamps.groupby(file).agg(["min", "max"]).dropna().sort_values(["min", "max"])
    for one, other in itertools.pairwise(spans.itertuples()):
        shorter = min(one.max - one.min, other.max - other.min)
        if min(one.max, other.max) - other.min > shorter / 2:
            first, second = (names[span.Index] for span in (one, other))
            raise InputError(
                f"Expected files whose times follow each other. Received: {first} and {second} "
                f"over the same times, in {layout.what}.",
                [{"part_column": FILE}] if layout.times.counts else (),
                "them one by one",
            )


def _with_cell(cells: pd.Series) -> str:
    """Returns the name of a column with its first cell."""
    given = cells.dropna()
    return f"{cells.name} ({format_cell(given.iloc[0])})" if len(given) else str(cells.name)


def _with_different_names(
    table: Table, columns: Sequence[str] | None, time: str | None, options: Cleaning
) -> Table:
    """Numbers names that repeat, as `volts.1` and `volts.2`; refuses names of options that do not
    occur.
    """
    given = table.frame.columns
    repeated = given[given.duplicated()].unique()
    counts = pd.Series(given).groupby(list(given), sort=False).cumcount() + 1
    names = [
        f"{name}.{number}" if name in repeated else name
        for name, number in zip(given, counts, strict=True)
    ]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(
            f"Expected columns of different names. Received: {twice!r} beside columns of one name, "
            f"which are numbered, in {table.what}. Rename them."
        )
    times = () if time is None else (time,)
    asked = [name for name in columns or () if name in repeated]
    parts = {options.part_column} - {None, FILE}
    asked += [*(options.label_column or ()), *(options.series_column or ()), *parts, *times]
    for name in asked:
        if name not in names and (name != NO_TIME or name in parts):
            raise InputError(
                f"Expected a column of {table.what}: {', '.join(names[:8])}. Received: {name!r}. "
                "Name one of these."
            )
    return dataclasses.replace(table, frame=table.frame.set_axis(names, axis=1))


def _channel(
    layout: Layout, name: str, column: str, rows: np.ndarray | None, options: Cleaning
) -> RawChannel:
    """Makes one raw channel."""
    places = layout.places
    times = layout.times
    labels = layout.left_out.get("labels", ())
    findings = list(layout.findings)
    frame = layout.frame
    if rows is not None:
        frame = frame[[column, *labels]].iloc[rows]
        places = Places(places.files, rows)
        times = None if times is None else times.at(rows)
    cells = frame[column].reset_index(drop=True)
    for label in (label for label in labels if _concerns(label, column, layout)):
        mask = anomalous(frame[label])
        if mask is None:
            said = ", ".join(map(str, frame[label].dropna().unique()[:4]))
            text = (
                f"labels of {label!r}, not used, because its values do not say which is anomalous: "
                f"{said}"
            )
            findings.append(Finding("labels", 1, text))
            continue
        how = "kept" if options.labelled == "keep" else "taken as missing"
        text = f"rows that {label!r} labels anomalous, {how}: {mask.sum():,} of {len(mask):,}"
        findings.append(Finding("labels", max(1, int(mask.sum())), text))
        if options.labelled == "missing":
            cells = cells.mask(mask) if not is_text(cells) else cells.astype(object).mask(mask)
    clock = " and ".join(map(repr, layout.clock.columns))
    return RawChannel(name, cells, times, clock, 0, places, layout.decimal, tuple(findings))


def _concerns(label: str, column: str, layout: Layout) -> bool:
    """Whether a label concerns a channel: one that ends with the name of a channel concerns that
    channel alone.
    """
    owner = [
        name for name in layout.channels if label != name and label.endswith(name) and len(name) > 1
    ]
    return not owner or max(owner, key=len) == column


def _keys_of(layout: Layout, options: Cleaning) -> list[str]:
    """Returns the columns whose values tell several series apart; none if the table holds one."""
    if options.series_column is not None:
        return [] if options.series_column == (NO_TIME,) else list(options.series_column)
    known = (*layout.channels, *layout.left_out.get("row numbers", ()))
    own = [name for name in ("copy", "table") if name in known]
    candidates = [
        name
        for name in (*layout.words, *own)
        if 1 < layout.frame[name].nunique(dropna=False) <= _MAX_SERIES
    ]
    ranks = {name: rank for rank, name in enumerate(_FIRST)}
    candidates.sort(key=lambda name: (name in own, ranks.get(name.casefold(), len(ranks))))
    times = None if layout.times is None else layout.times.stamps.as_unit("ns").asi8
    asks = bool(layout.channels) and not options.states
    chosen: list[str] = []
    for name in candidates:
        if _is_key(layout, name, chosen, times, asks):
            chosen.append(name)
    if not chosen and "_field" in layout.frame and "_value" in layout.channels:
        return ["_field"]
    if not chosen and times is not None:
        _refuse_numbered(layout, times)
    return chosen


def _is_key(
    layout: Layout, name: str, chosen: Sequence[str], times: np.ndarray | None, asks: bool
) -> bool:
    """Whether a column tells more series apart than the columns that were chosen before it; where
    it may be meant as one, `asks` says that this is refused.
    """
    frame = layout.frame
    codes = _codes(frame, [*chosen, name])
    if chosen and codes.max() == _codes(frame, chosen).max():
        return False
    if times is None:
        return names_series(name) and np.bincount(codes).min() > 1
    before, after = (_repeating(frame, keys, times) for keys in (chosen, [*chosen, name]))
    if before > _OFTEN and after < before / 2:
        return True
    if chosen:
        return False
    if names_series(name) and name != "result" and np.bincount(codes).min() > 2:
        return True
    known = times != pd.NaT.value
    times = times[known]
    codes = codes[known]
    spans = pd.Series(times).groupby(codes).agg(np.ptp)
    if (spans < 0.5 * np.ptp(times)).any():  # not all cover the same time
        return False
    changes = np.diff(codes) != 0
    last = codes.max()
    if changes.sum() < 2 * (last + 1):  # one below the other
        return bool(((np.diff(times) < 0) & changes).sum() >= max(1, last) / 2)
    is_word = not frame[name].dropna().astype("str").str.match(r"\s*[+-]?\d").any()
    if asks and is_word and changes.mean() > 0.5:
        raise InputError(
            "Expected one series, or to know what tells several apart. Received: words that "
            f"change from row to row in {name!r} of {layout.what}.",
            [{"series_column": name}, {"series_column": NO_TIME}],
        )
    return False


def _codes(frame: pd.DataFrame, columns: Sequence[str]) -> np.ndarray:
    """Numbers the combinations of values of columns."""
    return frame.groupby(list(columns), sort=False, dropna=False).ngroup().to_numpy()


def _repeating(frame: pd.DataFrame, keys: Sequence[str], times: np.ndarray) -> float:
    """Share of the rows whose time occurred before in the same series."""
    if (np.diff(times) > 0).all():
        return 0.0
    rows = frame[list(keys)].assign(**{"the time": times})[times != pd.NaT.value]
    return float(rows.duplicated().mean()) if len(rows) else 0.0


def _refuse_numbered(layout: Layout, times: np.ndarray) -> None:
    """Refuses a table in which numbers, such as those of sensors, tell series apart, because a
    channel may look alike.
    """
    frame = layout.frame
    if _repeating(frame, [], times) <= _OFTEN:
        return
    # where the clock was set, which is said when the channels are cleaned, a counter is no key
    jumps = jumps_back(times[times != pd.NaT.value])
    for name in frame.columns.difference([*layout.clock.columns], sort=False):
        cells = frame[name]
        if (
            pd.api.types.is_integer_dtype(cells.dtype)
            and layout.channels != (name,)
            and 1 < cells.nunique() <= _MAX_SERIES
            and (names_series(name) or not cells.is_monotonic_increasing)
            and _repeating(frame, [name], times) < 0.02
            and not 0 < len(jumps) < np.count_nonzero(np.diff(cells))
        ):
            raise InputError(
                "Expected one row for each time. Received: times that repeat, with different "
                f"values of {name!r}, in {layout.what}.",
                [{"series_column": name}],
                "a time of day in one column with its date, or an interval with --interval to take "
                "their mean",
            )


def _name_series(layout: Layout, keys: Sequence[str]) -> dict[str, tuple[str, np.ndarray]]:
    """Returns the column and the rows of each series by its name: the values of the keys, and the
    column if there are several.
    """
    frame = layout.frame
    channels = [name for name in layout.channels if name not in keys]
    codes = _codes(frame, keys)
    if (codes.max(initial=-1) + 1) * len(channels) > MAX_COLUMNS:
        raise InputError(
            f"Expected at most {MAX_COLUMNS:,} series. Received: {codes.max() + 1:,} values of "
            f"{', '.join(keys)} in {layout.what}. Give another series_column."
        )
    # a blank line, as databases write at the end, is of no series
    filled = np.flatnonzero(frame.notna().any(axis=1))
    order = filled[np.argsort(codes[filled], kind="stable")]
    found = {}
    for inside in np.split(order, np.flatnonzero(np.diff(codes[order])) + 1):
        words = [
            f"{key} {word}" if key in ("copy", "table") else word.strip()
            for key, word in frame[list(keys)].iloc[inside[0]].map(str).items()
        ]
        for channel in channels:
            name = ".".join([*words, channel] if len(channels) > 1 else words)
            if name in found:
                raise InputError(
                    f"Expected series of different names. Received: {name!r} twice in "
                    f"{layout.what}. Rename one of {', '.join(keys)}."
                )
            found[name] = (channel, inside)
    return found
