"""Finds the clock of a table by what the columns hold; names only help.

Dates win, then durations, then numbers that increase and whose name speaks of time. Numbers that
only look like a clock are never taken.
"""

import itertools
import re
import zoneinfo
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple, NoReturn

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError, option_text
from enhsim_tf.telemetry.cleaning.numbers import format_cell, is_text
from enhsim_tf.telemetry.cleaning.options import UNITS_NS
from enhsim_tf.telemetry.cleaning.times import (
    LOOK,
    Times,
    compact_form,
    epoch_unit,
    may_be_time_of_day,
    parse_times,
    refuse_two_meanings,
)

# instead of the name of a time column: the table has no times, and samples are counted
NO_TIME = "none"
_TIMES = set(
    "time times timestamp timestamps datetime date dates epoch elapsed simtime tout unix unixtime "
    "utc utcg ts clock mjd jd datenum uptime "
    "seconds secs millis milliseconds microseconds nanoseconds minutes hours days zeit zeitstempel "
    "zeitpunkt datum uhrzeit sekunden "
    "temps heure horodatage tiempo fecha hora tempo tijd hhmm hhmmss".split()
)
_BESIDE = set(
    "since start of run the from local gmt cet sim simulation simulated mission rel relative abs "
    "absolute system sample sampling event log logger "
    "record recorded received created at in begin boot experiment test server day julian "
    "modified excel serial number "
    "step ref reference header stamp end stop".split()
)
_ENDS = set("end ende stop finish until bis to fin hasta tot".split())  # of an interval
_UNITS = {
    "D": "d day days tage",
    "h": "h hr hrs hour hours stunden",
    "min": "min mins minute minutes minuten",
    "s": "s sec secs second seconds sekunden",
    "ms": "ms msec msecs millis millitm millisecond milliseconds",
    "us": "us \u00b5s \u03bcs usec usecs micros microsecond microseconds",
    "ns": "ns nsec nsecs nanos nanosecond nanoseconds",
}
_UNIT_OF = {word: unit for unit, words in _UNITS.items() for word in words.split()}
_DAY_WORDS = ("mjd", "jd", "datenum")
_FEWEST = 8  # rows below which no step of a column counts as regular
_PARTS = {
    "year": "year yyyy yy yr jahr",
    "month": "month mo mm monat",
    "day": "day dy dom dd tag",
    "doy": "doy dayofyear jday ddd",
    "hour": "hour hr hh stunde hourending hourbeginning",
    "minute": "minute min mn",
    "second": "second sec ss sekunde sod secondofday",
} | {unit: _UNITS[unit] for unit in ("ms", "us", "ns")}
_PART_OF = {word: part for part, words in _PARTS.items() for word in words.split()}
_FRACTIONS = {"ms": 999, "us": 999_999, "ns": 999_999_999}  # of a second, at most
_MOST = {"hour": 24, "minute": 60, "second": 60} | _FRACTIONS  # of a time of day
_STATISTICS = set("max maximum mean avg average".split())  # beside which `min` is no minute
_CLOSE = 0.02  # by which fractions of a second may make the steps of a clock less alike
_FEW = 0.05  # share of the rows in which a part of a time may be out of range
_OFTEN = 0.3  # share of the rows that repeat a date, above which it lacks its time of day
_ADDED = {"doy": "D", "hour": "h", "minute": "min", "second": "s", "ms": "ms"}
_ADDED |= {"us": "us", "ns": "ns"}
_RATIOS = sorted({one / other for one in UNITS_NS.values() for other in UNITS_NS.values()})
# a number before a unit, as in `Time [10ms]` and `ticks (1/100 s)`
_FACTOR = re.compile(
    rf"(?:[\[(]\s*x?|(?<!\d)/\s*|_)(\d[\d./^*-]*)[ *]*(?:{'|'.join(_UNIT_OF)})(?![^\W\d_])",
    re.IGNORECASE,
)
_PLACE = re.compile(r"\b[A-Z][a-z]+/[A-Z]\w+\b")  # as Europe/Berlin
_ZONE = re.compile(r"\b(?:CES?T|MES?Z|BST|JST|[ECMP][SD]T|\w+ (?:Standard|Daylight) Time)\b")
_TIME_LIKE = r"\s*(?:[01]?\d|2[0-4]) ?(?:[:hH] ?[0-5]\d|([.-])[0-5]\d\1[0-5]\d)(?!\d).*"
_COUNT = {"time": NO_TIME}  # the option of counting the samples
_ZONE_COLUMN = re.compile(r"time[ _]?zone|zeitzone|(?:tz|utc|gmt)[ _]?offset|tz_cd", re.IGNORECASE)


class Clock(NamedTuple):
    """The clock of a table: the columns that make it up, none if samples are counted; one cell per
    row, to be parsed as times; and what is added to these times.
    """

    columns: tuple[str, ...] = ()
    cells: pd.Series | None = None
    added: pd.Series | None = None  # time spans


def is_unnamed(name: str) -> bool:
    """Whether a column has no name, as the index of a pandas object that was saved."""
    return bool(re.fullmatch(r"column 0|Unnamed: \d+|level_0", name))


def words_of(name: str) -> list[str]:
    """Splits the name of a column into words of small letters; capitals in the middle begin a word,
    as in `OPCQuality`.
    """
    split = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", name)
    return [word.casefold() for word in re.findall(r"[^\W\d_]+", split)]


def name_tells(name: str) -> tuple[int, str | None]:
    """Returns how clearly a name speaks of a clock (2 clearly, 1 as `t` does, 0 not), and the unit
    or kind of days that it states.
    """
    if re.fullmatch(r"x_value(?:\.\d+)?|x-axis", name.casefold().strip()):  # of LabVIEW and scopes
        return 2, None
    words = words_of(name)
    unit = next((_UNIT_OF[word] for word in reversed(words) if word in _UNIT_OF), None)
    unit = next((word for word in words if word in _DAY_WORDS), unit)
    bracket = bool(re.search(r"[(\[/]\s*[^\W\d_]+\s*[)\]]?\s*$", name))
    if re.fullmatch(r"\W*t\W*", name):
        return 1, None
    if len(words) == 2 and words[0] in ("t", "x"):
        return (2, unit) if unit and bracket else (0, None)
    is_known = all(word in _TIMES or word in _BESIDE or word in _UNIT_OF for word in words)
    return (2, unit) if is_known and any(word in _TIMES for word in words) else (0, None)


def _seconds_of(spans: pd.Series) -> np.ndarray:
    stamps = parse_times(spans, "", drop=True).stamps
    return np.where(stamps.isna(), np.nan, stamps.as_unit("ns").asi8 / 1e9)


def _may_count(values: np.ndarray) -> bool:
    """Whether time spans never go back, but for a few that come late, or fall in equal steps."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.any(steps > 0) and np.mean(steps >= 0) >= 0.9) or is_regular(values[::-1])


def _is_increasing(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout; some may repeat, and a few may come late."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps)) and bool(np.mean(steps >= 0) >= 0.9 and np.mean(steps > 0) >= 0.3)


def is_regular(values: np.ndarray) -> bool:
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
    """Finds the clock of a table; refuses one in which several columns may be it, or one of which
    only the values speak for it.

    `kinds` are those of `columns.lay_out`; `numbers` are the values of the columns of numbers that
    are not asked for as channels.
    """
    tells = {name: name_tells(name)[0] for name in kinds}
    of_kind = {kind: [name for name in kinds if kinds[name] == kind] for kind in ("dates", "spans")}
    varying = _varying(of_kind["dates"], frame)
    dates = _without_ends(varying or of_kind["dates"][:1])
    spans = [name for name in of_kind["spans"] if _may_count(_seconds_of(frame[name]))]
    spans.sort(key=lambda name: -tells[name])
    named = [name for name in numbers if tells[name] == 2]
    compact = [name for name in named if compact_form(numbers[name]) == "%Y%m%d"]
    if (joined := _joined(frame, kinds, dates or compact, numbers)) is not None:
        return joined
    dates = [name for name in dates if tells[name]] or dates
    if dates and frame[dates[0]].iloc[: 50 * LOOK].duplicated().mean() > _OFTEN:
        _refuse_apart_times(dates[0], kinds, frame, numbers, what)
    if varying:
        return _one_of(dates, frame, what)
    if (parts := _date_parts(numbers)) is not None:
        hours = [name for name in kinds if kinds[name] == "times of day"]
        if len(hours) == 1 and parts.added is None:
            days = parts.cells.dt.strftime("%Y-%m-%d ")
            return Clock((*parts.columns, hours[0]), days + frame[hours[0]].astype("str"))
        return parts
    fractions = _fractions(numbers)
    whole = {name: values for name, values in numbers.items() if name not in sum(fractions, ())}
    may_be = {name for name in whole if _may_be_clock(tells[name], whole[name])}
    if spans and not fractions and all(tells[name] < 2 for name in may_be):
        return Clock((spans[0],), frame[spans[0]])
    if fractions and not may_be:
        (seconds, rest), *_ = fractions
        unit = _UNIT_OF[words_of(rest)[-1]]
        added = pd.Series(pd.to_timedelta(numbers[rest], unit=unit))
        return Clock(fractions[0], pd.Series(numbers[seconds]), added)
    numbers = whole
    best = max((tells[name] for name in may_be), default=0)
    clocks = [name for name in numbers if name in may_be and tells[name] == best]
    # what begins again, such as the time of a step, is no clock beside one that does not
    ahead = [name for name in clocks if not (np.diff(numbers[name]) < 0).any()]
    first, *others = ahead or clocks or [""]
    others = [name for name in others if not _shows_time(numbers[first], numbers[name])]
    clocks = _without_ends([first, *others]) if first else []
    if clocks and compact and clocks != compact[:1]:
        _refuse_apart(compact[0], clocks[0], frame, what)
    if clocks and dates and not is_epoch(numbers[clocks[0]]) and name_tells(clocks[0])[1] is None:
        _refuse_apart(dates[0], clocks[0], frame, what, [{"time": clocks[0]}])
    if clocks or dates:
        return _one_of(clocks or dates, frame, what)
    for name, kind in kinds.items():
        if kind == "times of day":
            raise InputError(
                f"Expected times with a date. Received: {str(frame[name].dropna().iloc[0])!r} in "
                f"{name!r} of {what}.",
                [_COUNT],
                "a column of dates",
            )
        if tells[name] == 2 and kind == "words":
            return Clock((name,), frame[name])  # to be refused with its first cell
    named += [name for name in of_kind["spans"] if tells[name] == 2]
    if named:
        raise InputError(
            f"Expected a clock that increases. Received: {named[0]!r} of {what}, which is named "
            "like one and does not.",
            [_COUNT, {"time": named[0]}],
        )
    _refuse_unknown(frame, kinds, numbers, what)
    return Clock()


def _refuse_apart_times(
    day: str,
    kinds: Mapping[str, str],
    frame: pd.DataFrame,
    numbers: Mapping[str, np.ndarray],
    what: str,
) -> None:
    """Refuses dates that repeat beside what may be their time of day, in a form that is not read,
    or beside another clock that does not repeat.
    """
    for name, kind in kinds.items():
        if name in numbers and name_tells(name)[0] == 2:
            values = numbers[name][np.isfinite(numbers[name])]
            is_apart = name_tells(name)[1] is None and may_be_time_of_day(values)
            is_finer = (np.diff(values) > 0).all() and frame[day].nunique() > 1
            if not is_apart and is_finer:
                _one_of([day, name], frame, what)
        else:
            cells = frame[name].dropna().iloc[:LOOK].astype("str")
            is_apart = kind == "words" and cells.str.fullmatch(_TIME_LIKE).mean() > 0.9
        if is_apart and _are_days(frame[day]):
            _refuse_apart(day, name, frame, what)


def _refuse_apart(
    day: str, time: str, frame: pd.DataFrame, what: str, options: Sequence[dict[str, str]] = ()
) -> NoReturn:
    cells = ", ".join(format_cell(frame[name].iloc[0]) for name in (day, time))
    raise InputError(
        f"Expected a date and its time of day in one column. Received: {day!r} and {time!r} "
        f"({cells}) in {what}.",
        [*options, _COUNT],
        "both in one column, as 2024-03-01T12:00:00",
    )


def _may_be_clock(tells: int, values: np.ndarray) -> bool:
    return tells > 0 and (
        _is_increasing(values) or tells == 2 and (is_epoch(values) or is_regular(values[::-1]))
    )


def _one_of(names: list[str], frame: pd.DataFrame, what: str) -> Clock:
    if len(names) > 1:
        raise InputError(
            f"Expected one time column. Received: {', '.join(names[:4])} in {what}.",
            [*({"time": name} for name in names[:4]), _COUNT],
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
    ramps = [
        name
        for name, values in numbers.items()
        if is_regular(values)
        or is_unnamed(name)
        and _is_increasing(values)
        and np.nanmax(values % 1) > 0
    ]
    groups = _signals_of(kinds, ramps)
    if not all(_is_nearly(numbers[ramps[0]], numbers[name]) for name in groups):
        raise InputError(
            f"Expected to know the clock. Received: {', '.join(list(groups)[:4])} of {what}, which "
            "increase in equal steps, each with signals of its own.",
            [*({"time": name, "columns": group} for name, group in groups.items()), _COUNT],
        )
    ramp = next(iter(ramps), next(in_order, None))
    if ramp is not None and sum(kind == "numbers" for kind in kinds.values()) > 1:
        step = float(np.median(np.diff(numbers[ramp][np.isfinite(numbers[ramp])])))
        raise InputError(
            f"Expected to know the clock. Received: {ramp!r} of {what}, which increases in steps "
            f"of {step:g}, as a clock or a counter does.",
            [
                {"time": ramp},
                *([] if is_epoch(numbers[ramp]) else [{"time": ramp, "time_format": "ms"}]),
                _COUNT,
            ],
        )
    for name in (name for name, kind in kinds.items() if kind == "words"):
        cells = frame[name].dropna().astype("str").iloc[:1_000]
        if (
            len(cells) >= _FEWEST
            and cells.is_unique
            and cells.iloc[:_FEWEST].str.contains(r"\d").all()
        ):
            raise InputError(
                f"Expected to know the clock. Received: {cells.iloc[0][:40]!r} in {name!r} of "
                f"{what}, which may be a time of an unknown form.",
                [_COUNT],
                f"{option_text({'time': name})} with --time-format",
            )


def unit_of(clock: Clock, units: Mapping[str, str], what: str) -> str | None:
    """Returns the unit or kind of days that the name of a clock's one column or the line of units
    states, or None.

    Raises an `InputError` if the column holds days whose kind is not known, or multiples of a unit.
    """
    if len(clock.columns) != 1:
        return None
    name = clock.columns[0]
    factor = _FACTOR.search(f"{name} [{units.get(name, '').strip('[]() ')}]")
    is_one = factor and re.fullmatch(r"0+|1(?:\.0*)?|24", factor[1])
    if factor and not is_one and pd.api.types.is_numeric_dtype(clock.cells.dtype):
        raise InputError(
            f"Expected times in s, ms, us or ns. Received: a multiple of a unit in {name!r} of "
            f"{what}.",
            [_COUNT],
            "the times in one of these units, and with its name",
        )
    form = name_tells(name)[1] or _UNIT_OF.get(units.get(name, "").strip(" []().").casefold())
    if (
        form is None
        and pd.api.types.is_numeric_dtype(clock.cells.dtype)
        and re.search(r"dat(?:e|um)", name.casefold())
    ):
        values = clock.cells.to_numpy(np.float64, na_value=np.nan)
        refuse_two_meanings(values[np.isfinite(values)], f"{name!r} of {what}", is_date=True)
    return form


def offset_of(
    clock: Clock, frame: pd.DataFrame, above: str, zone: str | None, what: str
) -> pd.Timedelta | None:
    """Returns the offset in a clock's name, as in `Time, GMT+02:00`, or None; refuses other
    statements of a zone, also in the text above the table, unless `zone` is given.
    """
    named = " ".join(clock.columns)
    if found := re.search(r"(?<!Etc/)\b(?:UTC|GMT) ?([+-]\d\d?)(?::?(\d\d))?\b", named):
        return pd.Timedelta(f"{found[1]}:{found[2] or '00'}:00")
    beside = [
        name
        for name in frame
        if _ZONE_COLUMN.search(name) or name.casefold() == "tz" and is_text(frame[name])
    ]
    places = [
        each
        for each in _PLACE.findall(f"{named} {above}")
        if each in zoneinfo.available_timezones()
    ]
    is_named = places or _ZONE.search(named)
    if zone is None and (is_named or beside and "utc" not in named.casefold()):
        raise InputError(
            "Expected times that state their zone. Received: "
            f"{', '.join(dict.fromkeys([named, *beside, *places]))} in {what}, where a zone is "
            "named that is not read.",
            [{"timezone": each} for each in dict.fromkeys((*places, "UTC"))],
            "the zone of the clock, as Europe/Berlin",
        )
    return None


def _without_ends(names: list[str]) -> list[str]:
    """Leaves out the ends of intervals beside their beginnings."""
    return [name for name in names if _ENDS.isdisjoint(words_of(name))] or names


def _fractions(numbers: Mapping[str, np.ndarray]) -> list[tuple[str, str]]:
    """Returns the pairs of columns of whole seconds and of the fractions of a second behind them,
    of names that are alike apart from their units.
    """
    stems: dict[tuple[str, ...], str] = {}
    for name in numbers:
        *stem, last = words_of(name) or [""]
        stems[(*stem, _UNIT_OF.get(last, ""))] = name
    pairs = []
    for (*stem, unit), name in stems.items():
        seconds = stems.get((*stem, "s"))
        if unit in _FRACTIONS and seconds is not None:
            rest = numbers[name]
            is_part = _are_whole(rest, 0, _FRACTIONS[unit])
            wraps = (np.diff(rest) < 0).any() or np.ptp(numbers[seconds]) == 0
            if is_part and (numbers[seconds] % 1 == 0).all() and wraps:
                pairs.append((seconds, name))
    return pairs


def _are_whole(values: np.ndarray, least: float, most: float) -> bool:
    return bool(((values >= least) & (values <= most) & (values % 1 == 0)).all())


def refuse_own_clocks(
    frame: pd.DataFrame,
    kinds: Mapping[str, str],
    numbers: Mapping[str, np.ndarray],
    asked: Collection[str],
    what: str,
) -> None:
    """Refuses signals that each have a clock of their own beside them, unless those of one clock
    are asked for.
    """
    clocks = {
        name
        for name in frame
        if kinds[name] == "dates" or name in numbers and _is_named_clock(name, numbers[name])
    }
    groups = _signals_of(kinds, clocks)
    behind = {
        name
        for before, name in itertools.pairwise(kinds)
        if _tells_time_of(before, name)
        and (kinds[name] == "dates" or name in numbers and _is_increasing(numbers[name]))
    }
    if not groups and clocks <= behind:
        groups = _signals_of(dict(reversed(kinds.items())), behind)
    if not groups:
        return
    first, *others = groups
    if len({kinds[name] for name in groups}) > 1 or any(
        asked and asked <= set(group) for group in map(set, groups.values())
    ):
        return
    if not all(
        (frame[name] == frame[first]).all()
        if kinds[first] == "dates"
        else _is_nearly(numbers[first], numbers[name])
        for name in others
    ):
        raise InputError(
            f"Expected one clock. Received: {len(groups)} in {what}, each with signals of its own "
            f"({', '.join(list(groups)[:4])}).",
            [{"time": name, "columns": group} for name, group in groups.items()],
        )


def _signals_of(kinds: Mapping[str, str], clocks: Collection[str]) -> dict[str, list[str]]:
    """Returns the columns of numbers behind each of several clocks, up to the next one; nothing
    unless the first column is a clock and each clock has a signal.
    """
    groups: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        if name in clocks:
            groups[name] = []
        elif groups and kind == "numbers":
            groups[list(groups)[-1]].append(name)
    is_whole = len(groups) > 1 and all(groups.values()) and next(iter(kinds)) in groups
    return groups if is_whole else {}


def _tells_time_of(signal: str, name: str) -> bool:
    """Whether a name says no more than that of a signal and that it is a time, as `volts_time`
    beside `volts` and `time2` beside any.
    """
    own = [word for word in words_of(name) if word not in words_of(signal)]
    is_of_one = len(words_of(name)) > 1 or any(map(str.isdigit, name))
    return is_of_one and len(own) == 1 and own[0] in _TIMES.union("t")


def _is_named_clock(name: str, values: np.ndarray) -> bool:
    return name_tells(name)[0] == 2 and _may_be_clock(2, values[np.isfinite(values)])


def _is_nearly(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two columns are the same but for rounding and their unit."""
    is_alike = (np.isfinite(first) == np.isfinite(second)).all()
    return is_alike and any(_is_small(second - ratio * first, second) for ratio in _RATIOS)


def _is_small(off: np.ndarray, values: np.ndarray) -> bool:
    """Whether values are off by no more than rounding them to whole numbers, or than most of their
    usual step.
    """
    known = values[np.isfinite(values)]
    rounding = (known % 1 == 0).all() and np.ptp(known) >= 3
    return np.nanmax(np.abs(off)) <= max(rounding, 0.6 * np.median(np.abs(np.diff(known))))


def further_clocks(
    clock: Clock, times: Times | None, numbers: Mapping[str, np.ndarray], kinds: Mapping[str, str]
) -> set[str]:
    """Returns the columns that show the time once more, or show it although samples are counted."""
    found = {name for name in numbers if name_tells(name)[0] == 2} | {
        name for name, kind in kinds.items() if kind in ("dates", "times of day")
    }
    if times is None:
        parts = _date_parts(numbers) or Clock()
        return found.union(
            parts.columns,
            (
                name
                for name, values in numbers.items()
                if _may_be_clock(name_tells(name)[0], values)
            ),
        )
    known = np.where(times.stamps.isna(), np.nan, times.stamps.as_unit("ns").asi8.astype(float))
    for name, values in numbers.items():
        words = set(words_of(name))
        is_named = name_tells(name)[0] > 0 or words and words <= _BESIDE.union(_UNIT_OF)
        is_named = is_named or re.match("t(?![a-z])", name)  # t-Step[s] of battery cyclers
        if (
            name not in clock.columns
            and (is_named or is_epoch(values))
            and _shows_time(known, values)
        ):
            found.add(name)
    return found


def _shows_time(times: np.ndarray, values: np.ndarray) -> bool:
    """Whether a column shows times once more: from another zero, in another unit, rounded, or so
    that it begins again now and then.
    """
    both = np.isfinite(times) & np.isfinite(values)
    times = times[both] - np.min(times[both], initial=np.inf)
    values = values[both] - np.min(values[both], initial=np.inf)
    if len(times) < 3 or np.ptp(values) == 0:
        return False
    steps = np.diff(times)
    own = np.diff(values)
    sizes = np.ptp(values), np.median(np.abs(own))
    spans = np.ptp(times), np.median(np.abs(steps))
    return any(
        np.mean((np.abs(own / ratio - steps) <= 0.05 * steps) & (steps > 0)) > 0.4
        or _is_small(values - ratio * times, values)
        for ratio in _RATIOS
        if any(size / 2 < ratio * span < 2 * size for size, span in zip(sizes, spans, strict=True))
    )


def _varying(names: list[str], frame: pd.DataFrame) -> list[str]:
    """Leaves out columns that hold the same date throughout, such as the range of a query."""
    return [
        name
        for name in names
        if frame[name].iloc[:1_000].nunique() > 1 or frame[name].nunique() > 1
    ]


def _joined(
    frame: pd.DataFrame,
    kinds: Mapping[str, str],
    dates: list[str],
    numbers: Mapping[str, np.ndarray],
) -> Clock | None:
    """Returns the clock that a column of dates and columns of the time of day, in text or whole
    numbers, make together, or None.
    """
    hours = _without_ends([name for name in kinds if kinds[name] == "times of day"])
    if len(dates) != 1 or len(hours) > 1:
        return None
    cells = frame[dates[0]]
    if dates[0] in numbers:
        text = numbers[dates[0]].astype(np.int64).astype(str)
        cells = pd.Series(pd.to_datetime(text, format="%Y%m%d"))
    is_day = _are_days(cells)
    has_zone = isinstance(cells.dtype, pd.DatetimeTZDtype)  # far dates have no text with one
    head = (cells.dt.tz_convert(None) if has_zone else cells).dropna().iloc[:LOOK].astype("str")
    whole_seconds = head.str.fullmatch(r".*:\d\d:\d\d(?:Z|[+-]\d\d:?\d\d)?").all()
    parts = {part: name for part, name in _parts_of(numbers).items() if part in _MOST}
    below = {part: name for part, name in parts.items() if part in _FRACTIONS}
    if hours and is_day:
        lacks = frame[hours[0]].dropna().iloc[:LOOK].astype("str").str.fullmatch(r" *\d\d?:\d\d *")
        has_seconds = "second" in parts and np.nanmax(numbers[parts["second"]]) <= _MOST["second"]
        parts = ({"second": parts["second"]} if lacks.all() and has_seconds else {}) | below
    elif not is_day and below and whole_seconds:
        parts = below
    elif not is_day or "hour" not in parts:
        parts = {}
    elif "second" not in parts:
        parts = {part: name for part, name in parts.items() if part not in below}
    texts: list[str] = []
    if hours and is_day:
        texts = hours + [
            name
            for name, kind in kinds.items()
            if kind == "words" and frame[name].dropna().isin(["AM", "PM", "am", "pm"]).all()
        ]
        if pd.api.types.is_datetime64_any_dtype(cells.dtype):
            cells = cells.dt.strftime("%Y-%m-%d")
        # a date may stand in the first row of each day only
        cells = cells.astype("str").str.strip().ffill()
        for name in texts:
            cells = cells + " " + frame[name].astype("str").str.strip()
    added = _added(numbers, parts)
    if parts and parts.keys() <= _FRACTIONS.keys() and not _makes_alike(cells, added):
        parts, added = {}, None
    columns = (dates[0], *texts, *parts.values())
    return Clock(columns, cells, added) if len(columns) > 1 else None


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


def _are_days(cells: pd.Series) -> bool:
    """Whether dates have no time of day; who keeps a zone keeps times."""
    if isinstance(cells.dtype, pd.DatetimeTZDtype):  # far ones have no text
        return False
    head = cells.dropna().iloc[:LOOK].astype("str")
    return not head.str.contains(r":|T\d|\d{8}\d").any()


def _parts_of(numbers: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Returns the columns that are named like parts of a date or a time of day, and may hold them,
    by these parts.
    """
    found: dict[str, str] = {}
    plain = {name: re.sub(r"\W|_", "", name.casefold()) for name in numbers}
    for name, word in plain.items():
        part = _PART_OF.get(word)
        # the second of `MM` and `mm`
        if word == "mm" and {"month", "doy"} & set(found):
            part = "minute"
        if part is not None and not (word == "min" and _STATISTICS.intersection(plain.values())):
            found.setdefault(part, name)
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
            values = numbers[parts[part]] - (part == "doy")
            is_known = (values >= 0) & (values <= most.get(part, np.inf))  # others have no time
            spans.append(pd.Series(pd.to_timedelta(np.where(is_known, values, np.nan), unit=unit)))
    unit = "ns" if "ns" in parts else "us"
    return sum(spans[1:], spans[0]).dt.round(unit) if spans else None


def _date_parts(numbers: Mapping[str, np.ndarray]) -> Clock | None:
    """Returns the clock of columns for the year, the month and day or the day of year, and perhaps
    the time of day, or None.
    """
    parts = _parts_of(numbers)
    if not {"doy", "month"} & set(parts) or "year" not in parts:
        return None
    years = numbers[parts["year"]]
    if not _are_whole(years[np.isfinite(years)], 1900, 2200):
        return None
    if "second" not in parts:
        parts = {part: name for part, name in parts.items() if part not in _FRACTIONS}
    of_date = ("month", "day") if "doy" not in parts else ()
    days = {part: numbers[parts[part]] if part in parts else 1.0 for part in of_date}
    days = pd.DataFrame({"year": years, "month": 1.0, "day": 1.0} | days)
    stamps = pd.to_datetime(days, errors="coerce").astype("datetime64[ns]")
    return Clock(tuple(parts.values()), stamps, _added(numbers, parts))
