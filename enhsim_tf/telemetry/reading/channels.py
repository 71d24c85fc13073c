"""Reads the channels of a table, each with its times and with findings that say what was decided."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS
from enhsim_tf.telemetry.cleaning.numbers import format_cell, is_text
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding, Places
from enhsim_tf.telemetry.reading.clock import NO_TIME, words_of
from enhsim_tf.telemetry.reading.columns import Layout, anomalous, lay_out
from enhsim_tf.telemetry.reading.files import read_table
from enhsim_tf.telemetry.reading.text_files import Table

_SAID = {
    "row numbers": "columns that number the rows, not taken as channels",
    "quality flags": "columns of quality flags, not taken as channels unless they are named",
    "further clocks": "further columns of times, not taken as channels",
    "own columns": "columns that this tool wrote beside the values, not taken as channels",
    "columns left out": "columns without numbers",
}
_KEYS = set(
    "host hostname sensor sensorid device deviceid node tag tagname channel channelname parameter param signal variable metric field series "
    "measurement point pointname station machine asset entity source location site name id copy table result item object unit".split()
)
_FIRST = (
    "_field",
    "field",
    "series",
    "metric",
    "parameter",
    "signal",
    "variable",
    "sensor",
    "channel",
    "tag",
)
_MAX_SERIES = 500  # values of a column that tells series apart unasked
_OFTEN = 0.3  # share of the rows whose time repeats, above which a table may hold several series


class Channels(dict[str, pd.Series]):
    """Raw channels by name, with what their source holds beside them.

    Args:
        channels: The channels.
        table: The whole table that the channels are columns of; None if they are from another source.
        commands: Commands of the samples of an array, float32 of shape `(samples, commands)`, or None.
    """

    def __init__(
        self,
        channels: Mapping[str, pd.Series],
        table: pd.DataFrame | None = None,
        commands: np.ndarray | None = None,
    ):
        super().__init__(channels)
        self.table, self.commands = table, commands

    def rows_of(self, name: str) -> pd.DataFrame | None:
        """The rows of the table that hold a channel: all of them, unless the table holds several series. None if there is no table."""
        rows = None if self.table is None else self[name].attrs["places"].rows
        return self.table if rows is None else self.table.iloc[rows]


def read_table_channels(
    source: Path | Sequence[Path] | pd.DataFrame | pd.Series,
    columns: list[str] | None,
    time: str | None,
    options: Cleaning,
) -> Channels:
    """Reads columns of a table with their times; see `sources.read_source`, which calls it."""
    what = "the table"
    if not isinstance(source, pd.DataFrame | pd.Series):
        what = source.name if isinstance(source, Path) else f"{source[0].name} ..."
    table = _without_repeats(read_table(source, options), columns, time, options, what)
    named = (
        list(columns) if columns is not None and set(columns) <= set(table.frame.columns) else None
    )  # others are names of series
    layout = lay_out(table, named, time, options, what)
    keys = [key for key in _keys_of(table.frame, layout, options, what) if key not in (named or ())]
    findings = list(table.findings)
    for kind, text in _SAID.items():
        if names := [name for name in layout.left_out.get(kind, ()) if name not in keys]:
            findings.append(Finding(kind, len(names), f"{text}: {', '.join(names[:8])}"))
    if not keys:
        _refuse_parallel_files(table.places, layout, what)
        chosen = {name: (name, None) for name in layout.channels}
    else:
        chosen = _name_series(
            table.frame, keys, [name for name in layout.channels if name not in keys], what
        )
        text = f"series told apart by {', '.join(keys)}: {len(chosen):,} ({', '.join(list(chosen)[:6])})"
        findings.append(Finding("series", len(chosen), text))
    if columns is not None and named is None:
        unknown = next((name for name in columns if name not in chosen), None)
        if unknown is not None:
            known = ", ".join(list(chosen)[:8]) or ", ".join(table.frame.columns[:8])
            raise InputError(
                f"Expected a channel of {what}: {known}. Received: {unknown!r}. Name one of these."
            )
        chosen = {name: chosen[name] for name in columns}
    if not chosen:
        left = ", ".join(
            _with_cell(table.frame[name]) for names in layout.left_out.values() for name in names
        )
        left = "".join(f"; {finding.text}" for finding in findings if finding.kind == "files") + (
            f"; left out: {left}" if left else ""
        )
        raise InputError(
            f"Expected a column of numbers. Received: none in {what} beside the times{left}. Give another table, or name the columns."
        )
    channels = {
        name: _channel(table, layout, name, *place, findings, options)
        for name, place in chosen.items()
    }
    return Channels(channels, table.frame)


def _refuse_parallel_files(places: Places, layout: Layout, what: str) -> None:
    """Refuses files over the same times, which are no parts of one series."""
    if len({name for _, _, name in places}) < 2 or layout.times is None:
        return
    starts = [row for row, _, _ in places]
    stamps = pd.Series(layout.times.stamps)
    spans = (
        stamps.groupby(np.searchsorted(starts, np.arange(len(stamps)), "right") - 1)
        .agg(["min", "max"])
        .dropna()
    )
    for one, other in itertools.pairwise(spans.sort_values(["min", "max"]).itertuples()):
        if min(one.max, other.max) - other.min > min(one.max - one.min, other.max - other.min) / 2:
            first, second = places[one.Index][2], places[other.Index][2]
            raise InputError(
                f"Expected files whose times follow each other. Received: {first} and {second} over the same times, in {what}. Give them one by one."
            )


def _with_cell(cells: pd.Series) -> str:
    """Returns the name of a column with its first cell."""
    given = cells.dropna()
    return f"{cells.name} ({format_cell(given.iloc[0])})" if len(given) else str(cells.name)


def _without_repeats(
    table: Table, columns: Sequence[str] | None, time: str | None, options: Cleaning, what: str
) -> Table:
    """Refuses names that occur twice, unless other columns were asked for, and names of options that do not occur."""
    names = table.frame.columns
    repeated = set(names[names.duplicated()])
    times = () if time is None else (time,)
    named = [*(options.label_column or ()), *(options.series_column or ()), *times]
    for name in [*(columns or ()), *named]:
        if name in repeated or name in named and name not in names and name != NO_TIME:
            received = f"{name!r} more than once in {what}" if name in repeated else repr(name)
            raise InputError(
                f"Expected a column of {what}: {', '.join(dict.fromkeys(names[:8]))}. Received: {received}. Name one of these."
            )
    if columns is None and repeated:
        raise InputError(
            f"Expected columns of different names. Received: {min(repeated)!r} more than once in {what}. Rename them."
        )
    return (
        dataclasses.replace(table, frame=table.frame.loc[:, ~names.isin(repeated)])
        if repeated
        else table
    )


def _channel(
    table: Table,
    layout: Layout,
    name: str,
    column: str,
    rows: np.ndarray | None,
    findings: Sequence[Finding],
    options: Cleaning,
) -> pd.Series:
    """Makes the raw series of one channel."""
    places, times, findings = table.places, layout.times, list(findings)
    frame = table.frame if rows is None else table.frame[[column, *layout.labels]].iloc[rows]
    index: pd.Index = pd.RangeIndex(len(frame))
    attrs: dict = {"places": places if rows is None else Places(places, rows)}
    if table.decimal is not None:
        attrs["decimal"] = table.decimal
    if times is not None:
        index = (times.stamps if rows is None else times.stamps[rows]).rename(
            layout.clock.columns[0]
        )
        columns = " and ".join(map(repr, layout.clock.columns))
        attrs["clock"] = {
            "column": columns,
            "form": times.form,
            "zone": times.zone,
            "counts": times.counts,
        }
        if len(bad := np.flatnonzero(times.bad)):
            where = tuple(places.of(row) for row in bad[:3])
            findings.append(
                Finding(
                    "bad times",
                    len(bad),
                    f"times that cannot be read, taken as missing: {len(bad):,}",
                    where,
                )
            )
    series = pd.Series(frame[column].array, index=index, name=name, copy=False)
    for label in (label for label in layout.labels if _concerns(label, column, layout)):
        mask = anomalous(frame[label])
        if mask is None:
            said = ", ".join(map(str, frame[label].dropna().unique()[:4]))
            text = f"labels of {label!r}, not used, because its values do not say which is anomalous: {said}"
            findings.append(Finding("labels", 1, text))
            continue
        how = "kept" if options.labelled == "keep" else "taken as missing"
        text = f"rows that {label!r} labels anomalous, {how}: {mask.sum():,} of {len(mask):,}"
        findings.append(Finding("labels", max(1, int(mask.sum())), text))
        if options.labelled == "missing":
            series = series.mask(mask) if not is_text(series) else series.astype(object).mask(mask)
    series.attrs = attrs | {"findings": [dataclasses.asdict(finding) for finding in findings]}
    return series


def _concerns(label: str, column: str, layout: Layout) -> bool:
    """Whether a label concerns a channel: one that ends with the name of a channel concerns that channel alone."""
    owner = [
        name for name in layout.channels if label != name and label.endswith(name) and len(name) > 1
    ]
    return not owner or max(owner, key=len) == column


def _keys_of(frame: pd.DataFrame, layout: Layout, options: Cleaning, what: str) -> list[str]:
    """Returns the columns whose values tell several series apart; none if the table holds one."""
    if options.series_column is not None:
        return [] if options.series_column == (NO_TIME,) else list(options.series_column)
    own = [
        name
        for name in ("copy", "table")
        if name in (*layout.channels, *layout.left_out.get("row numbers", ()))
    ]
    candidates = [
        name
        for name in (*layout.words, *own)
        if 1 < frame[name].nunique(dropna=False) <= _MAX_SERIES
    ]
    candidates.sort(
        key=lambda name: next(
            (rank for rank, word in enumerate(_FIRST) if word == name.casefold()), len(_FIRST)
        )
    )
    candidates.sort(key=lambda name: name in own)
    times = None if layout.times is None else layout.times.stamps.as_unit("ns").asi8
    chosen: list[str] = []
    for name in candidates:
        if _is_key(frame, name, chosen, times, what if layout.channels else None):
            chosen.append(name)
    if not chosen and "_field" in frame and "_value" in layout.channels:
        return ["_field"]
    if not chosen and times is not None:
        _refuse_numbered(frame, layout, times, what)
    return chosen


def _is_key(
    frame: pd.DataFrame,
    name: str,
    chosen: Sequence[str],
    times: np.ndarray | None,
    what: str | None,
) -> bool:
    """Whether a column tells more series apart than the columns that were chosen before it; `what` describes the source if it may ask."""
    codes = _codes(frame, [*chosen, name])
    if chosen and codes.max() == _codes(frame, chosen).max():
        return False
    if times is None:
        return _is_named(name) and np.bincount(codes).min() > 1
    before, after = (_repeating(frame, keys, times) for keys in (chosen, [*chosen, name]))
    if before > _OFTEN and after < before / 2:
        return True
    if chosen:
        return False
    if _is_named(name) and name != "result" and np.bincount(codes).min() > 2:
        return True
    known = times != pd.NaT.value
    changes = np.diff(codes[known]) != 0
    back = (np.diff(times[known]) < 0) & changes
    number = codes.max() + 1
    stacked = (
        number > 1
        and back.sum() >= (number - 1) / 2
        and changes.sum() < 2 * number
        and _overlap(times[known], codes[known])
    )
    is_word = not frame[name].dropna().astype("str").str.match(r"\s*[+-]?\d").any()
    if (
        what is not None
        and is_word
        and not stacked
        and changes.mean() > 0.5
        and _overlap(times[known], codes[known])
    ):
        raise InputError(
            f"Expected one series, or to know what tells several apart. Received: words that change from row to row in {name!r} of {what}. Give "
            f"series_column (--series-column {name}, or --series-column none if all rows are of one series)."
        )
    return bool(stacked)


def _is_named(name: str) -> bool:
    words = [word.casefold() for word in words_of(name)]
    return bool(words) and (words[-1] in _KEYS or "".join(words) in _KEYS) and words[0] in _KEYS


def _codes(frame: pd.DataFrame, columns: Sequence[str]) -> np.ndarray:
    """Numbers the combinations of values of columns."""
    return frame.groupby(list(columns), sort=False, dropna=False).ngroup().to_numpy()


def _repeating(frame: pd.DataFrame, keys: Sequence[str], times: np.ndarray) -> float:
    """Share of the rows whose time occurred before in the same series."""
    rows = frame[list(keys)].assign(**{"the time": times})[times != pd.NaT.value]
    return float(rows.duplicated().mean()) if len(rows) else 0.0


def _overlap(times: np.ndarray, codes: np.ndarray) -> bool:
    """Whether every series covers at least half of the whole time."""
    spans = pd.Series(times).groupby(codes).agg(["min", "max"])
    return bool(((spans["max"] - spans["min"]) >= 0.5 * np.ptp(times)).all())


def _refuse_numbered(frame: pd.DataFrame, layout: Layout, times: np.ndarray, what: str) -> None:
    """Refuses a table in which numbers, such as those of sensors, tell series apart, because a channel may look alike."""
    if _repeating(frame, [], times) <= _OFTEN:
        return
    for name, cells in frame.items():
        is_number = (
            pd.api.types.is_integer_dtype(cells.dtype)
            and name not in layout.clock.columns
            and layout.channels != (name,)
        )
        if (
            is_number
            and 1 < cells.nunique() <= _MAX_SERIES
            and _repeating(frame, [name], times) < 0.02
        ):
            raise InputError(
                f"Expected one row for each time. Received: times that repeat, with different values of {name!r}, in {what}. Give "
                f"series_column (--series-column {name}) if it tells several series apart."
            )


def _name_series(
    frame: pd.DataFrame, keys: Sequence[str], channels: Sequence[str], what: str
) -> dict[str, tuple[str, np.ndarray]]:
    """Returns the column and the rows of each series by its name: the values of the keys, and the column if there are several."""
    codes = _codes(frame, keys)
    if (codes.max(initial=-1) + 1) * len(channels) > MAX_COLUMNS:
        raise InputError(
            f"Expected at most {MAX_COLUMNS:,} series. Received: {codes.max() + 1:,} values of {', '.join(keys)} in {what}. Give another series_column."
        )
    filled = np.flatnonzero(
        frame.notna().any(axis=1)
    )  # a blank line, as databases write at the end, is of no series
    order = filled[np.argsort(codes[filled], kind="stable")]
    found = {}
    for inside in np.split(order, np.flatnonzero(np.diff(codes[order])) + 1):
        first = {key: str(frame[key].iloc[inside[0]]) for key in keys}
        words = [
            f"{key} {word}" if key in ("copy", "table") else word.strip()
            for key, word in first.items()
        ]
        for channel in channels:
            name = ".".join([*words, channel] if len(channels) > 1 else words)
            if name in found:
                raise InputError(
                    f"Expected series of different names. Received: {name!r} twice in {what}. Rename one of {', '.join(keys)}."
                )
            found[name] = (channel, inside)
    return found
