"""Finds several series in one table: columns whose values tell hosts, sensors or fields apart, so that times repeat."""

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import MAX_COLUMNS
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.reading.clock import NO_TIME
from enhsim_tf.telemetry.reading.columns import Layout

_KEYS = set(
    "host hostname sensor sensorid device deviceid node tag tagname channel channelname parameter param signal variable metric field series "
    "measurement point pointname station machine asset entity source location site name id copy table result item object".split()
)
_FIRST = ("_field", "field", "series", "metric", "parameter", "signal", "variable", "sensor", "channel", "tag")
_MAX_SERIES = 500  # values of a column that tells series apart unasked
_OFTEN = 0.3  # share of the rows whose time repeats, above which a table may hold several series


def keys_of(frame: pd.DataFrame, layout: Layout, options: Cleaning, what: str) -> list[str]:
    """Returns the columns whose values tell several series apart; none if the table holds one.

    Args:
        frame: The table.
        layout: What its columns are.
        options: `series_column` is used.
        what: Description of the source, for messages.

    Raises:
        InputError: If a column of numbers seems to tell series apart.
    """
    if options.series_column is not None:
        return [] if options.series_column == (NO_TIME,) else list(options.series_column)
    own = [
        name
        for name in ("copy", "table")
        if name in frame.columns and (name in layout.channels or name in layout.left_out.get("row numbers", ()))
    ]
    candidates = [name for name in (*layout.words, *own) if 1 < frame[name].nunique() <= _MAX_SERIES]
    candidates.sort(key=lambda name: next((rank for rank, word in enumerate(_FIRST) if word == name.casefold()), len(_FIRST)))
    candidates.sort(key=lambda name: name in own)
    times = None if layout.times is None else layout.times.stamps.tz_localize(None).as_unit("ns").asi8
    chosen: list[str] = []
    for name in candidates:
        if _is_key(frame, name, chosen, times, what if layout.channels else None):
            chosen.append(name)
    if not chosen and "_field" in frame and "_value" in layout.channels:
        return ["_field"]
    if not chosen and times is not None:
        _refuse_numbered(frame, layout, times, what)
    return chosen


def _is_key(frame: pd.DataFrame, name: str, chosen: Sequence[str], times: np.ndarray | None, what: str | None) -> bool:
    """Whether a column tells more series apart than the columns that were chosen before it; `what` describes the source if it may ask."""
    before = _codes(frame, chosen)
    codes = _codes(frame, [*chosen, name])
    if codes.max() == before.max():
        return False
    if times is None:
        return _is_named(name) and np.bincount(codes).min() > 1
    repeats = [_repeating(times, each) for each in (before, codes)]
    if repeats[0] > _OFTEN and repeats[1] < repeats[0] / 2:
        return True
    if chosen:
        return False
    if _is_named(name) and name != "result" and np.bincount(codes).min() > 2:
        return True
    known = times != pd.NaT.value
    changes = np.diff(codes[known]) != 0
    back = (np.diff(times[known]) < 0) & changes
    number = codes.max() + 1
    stacked = number > 1 and back.sum() >= (number - 1) / 2 and changes.sum() < 2 * number and _overlap(times[known], codes[known])
    is_word = not frame[name].dropna().astype("str").str.match(r"\s*[+-]?\d").any()
    if what is not None and is_word and not stacked and changes.mean() > 0.5 and _overlap(times[known], codes[known]):
        raise InputError(
            f"Expected one series, or to know what tells several apart. Received: words that change from row to row in {name!r} of {what}. Give "
            f"series_column (--series-column {name}, or --series-column none if all rows are of one series)."
        )
    return bool(stacked)


def _is_named(name: str) -> bool:
    words = re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).casefold())
    return bool(words) and (words[-1] in _KEYS or "".join(words) in _KEYS) and words[0] in _KEYS


def _codes(frame: pd.DataFrame, columns: Sequence[str]) -> np.ndarray:
    """Numbers the combinations of values of columns."""
    if not columns:
        return np.zeros(len(frame), np.int64)
    return frame.groupby(list(columns), sort=False, dropna=False).ngroup().to_numpy()


def _repeating(times: np.ndarray, codes: np.ndarray) -> float:
    """Share of the rows whose time occurred before in the same series."""
    known = times != pd.NaT.value
    if not codes.any() and (np.diff(times[known]) > 0).all():
        return 0.0
    return float(pd.DataFrame({"time": times[known], "code": codes[known]}).duplicated().mean()) if known.any() else 0.0


def _overlap(times: np.ndarray, codes: np.ndarray) -> bool:
    """Whether every series covers at least half of the whole time."""
    spans = pd.Series(times).groupby(codes).agg(["min", "max"])
    return bool(((spans["max"] - spans["min"]) >= 0.5 * np.ptp(times)).all())


def _refuse_numbered(frame: pd.DataFrame, layout: Layout, times: np.ndarray, what: str) -> None:
    """Refuses a table in which numbers, such as those of sensors, tell series apart, because a channel may look alike."""
    if _repeating(times, _codes(frame, [])) <= _OFTEN:
        return
    for name, cells in frame.items():
        is_number = pd.api.types.is_integer_dtype(cells.dtype) and name not in layout.clock.columns and layout.channels != (name,)
        if is_number and 1 < cells.nunique() <= _MAX_SERIES:
            if _repeating(times, _codes(frame, [name])) < 0.02:
                raise InputError(
                    f"Expected one row for each time. Received: times that repeat, with different values of {name!r}, in {what}. Give "
                    f"series_column (--series-column {name}) if it tells several series apart."
                )


def name_series(frame: pd.DataFrame, keys: Sequence[str], channels: Sequence[str], what: str) -> dict[str, tuple[str, np.ndarray]]:
    """Names the series of a table.

    Args:
        frame: The table.
        keys: The columns that tell series apart.
        channels: The columns that hold values.
        what: Description of the source, for messages.

    Returns:
        The column and the rows of each series by its name: the values of the keys, and the column if there are several.

    Raises:
        InputError: If there are too many, or two have the same name.
    """
    codes = _codes(frame, keys)
    if (codes.max(initial=-1) + 1) * len(channels) > MAX_COLUMNS:
        raise InputError(
            f"Expected at most {MAX_COLUMNS:,} series. Received: {codes.max() + 1:,} values of {', '.join(keys)} in {what}. Give another series_column."
        )
    order = np.argsort(codes, kind="stable")
    rows = np.split(order, np.flatnonzero(np.diff(codes[order])) + 1)
    found = {}
    for inside in rows:
        words = [
            f"{key} {frame[key].iloc[inside[0]]}" if key in ("copy", "table") else str(frame[key].iloc[inside[0]]).strip() for key in keys
        ]
        for channel in channels:
            name = ".".join([*words, channel] if len(channels) > 1 else words)
            if name in found:
                raise InputError(
                    f"Expected series of different names. Received: {name!r} twice in {what}. Rename one of {', '.join(keys)}."
                )
            found[name] = (channel, inside)
    return found
