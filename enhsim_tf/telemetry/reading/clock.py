"""Finds the clock of a table by what the columns hold; names only help.

Dates win, then durations, then numbers that increase and whose name speaks of time. Numbers that only look like a clock are never taken.
"""

import dataclasses
import re
from collections.abc import Mapping

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.times import UNITS_NS, are_days, refuse_days

NO_TIME = "none"  # instead of the name of a time column: the table has no times, and samples are counted
_TIMES = set(
    "time times timestamp timestamps datetime date dates epoch elapsed simtime unix unixtime utc utcg ts clock mjd jd datenum uptime "
    "seconds secs millis milliseconds microseconds nanoseconds minutes hours days zeit zeitstempel zeitpunkt datum uhrzeit sekunden "
    "temps heure horodatage secondes tiempo fecha hora segundos tempo tijd tijdstip".split()
)
_BESIDE = set(
    "since start of run the from local gmt cet sim simulation simulated mission rel relative abs absolute system sample sampling event log logger "
    "record recorded created at in begin experiment test server gps day julian modified excel serial number _".split()
)
_UNITS = {
    "D": "d day days tage jours dias",
    "h": "h hr hrs hour hours stunden heures horas",
    "min": "min mins minute minutes minuten",
    "s": "s sec secs second seconds sekunden secondes segundos",
    "ms": "ms msec millis millisecond milliseconds",
    "us": "us \u00b5s \u03bcs usec micros microsecond microseconds",
    "ns": "ns nsec nanos nanosecond nanoseconds",
}
_UNIT_OF = {word: unit for unit, words in _UNITS.items() for word in words.split()}
_DAY_WORDS = ("mjd", "jd", "datenum")
_FEWEST = 8  # rows below which no step of a column counts as regular
_PARTS = {
    "year": "year yyyy yr jahr",
    "month": "month mo mm monat",
    "day": "day dy dom dd tag",
    "doy": "doy dayofyear jday ddd",
    "hour": "hour hr hh stunde",
    "minute": "minute min mn minuten",
    "second": "second sec ss sekunde",
}
_PART_OF = {word: part for part, words in _PARTS.items() for word in words.split()}


@dataclasses.dataclass(frozen=True, eq=False)
class Clock:
    """The clock of a table.

    Args:
        columns: Columns that make it up; none if samples are counted.
        cells: Their content, one cell per row, to be parsed as times.
        form: The unit or kind that the name tells, as for `Cleaning.time_format`, or None.
        others: Further columns of numbers that are named like clocks.
    """

    columns: tuple[str, ...] = ()
    cells: pd.Series | None = None
    form: str | None = None
    others: tuple[str, ...] = ()


def name_tells(name: str) -> tuple[int, str | None]:
    """Returns how clearly a name speaks of a clock (2 clearly, 1 as `t` does, 0 not), and the unit or kind of days that it states.

    Args:
        name: Name of a column.
    """
    if name.casefold().strip() == "x_value":  # of LabVIEW
        return 2, None
    words = re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name))
    lower = [word.casefold() for word in words]
    unit = next((_UNIT_OF[word] for word in reversed(lower) if word in _UNIT_OF), None)
    unit = next((word for word in lower if word in _DAY_WORDS), unit)
    bracket = bool(re.search(r"[(\[/]\s*[^\W\d_]+\s*[)\]]?\s*$", name))
    if lower and lower[0] in ("t", "x") and len(lower) <= 2 and (words[0] == "t" or len(lower) == 2):
        if len(lower) == 1:
            return (1, None) if re.fullmatch(r"\W*t\W*", name) else (0, None)
        return (2, unit) if unit and bracket else (0, None)
    is_known = all(word in _TIMES or word in _BESIDE or word in _UNIT_OF for word in lower)
    return (2, unit) if is_known and any(word in _TIMES for word in lower) else (0, None)


def is_increasing(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout; some may repeat, and a few may come late.

    Args:
        values: Numbers, NaN where missing.
    """
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps)) and bool(np.mean(steps >= 0) >= 0.9 and np.mean(steps > 0) >= 0.3)


def is_regular(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout, nearly always by one step or a multiple of it.

    Args:
        values: Numbers, NaN where missing.
    """
    steps = np.diff(values[np.isfinite(values)])
    if len(steps) < _FEWEST or np.mean(steps > 0) < 0.95:
        return False
    ratios = steps / np.median(steps)
    return bool(np.mean((np.abs(ratios - np.round(ratios)) <= 0.1) & (ratios > 0.5)) >= 0.9)


def may_be_clock(name: str) -> bool:
    """Whether a name may be that of a clock beside another: it speaks of time, or is a unit of time alone.

    Args:
        name: Name of a column.
    """
    words = re.findall(r"[^\W\d_]+", name.casefold())
    return name_tells(name)[0] > 0 or bool(words) and all(word in _UNIT_OF or word in _BESIDE for word in words)


def is_epoch(values: np.ndarray) -> bool:
    """Whether numbers are times since 1970 in s, ms, us or ns, from the years 1979 to 2103.

    Args:
        values: Numbers, NaN where missing.
    """
    some = values[:: max(1, len(values) // 1_000)]
    size = float(np.median(np.abs(some[np.isfinite(some)]))) if np.isfinite(some).any() else 0.0
    return any(3.1e8 * 1e9 <= size * factor <= 4.2e9 * 1e9 for factor in (10**9, 10**6, 10**3, 1)) and size > 3e8


def find_clock(
    frame: pd.DataFrame, kinds: Mapping[str, str], numbers: Mapping[str, np.ndarray], what: str, stated: str | None = None
) -> Clock:
    """Finds the clock of a table.

    Args:
        frame: The table.
        kinds: Kind of each column, see `columns.kind_of`.
        numbers: Values of the columns of numbers that are not asked for as channels.
        what: Description of the source, for messages.
        stated: `Cleaning.time_format`.

    Returns:
        The clock.

    Raises:
        InputError: If several columns may be the clock, or one of which only the values speak for it.
    """
    tells = {name: name_tells(name) for name in kinds}
    clocks = [
        name for name in numbers if tells[name][0] and (is_increasing(numbers[name]) or tells[name][0] == 2 and is_epoch(numbers[name]))
    ]
    parts = _date_parts(frame, numbers)
    dates = _varying([name for name, kind in kinds.items() if kind == "dates"], frame)
    joined = _joined(frame, kinds, dates)
    named = [name for name in numbers if tells[name][0] == 2]
    if joined is not None:
        return dataclasses.replace(joined, others=tuple(named))
    if dates:
        named_dates = [name for name in dates if tells[name][0]] or dates
        if len(named_dates) > 1:
            raise InputError(
                f"Expected one time column. Received: {', '.join(named_dates[:4])} in {what}. Name it (--time NAME), or {NO_TIME!r} to count samples."
            )
        return Clock((named_dates[0],), frame[named_dates[0]], None, tuple(named))
    spans = [name for name, kind in kinds.items() if kind == "spans"]
    if spans:
        return Clock((spans[0],), frame[spans[0]], None, tuple(named))
    if parts is not None:
        return dataclasses.replace(parts, others=tuple(name for name in named if name not in parts.columns))
    if clocks:
        best = max(tells[name][0] for name in clocks)
        clocks = [name for name in clocks if tells[name][0] == best]
        other = next((name for name in clocks[1:] if not is_same_clock(numbers[clocks[0]], numbers[name])), None)
        if other is not None:
            raise InputError(
                f"Expected one time column. Received: {clocks[0]}, {other} in {what}. Name it (--time NAME), or {NO_TIME!r} to count samples."
            )
        return named_clock(frame, clocks[0], what, stated, tuple(name for name in named if name != clocks[0]))
    unread = next((name for name, kind in kinds.items() if tells[name][0] == 2 and kind in ("words", "times of day")), None)
    if unread is not None and kinds[unread] == "times of day":
        raise InputError(
            f"Expected times with a date. Received: {str(frame[unread].dropna().iloc[0])!r} in {unread!r} of {what}. Add a column of dates, or give "
            "time 'none' (--time none) to count the samples."
        )
    if unread is not None:
        return Clock((unread,), frame[unread])  # to be refused with its first cell
    if named:
        raise InputError(
            f"Expected a clock that increases. Received: {named[0]!r} of {what}, which is named like one and goes back. Give time (--time "
            f"{_quoted(named[0])}) to sort by it, or --time none to count the samples."
        )
    ramps = [name for name, values in numbers.items() if is_regular(values)]
    if ramps and sum(kind == "numbers" for kind in kinds.values()) > 1:
        raise InputError(
            f"Expected to know the clock. Received: {ramps[0]!r} of {what}, which increases in equal steps of {_step(numbers[ramps[0]]):g}, as a clock "
            f"or a counter does. Give --time {_quoted(ramps[0])} (with --time-format ms or another unit if it does not count seconds), or --time none."
        )
    return Clock()


def named_clock(frame: pd.DataFrame, name: str, what: str, stated: str | None, others: tuple[str, ...] = ()) -> Clock:
    """Returns the clock of a given column, with the unit that its name tells.

    Args:
        frame: The table.
        name: Name of the column.
        what: Description of the source, for messages.
        stated: `Cleaning.time_format`, which goes before the name.
        others: Further columns that are named like clocks.

    Raises:
        InputError: If the column holds days whose kind is not known.
    """
    cells, form = frame[name], stated or (name_tells(name)[1] if name_tells(name)[0] else None)
    if form is None and pd.api.types.is_numeric_dtype(cells.dtype) and re.search(r"dat(?:e|um)", name.casefold()):
        values = cells.to_numpy(np.float64, na_value=np.nan)
        values = values[np.isfinite(values)]
        if are_days(values, even_whole=True):
            refuse_days(values, f"{name!r} of {what}")
    return Clock((name,), cells, form, others)


def is_same_clock(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two columns show the same time, perhaps from another zero and in another unit.

    Args:
        first: Numbers, NaN where missing.
        second: The same.
    """
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    if len(first) < 3 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return False
    low, high = int(np.argmin(first)), int(np.argmax(first))
    slope = (second[high] - second[low]) / (first[high] - first[low])
    units = [float(unit) for unit in UNITS_NS.values()]
    if slope <= 0 or min(abs(slope * above / below - 1) for above in units for below in units) > 1e-3:
        return False
    off = second - second[low] - slope * (first - first[low])
    return bool(np.abs(off).max() <= 0.6 * np.median(np.abs(np.diff(second))))


def _varying(names: list[str], frame: pd.DataFrame) -> list[str]:
    """Leaves out columns that hold the same date throughout, such as the range of a query, unless no other is left."""
    varying = [name for name in names if frame[name].iloc[:1_000].nunique() > 1 or frame[name].nunique() > 1]
    return varying or names[:1]


def _joined(frame: pd.DataFrame, kinds: Mapping[str, str], dates: list[str]) -> Clock | None:
    """Returns the clock that a column of dates and one of times of day make together, or None."""
    days = [name for name, kind in kinds.items() if kind == "dates" and _has_no_time(frame[name])]
    hours = [name for name, kind in kinds.items() if kind == "times of day"]
    if len(days) != 1 or len(hours) != 1 or any(name not in days for name in dates):
        return None
    cells = frame[days[0]]
    day = cells.dt.strftime("%Y-%m-%d") if pd.api.types.is_datetime64_any_dtype(cells.dtype) else cells.astype("str").str.strip()
    return Clock((days[0], hours[0]), day + " " + frame[hours[0]].astype("str").str.strip())


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
        if part is not None and part not in found:
            found[part] = name
    has_day = "doy" in found or {"month", "day"} <= set(found)
    if "year" not in found or not has_day:
        return None
    values = {part: pd.Series(numbers[name]) for part, name in found.items()}
    years = values["year"].dropna()
    if not len(years) or (years % 1 != 0).any() or not years.between(1900, 2200).all():
        return None
    unknown = pd.Series(1.0, index=frame.index)
    days = {"month": unknown, "day": unknown} if "doy" in found else {part: values[part] for part in ("month", "day")}
    stamps = pd.to_datetime({"year": values["year"]} | days, errors="coerce").astype("datetime64[ns]")
    if "doy" in found:
        stamps += pd.to_timedelta(values["doy"] - 1, unit="D")
    for part, unit in (("hour", "h"), ("minute", "min"), ("second", "s")):
        if part in found:
            stamps += pd.to_timedelta(values[part], unit=unit)
    used = [found[part] for part in _PARTS if part in found and not ("doy" in found and part in ("month", "day"))]
    others = tuple(found[part] for part in ("month", "day") if "doy" in found and part in found)
    return Clock(tuple(used), stamps.dt.round("ms"), None, others)


def _step(values: np.ndarray) -> float:
    return float(np.median(np.diff(values[np.isfinite(values)])))


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[\w.-]+", name) else f"'{name}'"
