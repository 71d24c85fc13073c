"""Finds the clock of a table by what the columns hold; names only help.

Dates win, then durations, then numbers that increase and whose name speaks of time. Numbers that only look like a clock are never taken.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import is_text
from enhsim_tf.telemetry.cleaning.options import UNITS_NS
from enhsim_tf.telemetry.cleaning.times import Times, epoch_unit, refuse_two_meanings

NO_TIME = (
    "none"  # instead of the name of a time column: the table has no times, and samples are counted
)
_TIMES = set(
    "time times timestamp timestamps datetime date dates epoch elapsed simtime tout unix unixtime utc utcg ts clock mjd jd datenum uptime "
    "seconds secs millis milliseconds microseconds nanoseconds minutes hours days zeit zeitstempel zeitpunkt datum uhrzeit sekunden "
    "temps heure horodatage tiempo fecha hora tempo tijd".split()
)
_BESIDE = set(
    "since start of run the from local gmt cet sim simulation simulated mission rel relative abs absolute system sample sampling event log logger "
    "record recorded received created at in begin boot experiment test server day julian modified excel serial number".split()
)
_UNITS = {
    "D": "d day days tage",
    "h": "h hr hrs hour hours stunden",
    "min": "min mins minute minutes minuten",
    "s": "s sec secs second seconds sekunden",
    "ms": "ms msec millis millisecond milliseconds",
    "us": "us \u00b5s \u03bcs usec micros microsecond microseconds",
    "ns": "ns nsec nanos nanosecond nanoseconds",
}
_UNIT_OF = {word: unit for unit, words in _UNITS.items() for word in words.split()}
_DAY_WORDS = ("mjd", "jd", "datenum")
_FEWEST = 8  # rows below which no step of a column counts as regular
_PARTS = {
    "year": "year yyyy yy yr jahr",
    "month": "month mo mm monat",
    "day": "day dy dom dd tag",
    "doy": "doy dayofyear jday ddd",
    "hour": "hour hr hh stunde",
    "minute": "minute min mn",
    "second": "second sec ss sekunde sod secondofday",
    "ms": _UNITS["ms"],
}
_PART_OF = {word: part for part, words in _PARTS.items() for word in words.split()}
_MOST = {"hour": 24, "minute": 59, "ms": 999}  # of a time of day
_ZONE = re.compile(r"\b(?:[A-Z][a-z]+/[A-Z]\w+|CES?T|MES?Z|BST|JST|[ECMP][SD]T)\b")
_ZONE_COLUMN = re.compile(r"time[ _]?zone|zeitzone|(?:tz|utc|gmt)[ _]?offset|tz_cd", re.IGNORECASE)


class Clock(NamedTuple):
    """The clock of a table: the columns that make it up, none if samples are counted, and one cell per row, to be parsed as times."""

    columns: tuple[str, ...] = ()
    cells: pd.Series | None = None


def words_of(name: str) -> list[str]:
    """Splits the name of a column into words of letters; capitals in the middle begin a word, as in `OPCQuality`."""
    return re.findall(
        r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", name)
    )


def _name_tells(name: str) -> tuple[int, str | None]:
    """Returns how clearly a name speaks of a clock (2 clearly, 1 as `t` does, 0 not), and the unit or kind of days that it states."""
    if name.casefold().strip() in ("x_value", "x-axis"):  # of LabVIEW and of oscilloscopes
        return 2, None
    words = words_of(name)
    lower = [word.casefold() for word in words]
    unit = next((_UNIT_OF[word] for word in reversed(lower) if word in _UNIT_OF), None)
    unit = next((word for word in lower if word in _DAY_WORDS), unit)
    bracket = bool(re.search(r"[(\[/]\s*[^\W\d_]+\s*[)\]]?\s*$", name))
    if (
        lower
        and lower[0] in ("t", "x")
        and len(lower) <= 2
        and (words[0] == "t" or len(lower) == 2)
    ):
        if len(lower) == 1:
            return (1, None) if re.fullmatch(r"\W*t\W*", name) else (0, None)
        return (2, unit) if unit and bracket else (0, None)
    is_known = all(word in _TIMES or word in _BESIDE or word in _UNIT_OF for word in lower)
    return (2, unit) if is_known and any(word in _TIMES for word in lower) else (0, None)


def _is_increasing(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout; some may repeat, and a few may come late."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps)) and bool(np.mean(steps >= 0) >= 0.9 and np.mean(steps > 0) >= 0.3)


def _is_regular(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout, nearly always by one step or a multiple of it."""
    steps = np.diff(values[np.isfinite(values)])
    if len(steps) < _FEWEST or np.mean(steps > 0) < 0.95:
        return False
    ratios = steps / np.median(steps)
    return bool(np.mean((np.abs(ratios - np.round(ratios)) <= 0.1) & (ratios > 0.5)) >= 0.9)


def is_epoch(values: np.ndarray) -> bool:
    """Whether numbers are times since 1970 in s, ms, us or ns."""
    some = values[:: max(1, len(values) // 1_000)]
    return (
        np.isfinite(some).any()
        and epoch_unit(float(np.median(np.abs(some[np.isfinite(some)])))) is not None
    )


def find_clock(
    frame: pd.DataFrame, kinds: Mapping[str, str], numbers: Mapping[str, np.ndarray], what: str
) -> Clock:
    """Finds the clock of a table; refuses one in which several columns may be it, or one of which only the values speak for it.

    `kinds` are those of `columns.lay_out`; `numbers` are the values of the columns of numbers that are not asked for as channels.
    """
    tells = {name: _name_tells(name)[0] for name in kinds}
    of_kind = {
        kind: [name for name in kinds if kinds[name] == kind]
        for kind in ("dates", "times of day", "spans")
    }
    dates, hours, spans = (
        _varying(of_kind["dates"], frame),
        of_kind["times of day"],
        of_kind["spans"],
    )
    named = [name for name in numbers if tells[name] == 2]
    compact = [name for name in named if _are_compact_dates(numbers[name])]
    if (joined := _joined(frame, kinds, dates or compact, numbers)) is not None:
        return joined
    if dates:
        return _one_of([name for name in dates if tells[name]] or dates, frame, what)
    if spans:
        return Clock((spans[0],), frame[spans[0]])
    if (parts := _date_parts(frame, numbers)) is not None:
        return parts
    best = max(
        (tells[name] for name in numbers if _may_be_clock(tells[name], numbers[name])), default=0
    )
    clocks = [
        name
        for name in numbers
        if best and tells[name] == best and _may_be_clock(best, numbers[name])
    ]
    clocks = [
        name
        for name in clocks
        if name == clocks[0] or not _is_same_clock(numbers[clocks[0]], numbers[name])
    ]
    if clocks and compact and clocks != compact[:1]:
        raise InputError(
            f"Expected a date and its time of day in one column. Received: {compact[0]!r} ({numbers[compact[0]][0]:.0f}) and {clocks[0]!r} in {what}. "
            "Write both in one column, such as 2024-03-01T12:00:00."
        )
    if clocks:
        return _one_of(clocks, frame, what)
    for name in (
        name
        for name, kind in kinds.items()
        if tells[name] == 2 and kind in ("words", "times of day")
    ):
        if name in hours:
            raise InputError(
                f"Expected times with a date. Received: {str(frame[name].dropna().iloc[0])!r} in {name!r} of {what}. Add a column of dates, or give "
                "time 'none' (--time none) to count the samples."
            )
        return Clock((name,), frame[name])  # to be refused with its first cell
    if named:
        raise InputError(
            f"Expected a clock that increases. Received: {named[0]!r} of {what}, which is named like one and goes back. Give time (--time "
            f"{_quoted(named[0])}) to sort by it, or --time none to count the samples."
        )
    _refuse_unknown(frame, kinds, numbers, what)
    return Clock()


def _may_be_clock(tells: int, values: np.ndarray) -> bool:
    return tells > 0 and (
        _is_increasing(values) or tells == 2 and (is_epoch(values) or _is_regular(values[::-1]))
    )


def _one_of(names: list[str], frame: pd.DataFrame, what: str) -> Clock:
    if len(names) > 1:
        raise InputError(
            f"Expected one time column. Received: {', '.join(names[:4])} in {what}. Name it (--time NAME), or {NO_TIME!r} to count samples."
        )
    return Clock((names[0],), frame[names[0]])


def _refuse_unknown(
    frame: pd.DataFrame, kinds: Mapping[str, str], numbers: Mapping[str, np.ndarray], what: str
) -> None:
    """Refuses a column that may be a clock of which neither name nor form is known."""
    in_order = (
        name
        for name, each in numbers.items()
        if is_epoch(each) and np.ptp(each) > 0 <= np.diff(each).min()
    )
    ramp = next(
        (name for name, values in numbers.items() if _is_regular(values)), next(in_order, None)
    )
    if ramp is not None and sum(kind == "numbers" for kind in kinds.values()) > 1:
        step = float(np.median(np.diff(numbers[ramp][np.isfinite(numbers[ramp])])))
        raise InputError(
            f"Expected to know the clock. Received: {ramp!r} of {what}, which increases in steps of {step:g}, as a clock or a "
            f"counter does. Give --time {_quoted(ramp)} (with --time-format ms or another unit if it does not count seconds), or --time none."
        )
    for name in (name for name, kind in kinds.items() if kind == "words"):
        cells = frame[name].dropna().astype("str").iloc[:1_000]
        if (
            len(cells) >= _FEWEST
            and cells.is_unique
            and cells.iloc[:_FEWEST].str.contains(r"\d").all()
        ):
            raise InputError(
                f"Expected to know the clock. Received: {cells.iloc[0][:40]!r} in {name!r} of {what}, which may be a time of an unknown form. Give "
                f"--time {_quoted(name)} with --time-format, or --time none."
            )


def unit_of(clock: Clock, units: Mapping[str, str], what: str) -> str | None:
    """Returns the unit or kind of days that the name of a clock's one column or the line of units states, or None.

    Raises an `InputError` if the column holds days whose kind is not known.
    """
    if len(clock.columns) != 1:
        return None
    name = clock.columns[0]
    form = _name_tells(name)[1] or _UNIT_OF.get(units.get(name, "").strip(" []()").casefold())
    if (
        form is None
        and pd.api.types.is_numeric_dtype(clock.cells.dtype)
        and re.search(r"dat(?:e|um)", name.casefold())
    ):
        values = clock.cells.to_numpy(np.float64, na_value=np.nan)
        refuse_two_meanings(values[np.isfinite(values)], f"{name!r} of {what}", is_date=True)
    return form


def offset_of(
    clock: Clock, frame: pd.DataFrame, zone: str | None, what: str
) -> pd.Timedelta | None:
    """Returns the offset in a clock's name, as in `Time, GMT+02:00`, or None; refuses other statements of a zone, unless `zone` is given."""
    named = " ".join(clock.columns)
    if found := re.search(r"(?<!Etc/)\b(?:UTC|GMT) ?([+-]\d\d?)(?::?(\d\d))?\b", named):
        return pd.Timedelta(f"{found[1]}:{found[2] or '00'}:00")
    beside = [
        name
        for name in frame
        if _ZONE_COLUMN.search(name) or name.casefold() == "tz" and is_text(frame[name])
    ]
    if zone is None and (_ZONE.search(named) or beside and "utc" not in named.casefold()):
        raise InputError(
            f"Expected times that state their zone. Received: {', '.join(dict.fromkeys([named, *beside]))} in {what}, where a zone is named "
            "that is not read. Give timezone (--timezone Europe/Berlin, or UTC to take them as they are)."
        )
    return None


def further_clocks(
    clock: Clock, times: Times | None, numbers: Mapping[str, np.ndarray], kinds: Mapping[str, str]
) -> set[str]:
    """Returns the columns that show the time once more, or show it although samples are counted."""
    found = {name for name in numbers if _name_tells(name)[0] == 2} | {
        name for name, kind in kinds.items() if kind == "dates"
    }
    if times is None:
        parts = _date_parts(pd.DataFrame(numbers), numbers) or Clock()
        return found.union(
            parts.columns,
            (
                name
                for name, values in numbers.items()
                if _may_be_clock(_name_tells(name)[0], values)
            ),
        )
    own = np.where(times.stamps.isna(), np.nan, times.stamps.as_unit("ns").asi8.astype(np.float64))
    for name, values in numbers.items():
        words = re.findall(r"[^\W\d_]+", name.casefold())
        is_named = (
            _name_tells(name)[0] > 0
            or bool(words)
            and all(word in _UNIT_OF or word in _BESIDE for word in words)
        )
        if (
            name not in clock.columns
            and (is_named or is_epoch(values))
            and _is_same_clock(own, values)
        ):
            found.add(name)
    return found


def _is_same_clock(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two columns show the same time, perhaps from another zero and in another unit."""
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    if len(first) < 3 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return False
    low, high = int(np.argmin(first)), int(np.argmax(first))
    slope = (second[high] - second[low]) / (first[high] - first[low])
    units = [float(unit) for unit in UNITS_NS.values()]
    if (
        slope <= 0
        or min(abs(slope * above / below - 1) for above in units for below in units) > 1e-3
    ):
        return False
    off = second - second[low] - slope * (first - first[low])
    return bool(np.abs(off).max() <= 0.6 * np.median(np.abs(np.diff(second))))


def _varying(names: list[str], frame: pd.DataFrame) -> list[str]:
    """Leaves out columns that hold the same date throughout, such as the range of a query, unless no other is left."""
    varying = [
        name
        for name in names
        if frame[name].iloc[:1_000].nunique() > 1 or frame[name].nunique() > 1
    ]
    return varying or names[:1]


def _are_compact_dates(values: np.ndarray) -> bool:
    """Whether numbers are dates such as 20240301."""
    if not len(values) or not ((values > 1.9e7) & (values < 2.2e7) & (values % 1 == 0)).all():
        return False
    return bool(
        pd.to_datetime(
            pd.Series(np.unique(values)).astype(np.int64).astype(str),
            format="%Y%m%d",
            errors="coerce",
        )
        .notna()
        .all()
    )


def _joined(
    frame: pd.DataFrame,
    kinds: Mapping[str, str],
    dates: list[str],
    numbers: Mapping[str, np.ndarray],
) -> Clock | None:
    """Returns the clock that a column of dates and columns of the time of day, in text or whole numbers, make together, or None."""
    hours, digits = [name for name in kinds if kinds[name] == "times of day"], {}
    if len(dates) != 1 or len(hours) > 1:
        return None
    for name, values in numbers.items():
        part = _PART_OF.get(name.casefold())
        if part in _MOST and ((values >= 0) & (values <= _MOST[part]) & (values % 1 == 0)).all():
            digits[part] = pd.Series(values, name=name).map(
                f"{{:0{len(str(_MOST[part]))}.0f}}".format
            )
    if not (hours or digits):
        return None
    cells, pieces = frame[dates[0]], [(".", digits["ms"])] if "ms" in digits else []
    if not (is_day := _has_no_time(cells)):
        pieces = (
            pieces
            if is_text(cells)
            and cells.dropna().iloc[:200].astype("str").str.fullmatch(r".*:\d\d:\d\d").all()
            else []
        )
    elif hours:
        halves = [
            name
            for name, kind in kinds.items()
            if kind == "words" and frame[name].dropna().isin(["AM", "PM"]).all()
        ]
        pieces = [
            (" ", frame[name].astype("str").str.strip()) for name in (*hours, *halves[:1])
        ] + pieces
    elif "hour" in digits:
        pieces = [
            (" ", digits["hour"]),
            (":", digits.get("minute", digits["hour"].mask(digits["hour"].notna(), "00"))),
        ]
    if not pieces:
        return None
    day = (
        cells.dt.strftime("%Y-%m-%d")
        if pd.api.types.is_datetime64_any_dtype(cells.dtype)
        else cells.astype("str").str.strip()
    )
    joined = day.ffill() if is_day else day  # a date may stand in the first row of each day only
    for mark, piece in pieces:
        joined += mark + piece
    return Clock(tuple(dict.fromkeys([dates[0], *(piece.name for _, piece in pieces)])), joined)


def _has_no_time(cells: pd.Series) -> bool:
    if isinstance(cells.dtype, pd.DatetimeTZDtype):  # who keeps a zone keeps times
        return False
    head = cells.dropna().iloc[:200]
    if pd.api.types.is_datetime64_any_dtype(cells.dtype):
        return bool((head == head.dt.normalize()).all())
    return not head.astype("str").str.contains(r":|T\d|\d{8}\d").any()


def _date_parts(frame: pd.DataFrame, numbers: Mapping[str, np.ndarray]) -> Clock | None:
    """Returns the clock of columns for the year, the month and day or the day of year, and perhaps the time of day, or None."""
    found = {}
    for name in numbers:
        part = _PART_OF.get(re.sub(r"[^a-z]", "", name.casefold()))
        if name.strip().casefold() == "mm" and {"month", "doy"} & set(
            found
        ):  # the second of `MM` and `mm`
            part = "minute"
        if part is not None:
            found.setdefault(part, name)
    if "year" not in found or not {"doy", "month"} & set(found):
        return None
    values = {part: pd.Series(numbers[name]) for part, name in found.items()}
    years, first = values["year"].dropna(), pd.Series(1.0, index=frame.index)
    if not len(years) or (years % 1 != 0).any() or not years.between(1900, 2200).all():
        return None
    days = {part: first if "doy" in found else values.get(part, first) for part in ("month", "day")}
    stamps = pd.to_datetime({"year": values["year"]} | days, errors="coerce").astype(
        "datetime64[ns]"
    )
    for part, unit in (
        ("doy", "D"),
        ("hour", "h"),
        ("minute", "min"),
        ("second", "s"),
        ("ms", "ms"),
    ):
        if part in found:
            stamps += pd.to_timedelta(values[part] - (part == "doy"), unit=unit)
    return Clock(tuple(found[part] for part in _PARTS if part in found), stamps.dt.round("ms"))


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[\w.-]+", name) else f"'{name}'"
