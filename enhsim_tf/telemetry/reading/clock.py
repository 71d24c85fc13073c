"""Finds the clock of a table by what the columns hold; names only help.

Dates win, then durations, then numbers that increase and whose name speaks of time. Numbers that
only look like a clock are never taken.
"""

import itertools
import re
import zoneinfo
from collections.abc import Collection, Mapping, Sequence
from typing import NoReturn

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError, option_text
from enhsim_tf.telemetry.cleaning.numbers import format_cell, is_text
from enhsim_tf.telemetry.cleaning.times import (
    LOOK,
    Times,
    compact_form,
    may_be_time_of_day,
    parse_times,
    refuse_two_meanings,
)
from enhsim_tf.telemetry.reading.clock_parts import (
    Clock,
    are_days,
    clock_of_parts,
    clocks_of_fractions,
    parts_of,
    with_times_of_day,
)
from enhsim_tf.telemetry.reading.clock_values import (
    FEWEST,
    epoch_unit_of,
    is_epoch,
    is_increasing,
    is_nearly,
    is_regular,
    may_count,
    shows_time,
    steps_of,
)
from enhsim_tf.telemetry.reading.column_names import (
    BESIDE,
    UNIT_OF,
    is_unnamed,
    mentions_time,
    name_tells,
    tells_time_of,
    without_ends,
    words_of,
)
from enhsim_tf.telemetry.reading.contents import Contents, different, first_cells
from enhsim_tf.telemetry.reading.text_files import Table

# instead of the name of a time column: the table has no times, and samples are counted
NO_TIME = "none"
_OFTEN = 0.3  # share of the rows that repeat a date, above which it lacks its time of day
# a number before a unit, as in `Time [10ms]` and `ticks (1/100 s)`
_FACTOR = re.compile(
    rf"(?:[\[(]\s*x?|(?<!\d)/\s*|_)(\d[\d./^*-]*)[ *]*(?:{'|'.join(UNIT_OF)})(?![^\W\d_])",
    re.IGNORECASE,
)
# zeros of times other than 1970
_SINCE = re.compile(
    r"since[\W_]+(?!.*70\b)(?:\d{4}|\d\d?[-./_]\d\d?[-./_]\d\d)|mjd[\W_]?2(?:000|k)", re.IGNORECASE
)
_NO_UNITS = set("cs ds yr yrs year years month months week weeks deciseconds centiseconds".split())
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\W\d_]+)\s*[\])]\s*$")
_PLACE = re.compile(r"\b[A-Z]\w+/[A-Z]\w+\b")  # as Europe/Berlin
_ZONE = re.compile(
    r"\b(?:[CEW]ES?T|MES?Z|BST|JST|MSK|HKT|SGT|SAST|LST|NZ[SD]T|A[CEWK][SD]T|[ECHMP][SD]T|"
    r"\w+ (?:Standard|Daylight) Time)\b|(?:UTC|GMT)[+-]\d"
)
_ZONE_ABOVE = re.compile(r".*\btime ?zone\b.*", re.IGNORECASE)
_UTC = re.compile(r"\b(?:UTC|GMT|Z)\b(?!\W{0,2}[+-]0*[1-9])|Universal|Zulu|\bno\b|\W0\s*$")
_TIME_LIKE = r"\s*(?:[01]?\d|2[0-4]) ?(?:[:hH] ?[0-5]\d|([.-])[0-5]\d\1[0-5]\d)(?!\d).*"
_WITH_YEAR = re.compile(r"\d:\d\d.*\b20\d\d|\b20\d\d.*\d:\d\d")
_COUNT = {"time": NO_TIME}  # the option of counting the samples
_FORMS_OF_DAY = ("%H:%M", "%M:%S", "%H:%M:%S", "%H:%M:%S.%f")  # whose dates are 1900-01-01
_EACH_CLOCK = "each clock with its signals as a file"
_ZONE_COLUMN = re.compile(
    r"time[ _]?zone|zeitzone|(?:tz|utc|gmt)[ _]?(?:offset|ofst)|tz_cd", re.IGNORECASE
)


def find_clock(table: Contents) -> Clock:
    """Finds the clock of a table; refuses one in which several columns may be it, or one of which
    only the values speak for it.

    The table is without columns that are told otherwise, and its numbers without those of columns
    that are asked for as channels.
    """
    frame = table.frame
    numbers = table.numbers
    tells = {name: name_tells(name)[0] for name in table.kinds}
    varying = _varying(table)
    dates = different(frame, without_ends(varying or table.of_kind("dates")[:1]))
    compact = [
        name
        for name, values in numbers.items()
        if tells[name] == 2 and compact_form(values) == "%Y%m%d"
    ]
    table = with_times_of_day(table, dates or compact)
    numbers = table.numbers
    if (joined := clock_of_parts(table, dates or compact)) is not None:
        return joined
    dates = [name for name in dates if tells[name]] or dates
    if dates and frame[dates[0]].iloc[: 50 * LOOK].duplicated().mean() > _OFTEN:
        _refuse_apart_times(table, dates[0])
    if varying:
        return _one_of(table, dates)
    if (parts := clock_of_parts(table)) is not None:
        return parts
    of_fractions = clocks_of_fractions(numbers)
    taken = {name for clock in of_fractions for name in clock.columns}
    may_be = {
        name: values
        for name, values in numbers.items()
        if name not in taken and _may_be_clock(name, values)
    }
    spans = [
        name
        for name in table.of_kind("spans")
        if may_count(parse_times(frame[name], "", drop=True).seconds)
    ]
    if spans and all(tells[name] < 2 for name in may_be):
        span = max(spans, key=lambda name: tells[name])
        return Clock((span,), frame[span])
    if of_fractions and not may_be:
        return of_fractions[0]
    if may_be:
        clocks = _clearest(may_be, tells)
        is_plain = not is_epoch(numbers[clocks[0]]) and name_tells(clocks[0])[1] is None
        if compact and clocks != compact[:1] and is_plain:
            _refuse_apart(table, compact[0], clocks[0])
        if dates and is_plain:
            _refuse_apart(table, dates[0], clocks[0], [{"time": clocks[0]}])
        return _one_of(table, clocks)
    return _one_of(table, dates) if dates else _unclear_clock(table, tells)


def _clearest(clocks: Mapping[str, np.ndarray], tells: Mapping[str, int]) -> list[str]:
    """Returns the clocks whose names say so most clearly, one of those that show the same time."""
    best = max(tells[name] for name in clocks)
    named = [name for name in clocks if tells[name] == best]
    # what begins again, such as the time of a step, is no clock beside one that does not
    ahead = [name for name in named if not (np.diff(clocks[name]) < 0).any()]
    first, *others = ahead or named
    others = [name for name in others if not shows_time(clocks[first], clocks[name])]
    return without_ends([first, *others])


def _unclear_clock(table: Contents, tells: Mapping[str, int]) -> Clock:
    """Returns a column of words that is named like a clock, to be refused with its first cell, or
    none, whose samples are counted; refuses other columns that may be a clock.
    """
    for name, kind in table.kinds.items():
        if kind == "times of day":
            cells = table.frame[name].dropna()
            text = cells.astype("str")
            options = [
                {"time_format": form}
                for form in _FORMS_OF_DAY
                if isinstance(cells.iloc[0], str)
                and pd.to_datetime(text, format=form, errors="coerce").is_monotonic_increasing
            ]
            raise InputError(
                f"Expected times with a date. Received: {text.iloc[0]!r} in {name!r} of "
                f"{table.what}.",
                [*options, _COUNT],
                "a column of dates",
            )
        if tells[name] == 2 and kind == "words":
            return Clock((name,), table.frame[name])
    for name in (*table.numbers, *table.of_kind("spans")):
        if tells[name] == 2:
            raise InputError(
                f"Expected a clock that increases. Received: {name!r} of {table.what}, which is "
                "named like one and does not.",
                [_COUNT, {"time": name}],
            )
    _refuse_unknown(table)
    return Clock()


def _refuse_apart_times(table: Contents, day: str) -> None:
    """Refuses dates that repeat beside what may be their time of day, in a form that is not read,
    or beside another clock that does not repeat.
    """
    days = table.frame[day]
    for name, kind in table.kinds.items():
        if name in table.numbers and name_tells(name)[0] == 2:
            values = table.numbers[name]
            is_apart = name_tells(name)[1] is None and may_be_time_of_day(values)
            if (steps_of(values) > 0).all() and days.nunique() > 1:
                _one_of(table, [day, name])
        else:
            cells = first_cells(table.frame[name])
            is_apart = kind == "words" and cells.str.fullmatch(_TIME_LIKE).mean() > 0.9
        if is_apart and are_days(days):
            _refuse_apart(table, day, name)


def _refuse_apart(
    table: Contents, day: str, time: str, options: Sequence[dict[str, str]] = ()
) -> NoReturn:
    cells = ", ".join(format_cell(table.frame[name].iloc[0]) for name in (day, time))
    raise InputError(
        f"Expected a date and its time of day in one column. Received: {day!r} and {time!r} "
        f"({cells}) in {table.what}.",
        [*options, _COUNT],
        "both in one column, as 2024-03-01T12:00:00",
    )


def _may_be_clock(name: str, values: np.ndarray) -> bool:
    is_named = name_tells(name)[0] > 0
    return is_named and (is_increasing(values) or is_epoch(values) or is_regular(values[::-1]))


def _one_of(table: Contents, names: list[str]) -> Clock:
    if len(names) > 1:
        raise InputError(
            f"Expected one time column. Received: {', '.join(names[:4])} in {table.what}.",
            [*({"time": name} for name in names[:4]), _COUNT],
        )
    return Clock((names[0],), table.frame[names[0]])


def _refuse_unknown(table: Contents) -> None:
    """Refuses a column that may be a clock of which neither name nor form is known."""
    kinds = table.kinds
    numbers = table.numbers
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
        and is_increasing(values)
        and np.nanmax(values % 1) > 0
    ]
    groups = _signals_of(kinds, ramps)
    if not all(is_nearly(numbers[ramps[0]], numbers[name]) for name in groups):
        raise InputError(
            f"Expected to know the clock. Received: {', '.join(list(groups)[:4])} of {table.what}, "
            "which increase in equal steps, each with signals of its own.",
            [*({"time": name, "columns": group} for name, group in groups.items()), _COUNT],
            _EACH_CLOCK,
        )
    ramp = next(iter(ramps), next(in_order, None))
    if ramp is not None and len(table.of_kind("numbers")) > 1:
        step = float(np.median(steps_of(numbers[ramp])))
        named = [
            name
            for name, values in numbers.items()
            if name != ramp and mentions_time(name) and is_increasing(values)
        ]
        clocks = [ramp, *(named or ramps[1:])[:1]]
        raise InputError(
            f"Expected to know the clock. Received: {ramp!r} of {table.what}, which increases in "
            f"steps of {step:g}, as a clock or a counter does.",
            [
                *({"time": name} for name in clocks),
                *(
                    {"time": name, "time_format": "ms"}
                    for name in clocks
                    if not (is_epoch(numbers[name]) or compact_form(numbers[name]))
                ),
                _COUNT,
            ],
        )
    for name in table.of_kind("words"):
        cells = first_cells(table.frame[name], 1_000)
        if (
            len(cells) >= FEWEST
            and cells.is_unique
            and cells.iloc[:FEWEST].str.contains(r"\d").all()
        ):
            raise InputError(
                f"Expected to know the clock. Received: {cells.iloc[0][:40]!r} in {name!r} of "
                f"{table.what}, which may be a time of an unknown form.",
                [_COUNT],
                f"{option_text({'time': name})} with --time-format",
            )


def unit_of(clock: Clock, table: Table) -> str | None:
    """Returns the unit or kind of days that the name of a clock's one column or the line of units
    states, or None.

    Raises an `InputError` if the column holds days whose kind is not known, or multiples of a unit.
    """
    if len(clock.columns) != 1:
        return None
    name = clock.columns[0]
    is_numeric = pd.api.types.is_numeric_dtype(clock.cells.dtype)
    unit = table.units.get(name, "").strip(" []().")
    stated = f"{name} [{unit}]"
    factor = _FACTOR.search(stated)
    found = _IN_BRACKETS.search(name)
    in_brackets = found[1].casefold() if found else ""
    form = name_tells(name)[1] or UNIT_OF.get(unit.casefold().partition(" since")[0])
    form = form or UNIT_OF.get(in_brackets)
    unknown = ""
    if factor and not re.fullmatch(r"0+|1(?:\.0*)?|24", factor[1]):
        unknown = "a multiple of a unit"
    elif _SINCE.search(stated):
        unknown = "another zero than 1970"
    elif in_brackets in _NO_UNITS:
        unknown = f"the unit {in_brackets}"
    if unknown and is_numeric:
        raise InputError(
            f"Expected times in s, ms, us or ns, since 1970 or from zero. Received: {unknown} in "
            f"{name!r} of {table.what}.",
            [_COUNT],
            "the times as dates, as pandas.to_datetime makes them with unit and origin",
        )
    if form is None and is_numeric and re.search(r"dat(?:e|um)|ju?ld?$", name.casefold()):
        values = clock.cells.to_numpy(np.float64, na_value=np.nan)
        refuse_two_meanings(values[np.isfinite(values)], f"{name!r} of {table.what}", is_date=True)
    return form


def offset_of(clock: Clock, table: Table, zone: str | None) -> pd.Timedelta | None:
    """Returns the offset in a clock's name, as in `Time, GMT+02:00`, or None; refuses other
    statements of a zone, also in the text above the table, unless `zone` is given.
    """
    named = " ".join(clock.columns)
    if found := re.search(r"(?<!Etc/)\b(?:UTC|GMT) ?([+-]\d\d?)(?::?(\d\d))?\b", named):
        return pd.Timedelta(f"{found[1]}:{found[2] or '00'}:00")
    if zone is not None:
        return None
    frame = table.frame
    beside = [
        name
        for name in frame
        if _ZONE_COLUMN.search(name) or name.casefold() == "tz" and is_text(frame[name])
    ]
    cells = [str(cell).strip() for name in beside for cell in frame[name].dropna().unique()[:1]]
    said = set(_PLACE.findall(" ".join((named, table.above, *cells))))
    places = sorted(said & zoneinfo.available_timezones()) if said else []
    offsets = [cell for cell in cells if re.fullmatch(r"[+-]\d\d:\d\d", cell)]
    head = frame.iloc[:LOOK]
    texts = [str(cell) for name in frame if is_text(head[name]) for cell in head[name].dropna()[:1]]
    beside += [text for text in texts if _WITH_YEAR.search(text) and _ZONE.search(text)]
    beside += [text for text in _ZONE_ABOVE.findall(table.above) if not _UTC.search(text)]
    is_utc = "utc" in named.casefold()
    if _ZONE.search(named) or (places or beside) and not is_utc:
        raise InputError(
            "Expected times that state their zone. Received: "
            f"{', '.join(dict.fromkeys([named, *beside, *places]))} in {table.what}, where a zone "
            "is named that is not read.",
            [{"timezone": each} for each in dict.fromkeys((*places, *offsets, "UTC"))],
            "the zone of the clock, as Europe/Berlin",
        )
    return None


def refuse_other_zone(times: Times, table: Contents, further: Collection[str]) -> None:
    """Refuses dates without a zone that `further` columns, of numbers since 1970 or of dates with a
    zone, show in another zone than UTC.
    """
    for name in further:
        if name in table.numbers:
            values = table.numbers[name]
            unit = epoch_unit_of(values)
            if unit is None or name_tells(name)[0] < 2:
                continue
            stamps = pd.to_datetime(values, unit=unit, errors="coerce")
        elif first_cells(table.frame[name]).str.fullmatch(r".*[T ].*\d[+-]\d\d:?\d\d").all():
            stamps = parse_times(table.frame[name], "", drop=True).stamps.tz_localize(None)
        else:
            continue
        off = pd.Series(abs(stamps - times.stamps))
        apart = off.median()
        is_zone = name in table.numbers or off.nunique() == 1
        if is_zone and pd.Timedelta("15min") <= apart <= pd.Timedelta("14h"):
            raise InputError(
                f"Expected dates that agree with times whose zone is known. Received: {name!r} of "
                f"{table.what}, {apart.total_seconds() / 3600:g} h apart from them.",
                [{"time": name}],
                "the zone of the dates with --timezone",
            )


def refuse_own_clocks(table: Contents, asked: Collection[str]) -> None:
    """Refuses signals that each have a clock of their own beside them, unless those of one clock
    are asked for.
    """
    frame = table.frame
    numbers = table.numbers
    # counters and fractions of a second are no signals
    beside = {name for clock in clocks_of_fractions(numbers) for name in clock.columns[1:]}
    beside |= {
        name for name, values in numbers.items() if np.sum(np.diff(values) == 1) > 0.9 * len(values)
    }
    kinds = {
        name: kind
        for name, kind in table.kinds.items()
        if name not in beside or name_tells(name)[0] == 2
    }
    clocks = {
        name
        for name in kinds
        if kinds[name] == "dates"
        or name in numbers
        and name_tells(name)[0] == 2
        and _may_be_clock(name, numbers[name])
    }
    groups = _signals_of(kinds, clocks)
    behind = {
        name
        for before, name in itertools.pairwise(kinds)
        if tells_time_of(before, name)
        and (kinds[name] == "dates" or name in numbers and is_increasing(numbers[name]))
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
        else is_nearly(numbers[first], numbers[name])
        # times since 1970 and since the start
        or is_epoch(numbers[first]) != is_epoch(numbers[name])
        and is_nearly(*(numbers[clock] - np.nanmin(numbers[clock]) for clock in (first, name)))
        for name in others
    ):
        raise InputError(
            f"Expected one clock. Received: {len(groups)} in {table.what}, each with signals of "
            f"its own ({', '.join(list(groups)[:4])}).",
            [{"time": name, "columns": group} for name, group in groups.items()],
            _EACH_CLOCK,
        )


def _signals_of(kinds: Mapping[str, str], clocks: Collection[str]) -> dict[str, list[str]]:
    """Returns the columns of numbers behind each of several clocks, up to the next one; nothing
    unless the first column is a clock and each clock has a signal. Beside clocks of one name, words
    are no columns, and clocks of words alone are none.
    """
    is_repeated = len({name.rstrip("0123456789") for name in clocks}) == 1
    groups: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        if name in clocks:
            groups[name] = []
        elif groups and kind == "numbers":
            groups[list(groups)[-1]].append(name)
        elif kind == "numbers" or not groups and not is_repeated:
            return {}
    if is_repeated:
        groups = {clock: signals for clock, signals in groups.items() if signals}
    return groups if len(groups) > 1 and all(groups.values()) else {}


def further_clocks(table: Contents, clock: Clock, times: Times | None) -> set[str]:
    """Returns the columns that show the time once more, or show it although samples are counted."""
    numbers = table.numbers
    found = {name for name in numbers if name_tells(name)[0] == 2}
    found.update(table.of_kind("dates"), table.of_kind("times of day"))
    for other in clocks_of_fractions(numbers):
        found.update(other.columns if is_increasing(numbers[other.columns[0]]) else ())
    if times is None:
        parts = clock_of_parts(table) or Clock()
        return found.union(
            parts.columns,
            (name for name, values in numbers.items() if _may_be_clock(name, values)),
        )
    for part, name in parts_of(numbers).items():
        values = getattr(times.stamps, part, None)
        is_part = part in ("year", "month", "day") or values is not None and values.nunique() > 1
        if values is not None and is_part and (values == numbers[name]).mean() > 0.9:
            found.add(name)
    seconds = times.seconds
    for name, values in numbers.items():
        words = set(words_of(name))
        is_named = name_tells(name)[0] > 0 or words and words <= BESIDE.union(UNIT_OF)
        is_named = is_named or re.match("t(?![a-z])", name)  # t-Step[s] of battery cyclers
        if (
            name not in clock.columns
            and (is_named or is_epoch(values))
            and shows_time(seconds, values)
        ):
            found.add(name)
    return found


def _varying(table: Contents) -> list[str]:
    """Returns the columns of dates without those that hold the same date throughout, such as the
    range of a query.
    """
    frame = table.frame
    return [
        name
        for name in table.of_kind("dates")
        if frame[name].iloc[:1_000].nunique() > 1 or frame[name].nunique() > 1
    ]
