"""Clocks that several columns make together: a date and a time of day, parts of both such as years
and hours, seconds and their fractions.
"""

import dataclasses
import re
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.options import UNITS
from enhsim_tf.telemetry.cleaning.times import may_be_time_of_day, parse_times
from enhsim_tf.telemetry.reading.clock_values import are_whole
from enhsim_tf.telemetry.reading.column_names import UNIT_OF, name_tells, without_ends, words_of
from enhsim_tf.telemetry.reading.contents import Contents, different, first_cells

_PARTS = {
    "year": "year yyyy yy yr jahr",
    "month": "month mnth mo mm monat",
    "day": "day dy dom dd tag",
    "day_of_year": "doy dayofyear jday ddd",
    "hour": "hour hr hh stunde",
    "hour of an interval": "hourending hourbeginning",
    "minute": "minute min mn",
    "second": "second sec ss sekunde sod secondofday",
} | {unit: UNITS[unit] for unit in ("ms", "us", "ns")}
_PART_OF = {word: part for part, words in _PARTS.items() for word in words.split()}
_TIMES_OF_DAY = {"hhmm", "hhmmss"}
_DOTTED = r" *(?:[01]?\d|2[0-3])\.[0-5]\d\.[0-5]\d *"
_FRACTIONS = {"ms": 999, "us": 999_999, "ns": 999_999_999}  # of a second, at most
_MOST = {"hour": 24, "minute": 60, "second": 60} | _FRACTIONS  # of a time of day
_STATISTICS = set("max maximum mean avg average".split())  # beside which `min` is no minute
_CLOSE = 0.02  # by which fractions of a second may make the steps of a clock less alike
_FEW = 0.05  # share of the rows in which a part of a time may be out of range
_ADDED = {"day_of_year": "D", "hour": "h", "minute": "min", "second": "s", "ms": "ms"}
_ADDED |= {"us": "us", "ns": "ns"}


class Clock(NamedTuple):
    """The clock of a table: the columns that make it up, none if samples are counted; one cell per
    row, to be parsed as times; and what is added to these times.
    """

    columns: tuple[str, ...] = ()
    cells: pd.Series | None = None
    added: pd.Series | None = None  # time spans


def with_times_of_day(table: Contents, dates: Sequence[str]) -> Contents:
    """Returns a table in which the numbers of a column named `HHMM` or `HHMMSS`, or words such as
    `18.00.00`, are times of day in text, if there are days and no other times of day beside it.
    """
    if table.of_kind("times of day") or "hour" in parts_of(table.numbers):
        return table
    found = {}
    for name, values in table.numbers.items():
        words = set(words_of(name)) - {"time", "utc", "gmt", "local"}
        if len(words) == 1 and words <= _TIMES_OF_DAY:
            digits = len(words.pop())
            if are_whole(values, 0, 24 * 10 ** (digits - 2)) and may_be_time_of_day(values):
                found[name] = digits
    dotted = [
        name
        for name in table.of_kind("words")
        if name_tells(name)[0] and first_cells(table.frame[name]).str.fullmatch(_DOTTED).all()
    ]
    if dates and len(dotted) == 1 and not found:
        return _with_text(table, dotted[0], table.frame[dotted[0]].str.replace(".", ":"))
    if len(found) != 1 or not (dates or clock_of_parts(table)):
        return table
    ((name, digits),) = found.items()
    clocks = pd.Series(table.numbers[name].astype(int))
    text = clocks.map(
        {clock: ":".join(re.findall("..", f"{clock:0{digits}}")) for clock in clocks.unique()}
    )
    return _with_text(table, name, text)


def _with_text(table: Contents, name: str, text: pd.Series) -> Contents:
    """Returns a table with times of day in text in one column."""
    return dataclasses.replace(
        table,
        frame=table.frame.assign(**{name: text}),
        kinds={**table.kinds, name: "times of day"},
        numbers={other: values for other, values in table.numbers.items() if other != name},
    )


def clock_of_parts(table: Contents, dates: Sequence[str] = ()) -> Clock | None:
    """Returns the clock that days and columns of the time of day, in text or whole numbers, make
    together, or None. The days are those of the one column of `dates`; without any, those of
    columns for the year, the month and day or the day of year, which need no time of day.
    """
    frame = table.frame
    numbers = table.numbers
    parts = parts_of(numbers)
    of_days, cells = _days_of(table, dates, parts)
    texts = different(frame, without_ends(table.of_kind("times of day")))
    if cells is None or len(texts) > 1:
        return None
    of_day = _among(parts, _MOST)
    beside = _among(parts, _FRACTIONS)
    second = of_day.get("second")
    is_day = are_days(cells)
    if texts and is_day and (dates or of_day.keys() <= _FRACTIONS.keys()):
        has_minutes = first_cells(frame[texts[0]]).str.fullmatch(r" *\d\d?:\d\d *").all()
        if second and has_minutes and np.nanmax(numbers[second]) <= _MOST["second"]:
            beside = {"second": second} | beside
        texts += [
            name
            for name in table.of_kind("words")
            if frame[name].dropna().isin(["AM", "PM", "am", "pm"]).all()
        ]
        # a date may stand in the first row of each day only
        cells = _with_texts(cells.ffill() if dates else cells, frame[texts])
    else:
        texts = []
        if not dates or is_day and "hour" in of_day:
            # what is smaller than a second belongs to one
            beside = of_day if second else _among(of_day, of_day.keys() - beside.keys())
        elif is_day or not _have_seconds(cells):
            beside = {}
    added = _added(numbers, beside)
    if beside and beside.keys() <= _FRACTIONS.keys() and not _makes_alike(cells, added):
        beside, added = {}, None
    columns = (*of_days, *texts, *beside.values())
    return Clock(columns, cells, added) if len(columns) > 1 else None


def _among(parts: Mapping[str, str], kinds: Collection[str]) -> dict[str, str]:
    """Returns the columns of parts of these kinds."""
    return {part: name for part, name in parts.items() if part in kinds}


def _have_seconds(dates: pd.Series) -> bool:
    """Whether dates are written with whole seconds."""
    has_zone = isinstance(dates.dtype, pd.DatetimeTZDtype)  # far dates have no text with one
    head = first_cells(dates.dt.tz_convert(None) if has_zone else dates)
    return bool(head.str.fullmatch(r".*:\d\d:\d\d(?:Z|[+-]\d\d:?\d\d)?").all())


def _days_of(
    table: Contents, dates: Sequence[str], parts: Mapping[str, str]
) -> tuple[Sequence[str], pd.Series | None]:
    """Returns the columns that hold the days of a clock, and the days; None if it has none."""
    numbers = table.numbers
    if len(dates) == 1:
        cells = table.frame[dates[0]]
        if dates[0] in numbers:
            text = numbers[dates[0]].astype(np.int64).astype(str)
            cells = pd.Series(pd.to_datetime(text, format="%Y%m%d"))
        return dates, cells
    of_days = _among(parts, _PARTS.keys() - _MOST.keys())
    if dates or "year" not in of_days or of_days.keys().isdisjoint(("month", "day_of_year")):
        return (), None
    years = numbers[of_days["year"]]
    if not are_whole(years[np.isfinite(years)], 1900, 2200):
        return (), None
    days = {"year": years, "month": 1.0, "day": 1.0}
    if "day_of_year" not in of_days:
        days |= {part: numbers[name] for part, name in of_days.items()}
    stamps = pd.to_datetime(pd.DataFrame(days), errors="coerce").astype("datetime64[ns]")
    added = _added(numbers, of_days)
    return tuple(of_days.values()), stamps if added is None else stamps + added


def _with_texts(dates: pd.Series, texts: pd.DataFrame) -> pd.Series:
    """Returns dates with what stands beside them in text."""
    if pd.api.types.is_datetime64_any_dtype(dates.dtype):
        dates = dates.dt.strftime("%Y-%m-%d")
    cells = dates.astype("str").str.strip()
    for name in texts:
        cells = cells + " " + texts[name].astype("str").str.strip()
    return cells


def clocks_of_fractions(numbers: Mapping[str, np.ndarray]) -> list[Clock]:
    """Returns the clocks of columns of whole seconds and of the fractions of a second behind them,
    of names that are alike apart from their units.
    """
    stems: dict[tuple[str, ...], str] = {}
    for name in numbers:
        *stem, last = words_of(name) or [""]
        stems[(*stem, UNIT_OF.get(last, ""))] = name
    clocks = []
    for (*stem, unit), name in stems.items():
        whole = stems.get((*stem, "s"))
        if unit in _FRACTIONS and whole is not None:
            rest = numbers[name]
            seconds = numbers[whole]
            wraps = (np.diff(rest) < 0).any() or np.ptp(seconds) == 0
            if are_whole(rest, 0, _FRACTIONS[unit]) and (seconds % 1 == 0).all() and wraps:
                added = pd.Series(pd.to_timedelta(rest, unit=unit))
                clocks.append(Clock((whole, name), pd.Series(seconds), added))
    return clocks


def are_days(cells: pd.Series) -> bool:
    """Whether dates have no time of day; who keeps a zone keeps times."""
    if isinstance(cells.dtype, pd.DatetimeTZDtype):  # far ones have no text
        return False
    return not first_cells(cells).str.contains(r":|T\d|\d{8}\d").any()


def _makes_alike(cells: pd.Series, added: pd.Series) -> bool:
    """Whether fractions of a second are those of a clock: they are the same throughout, or go
    through a tenth of a second or more, unless its dates repeat, and its steps do not become less
    alike by them.
    """
    try:
        stamps = parse_times(cells, "", drop=True).stamps
    except InputError:  # which is said when the clock is read
        return True

    def spread(times: pd.DatetimeIndex) -> float:
        steps = np.diff(times.dropna().as_unit("ns").asi8)
        usual = np.median(steps) if len(steps) else 0
        return float(np.mean(np.abs(steps / usual - 1))) if usual > 0 else np.inf

    if added.nunique() == 1:
        return added.iloc[0] == pd.Timedelta(0) or added.iloc[0] >= pd.Timedelta("1ms")
    both = stamps + pd.TimedeltaIndex(added)
    is_wide = added.max() - added.min() >= pd.Timedelta("100ms")
    before = spread(stamps)
    return (is_wide or before == np.inf) and spread(both) <= before + _CLOSE


def parts_of(numbers: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Returns the columns that are named like parts of a date or a time of day, and may hold them,
    by these parts.
    """
    found: dict[str, str] = {}
    plain = {name: re.sub(r"\W|_", "", name.casefold()) for name in numbers}
    for name, word in plain.items():
        part = _PART_OF.get(word)
        # the second of `MM` and `mm`
        if word == "mm" and {"month", "day_of_year"} & set(found):
            part = "minute"
        if part is not None and not (word == "min" and _STATISTICS.intersection(plain.values())):
            found.setdefault(part, name)
    if (of_interval := found.pop("hour of an interval", None)) is not None:
        found.setdefault("hour", of_interval)
    if "hour" not in found and (
        "second" in found or not plain.get(found.get("minute"), "").startswith("minute")
    ):
        found.pop("minute", None)
    most = _most_of(found)
    for part in found.keys() & most.keys():
        values = numbers[found[part]]
        is_whole = part in ("hour", "second") or (values[np.isfinite(values)] % 1 == 0).all()
        if not is_whole or np.mean((values > most[part]) | (values < 0)) > _FEW:
            del found[part]
    return found


def _most_of(parts: Mapping[str, str]) -> Mapping[str, int]:
    """Returns the largest values of parts of a time; minutes and seconds without hours are those of
    a day.
    """
    return _MOST if "hour" in parts else _MOST | {"minute": 1_439, "second": 86_400}


def _added(numbers: Mapping[str, np.ndarray], parts: Mapping[str, str]) -> pd.Series | None:
    """Returns the sum of the parts of a time of day, and of days of a year; None without any."""
    most = _most_of(parts)
    spans = []
    for part, unit in _ADDED.items():
        if part in parts:
            values = numbers[parts[part]] - (part == "day_of_year")
            is_known = (values >= 0) & (values <= most.get(part, np.inf))  # others have no time
            spans.append(pd.Series(pd.to_timedelta(np.where(is_known, values, np.nan), unit=unit)))
    unit = "ns" if "ns" in parts else "us"
    return sum(spans[1:], spans[0]).dt.round(unit) if spans else None
