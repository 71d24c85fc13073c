"""Parses a raw column as times: date-times, dates as text, durations, numbers since 1970 or any
other zero, days of spreadsheets.

An empty cell is a missing time. A cell that cannot be parsed either raises an `InputError` that
names its place or is marked, so that the caller can count it.
"""

import dataclasses
import datetime
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from pandas.tseries.api import guess_datetime_format

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import (
    as_column,
    format_cell,
    is_missing,
    is_plain,
    is_text,
    parse_numbers,
)
from enhsim_tf.telemetry.cleaning.options import DAYS, UNITS, UNITS_NS
from enhsim_tf.telemetry.cleaning.report import ROWS, CleaningLog, Places

_DAY_NAMES = {
    "excel": "days of spreadsheets",
    "mjd": "modified Julian dates",
    "jd": "Julian dates",
    "datenum": "MATLAB's day numbers",
}
# seconds since 1970 in the years 1979 to 2077; later ones count from 1900 or 1904
_YEARS_S = (3.1e8, 3.4e9)
_DAY_NUMBERS = ((20_000, 80_000), (6.9e5, 7.75e5), (2.43e6, 2.5e6))  # of 1954 to 2119
_RANGE = pd.Timestamp(1678, 1, 1), pd.Timestamp(2262, 1, 1)
LARGEST_NS = 9.2e18  # limit of int64 nanoseconds since 1970: years 1678 to 2262
DURATION = (
    r"[+-]?\d+(?:\.\d+)? ?"
    r"(?:ns|us|ms|s|secs?|seconds?|min|minutes?|h|hrs?|hours?|d|days?(?: [\d:.+-]+)?)"
    r"|P(?:\d+D)?T(?=\d)(?:\d+H)?(?:\d+M)?(?:\d+(?:\.\d+)?S)?|P\d+D"
)
"""Pattern of a time span as text, such as `0.5 sec`, `1 days 00:00:01` and `PT90S`."""
_ISO = "ISO8601"
_COMPACT = {7: "%Y%j", 8: "%Y%m%d", 10: "%Y%m%d%H", 12: "%Y%m%d%H%M", 14: "%Y%m%d%H%M%S"}
_ANY_DATE = r"\d{1,4}[./-]\d\d?[./-]\d{1,4} "
_REWRITTEN = {
    # of an interval, the start is kept
    r"^(\d{4}-\d\d-\d\dT[^/]*)/.*": r"\1",
    rf"^({_ANY_DATE}.*:\d\d) - {_ANY_DATE}.*": r"\1",
    r"^(\d{8}):(\d{4})$": r"\1T\2",
    r"(:\d\d),(\d)": r"\1.\2",  # decimal commas in seconds
    r" ?(?:UTC|GMT)$": "+00:00",
    r"(?<=[T :])(\d)(?=:\d|\.\d|$)": r"0\1",  # a time of day without leading zeros
    r"([AaPp])\. ?[Mm]\.?$": r"\1M",
}
_MIDNIGHT = r"(?<=[T ])24(?=:00)"  # at the end of a day
LOOK = 200  # number of cells that are inspected to find a form
_MAX_JUMPS = 100  # above which times are in no order
TIME_OF_DAY = (
    r"(?P<time>\d\d?:(?:\d\d|\d(?=:\d\d))"
    r"(?P<seconds>:(?:\d\d|(?<=\d\d:)\d(?!\d))(?P<fraction>[.,]\d+)?)?)"
    r"(?P<half> ?[AaPp][Mm])?"
)
# more than a day; 24:00:00 may be its end
_ELAPSED = r"(?:24(?!:00:00)|2[5-9]|[3-9]\d|\d{3,}):\d\d:\d\d(?:\.\d+)?"
_END = rf"(?:(?P<gap>[T:]|,? +){TIME_OF_DAY})?(?P<zone> ?(?:Z|[+-]\d\d(?::?\d\d)?))?"
_DAY_OF_YEAR = re.compile(rf"\d{{4}}(?P<mark>[-/:. ]?)\d{{3}}{_END}")
_DAY_MONTH = re.compile(
    r"\d\d?(?P<mark>[./-])(?:\d\d?|(?P<letters>[A-Za-z]{3}))"
    rf"(?P=mark)\d\d(?P<century>\d\d)?{_END}"
)
_YEAR_FIRST = re.compile(rf"\d{{4}}(?P<mark>[./-])\d\d?(?P=mark)\d\d?{_END}")
_GUESSED = re.compile(r"[A-Za-z]{3}|^\d{4}[/.]")


class ClockError(InputError):
    """Raised where the clock, which other channels share, cannot be used."""


@dataclasses.dataclass(frozen=True, eq=False)
class Times:
    """Parsed times."""

    # NaT where missing, in UTC if the source says so and without a zone otherwise
    stamps: pd.DatetimeIndex
    bad: np.ndarray  # mask of the times that could not be parsed
    form: str = "dates"  # how they are written, for the report
    zone: str = ""  # that the source states, for the report; empty if it states none
    counts: bool = False  # whether they count from a zero of their own and are no dates

    def at(self, rows: np.ndarray) -> "Times":
        """The times of some rows."""
        return dataclasses.replace(self, stamps=self.stamps[rows], bad=self.bad[rows])

    @property
    def seconds(self) -> np.ndarray:
        """The times in seconds, NaN where they are missing."""
        return np.where(self.stamps.isna(), np.nan, self.stamps.as_unit("ns").asi8 / 1e9)


def parse_times(
    times: Any, what: str, drop: bool = False, form: str | None = None, places: Places = ROWS
) -> Times:
    """Parses a column of times.

    Args:
        times: Date-times, text, objects, time spans, or numbers.
        what: Description of the source, for messages.
        drop: Whether a time that cannot be parsed is marked and taken as missing, instead of
            refused.
        form: How they are written, see `Cleaning.time_format`. None: detected.
        places: Where the rows are in their file, for messages.
    """
    times = as_column(times, what).infer_objects()  # such as time spans
    reader = _Reader(what, drop, places)
    if isinstance(times.dtype, pd.PeriodDtype):
        times = times.dt.start_time
    kind = times.dtype
    is_format = form is not None and "%" in form
    if pd.api.types.is_datetime64_any_dtype(kind):
        return reader.of_dates(times)
    if getattr(kind, "kind", "") == "m":
        return reader.of_numbers(times.dt.total_seconds(), "s")
    if not (is_plain(times) or is_text(times)):
        raise InputError(
            f"Expected times as dates or numbers. Received: dtype {kind} from {what}. Name another "
            "time column."
        )
    if not is_text(times):
        if not is_format:
            return reader.of_numbers(times, form)
        width = len(datetime.datetime(2000, 1, 1).strftime(form))  # numbers have lost leading zeros
        given = times.notna()
        if ".%f" in form:
            text = times.map(f"{{:0{width}.6f}}".format)
        elif (times[given] % 1 == 0).all():
            text = times.astype("Int64").astype(str)
            text = text if "%f" in form else text.str.zfill(width)
        else:
            text = times.astype(str)
        times = text.where(given)
    return reader.of_text(times, form, is_format)


@dataclasses.dataclass(frozen=True)
class _Reader:
    """Reads times of one source; its arguments are those of `parse_times`."""

    what: str
    drop: bool
    places: Places

    def refuse(
        self,
        cells: pd.Series,
        bad: np.ndarray,
        otherwise: str = "times as 2024-03-01T12:00:00",
        expected: str = "times as ISO 8601 date-times or seconds",
    ) -> None:
        """Raises an `InputError` that names the first bad cell, unless there is none or they are
        dropped.
        """
        if self.drop or not bad.any():
            return
        row = int(np.argmax(bad))
        try:
            received = format_cell(cells.iloc[row])
        # the time is too far in the future or past to be converted to its zone
        except (NotImplementedError, OverflowError, ValueError):
            received = "a time out of range"
        # samples can be counted where a column of times is read
        options = [{"time": "none"}] if self.places.files else []
        if 2 * bad.sum() < len(bad):
            options = [{"drop_bad": True}]
        raise InputError(
            f"Expected {expected}. Received: {received} at {self.places.of(row)} of {self.what} "
            f"({int(bad.sum()):,} in all).",
            options,
            otherwise,
        )

    def of_dates(self, times: pd.Series) -> Times:
        stamps = pd.DatetimeIndex(times)
        zone = ""
        if stamps.tz is not None:
            zone = f"{stamps.tz}, stated"
            stamps = stamps.tz_convert("UTC")
        first, end = (edge.tz_localize(stamps.tz) for edge in _RANGE)
        bad = (stamps < first) | (stamps >= end)
        self.refuse(times, bad, "times from 1678 to 2261")
        if bad.any():
            stamps = stamps.where(~bad)
        return Times(stamps.as_unit("ns"), bad, "dates", zone)

    def of_numbers(self, times: pd.Series, unit: str | None) -> Times:
        values = times.to_numpy(np.float64, na_value=np.nan)
        form = ""
        finite = np.isfinite(values)
        unit = unit or _infer_unit(values[finite], self.what)
        if unit in DAYS:
            # a spreadsheet's eight decimals are a millisecond
            values = np.round((values - DAYS[unit]) * 86_400, 3)
            form = _DAY_NAMES[unit]
            times = pd.Series(values)
            unit = "s"
        factor = UNITS_NS[unit]
        bad = ~np.isnan(values) & ~(np.abs(values) < LARGEST_NS / factor)
        self.refuse(times, bad)
        usable = finite & ~bad
        since = np.full(len(values), pd.NaT.value, np.int64)
        if pd.api.types.is_integer_dtype(times.dtype):
            # integers keep their precision
            since[usable] = times[usable].to_numpy().astype(np.int64) * factor
        else:
            whole = np.floor(values[usable])
            since[usable] = whole.astype(np.int64) * factor + np.round(
                (values[usable] - whole) * factor
            ).astype(np.int64)
        is_epoch = bool(usable.any()) and bool(
            form or np.median(np.abs(values[usable])) * factor >= _YEARS_S[0] * 1e9
        )
        form = form or f"{UNITS[unit].split()[0]} since {'1970' if is_epoch else 'zero'}"
        stamps = pd.DatetimeIndex(since.view("datetime64[ns]")).tz_localize("UTC")
        return Times(stamps, bad, form, "UTC" if is_epoch else "none", not is_epoch)

    def of_text(self, cells: pd.Series, form: str | None, is_format: bool) -> Times:
        missing = is_missing(cells)
        given, text = (cells[~missing], cells.where(~missing)) if missing.any() else (cells, cells)
        if cells.dtype == object:
            # datetime is a subclass of date
            is_date = given.map(lambda cell: isinstance(cell, datetime.date | np.datetime64))
            if len(given) and is_date.all():
                aware = given.map(lambda cell: getattr(cell, "tzinfo", None) is not None).any()
                return self.of_dates(
                    pd.Series(pd.to_datetime(text, utc=bool(aware), errors="coerce"))
                )
            text = text.map(
                lambda cell: (
                    str(cell) if isinstance(cell, str | datetime.date | np.datetime64) else None
                )
            ).astype("str")
        if len(given) and not is_format:
            head = given.iloc[:20]
            found = None
            unit = form
            if parse_numbers(head, self.what, drop=True, units=False)[1].mean() <= 0.5:
                values, bad, _ = parse_numbers(cells, self.what, drop=True, units=False)
                # integer nanoseconds keep their precision
                exact = pd.to_numeric(cells.where(~missing), errors="coerce")
                found = exact if pd.api.types.is_integer_dtype(exact.dtype) else pd.Series(values)
            elif are_spans(text.dropna().str.strip()):
                spans = pd.to_timedelta(text, errors="coerce")
                found = spans.dt.total_seconds()
                bad = spans.isna().to_numpy() & ~missing
                unit = "s"
            if found is not None:
                self.refuse(cells, bad)
                times = self.of_numbers(found, unit)
                return dataclasses.replace(times, bad=times.bad | bad)
        forms = [form] if is_format else date_forms(text.dropna())
        if len(forms) > 1:
            raise InputError(
                "Expected dates whose day, month and year can be told apart. Received: "
                f"{format_cell(given.iloc[0])} in {self.what}.",
                [{"time_format": each} for each in forms],
            )
        return self._of_dates_as_text(cells, text, missing, forms[0] if forms else _ISO)

    def refuse_form(self, cells: pd.Series, bad: np.ndarray) -> None:
        """Refuses dates of an unknown form, unless bad ones are dropped."""
        cell = str(cells.iloc[int(np.argmax(bad))]).strip()
        if re.search(r"\d ?(?:[A-Z]{3,5}|\[[^]]*\])$", cell):
            known = "whose zone is an offset"
            otherwise = "the zone as an offset such as +01:00"
        elif re.match(r"\d\d?[/.-]\d\d? ", cell):
            known = "with a year"
            otherwise = "dates as 2024-01-31T12:00:00"
        else:
            known = "of a known form"
            otherwise = "their form with --time-format"
        self.refuse(cells, bad, otherwise, f"dates {known}")

    def _of_dates_as_text(
        self, cells: pd.Series, text: pd.Series, missing: np.ndarray, form: str
    ) -> Times:
        try:
            dates, zoned = _parse_dates(text, form)
        # an invalid format
        except (ValueError, TypeError, KeyError, IndexError, OverflowError, re.error):
            raise InputError(
                "Expected time_format as datetime.strptime takes it, such as '%d.%m.%y %H:%M:%S'. "
                f"Received: {form!r}."
            ) from None
        bad = dates.isna().to_numpy() & ~missing
        if 2 * bad.sum() >= len(bad) > 0:
            self.refuse_form(cells, bad)
        self.refuse(cells, bad)
        parsed = self.of_dates(dates)
        there = parsed.stamps.notna()
        is_zoned = bool(zoned[there].any())
        bare = np.flatnonzero(there & ~zoned)
        if is_zoned and len(bare):
            raise InputError(
                "Expected times of which all or none state a zone. Received: "
                f"{format_cell(cells.iloc[bare[0]])} at {self.places.of(bare[0])} of "
                f"{self.what}, without one among others with one. Complete them."
            )
        name = "ISO 8601 dates" if form == _ISO else f"dates of the form {form}"
        stamps = parsed.stamps.tz_localize("UTC") if is_zoned else parsed.stamps
        return Times(stamps, bad | parsed.bad, name, "stated, converted to UTC" if is_zoned else "")


def refuse_two_meanings(values: np.ndarray, what: str, is_date: bool = False) -> None:
    """Refuses numbers that may be seconds, or days, dates such as 20240301, decimal years, times of
    day such as 120059, or ms of a run.

    Days, of the years 1954 to 2119, are told by steps of whole or tenth seconds; `is_date` says
    that the column's name speaks of dates.
    """
    if len(values) < 2:
        return
    low = values.min()
    high = values.max()
    step = float(np.median(np.abs(np.diff(values))))
    found: dict[str, Sequence[str]] = {}  # the formats that a meaning has
    if 1900 <= low and high < 2100:
        found["decimal years"] = ()
    has_hours = 1e4 <= high or np.ptp(np.diff(values)) > 0  # 50 after 0, and 100 after 50, are none
    if has_hours and low // 100 < high // 100 and may_be_time_of_day(values):
        form = "%H%M" if high < 2_400 else "%H%M%S"
        found["times of day"] = (form + ".%f" * bool((values % 1).any()),)
    if 0 <= low < 1.2e9 and step >= 1_000 and step % 60 > 0:
        found["ms or us"] = ("ms", "us")
    if form := compact_form(values):
        found["dates"] = (form,)
    tenths = step * 864_000
    is_odd = (
        abs(step * 1000 - round(step * 1000)) > 1e-6 and abs(tenths - round(tenths)) < 0.01 * tenths
    )
    if (is_odd or is_date) and any(first <= low and high < last for first, last in _DAY_NUMBERS):
        since = {kind: (values[0] - zero) * 86_400 for kind, zero in DAYS.items()}
        days = [kind for kind, s in since.items() if _YEARS_S[0] < s < _YEARS_S[1]]
        begins = [f"{kind} from {pd.Timestamp(round(since[kind]), unit='s')}" for kind in days]
        found[f"days ({', '.join(begins)})"] = days or ["D"]
    for meaning, formats in found.items():
        raise InputError(
            f"Expected times whose unit is known. Received: {values[0]:.15g} to {values[-1]:.15g} "
            f"in {what}, which may be {meaning} or seconds.",
            [{"time_format": form} for form in (*formats, "s")],
            "the times as dates",
        )


def may_be_time_of_day(values: np.ndarray) -> bool:
    """Whether numbers may be times of day such as 1430 and 120059."""
    values = values[np.isfinite(values)]
    minutes = values // 100 % 100
    is_time = (values >= 0) & (values < 24e4) & (values % 100 < 60) & (minutes < 60)
    return bool(is_time.all()) and bool(values.max(initial=0) >= 100)


def compact_form(values: np.ndarray) -> str | None:
    """Returns the format of dates that are written as numbers, such as 20240301, or None."""
    if not len(values) or not (values % 1 == 0).all():
        return None
    text = pd.Series(values[:1_000].astype(np.int64).astype(str))
    for digits, form in _COMPACT.items():
        size = values / 10 ** (digits - 1)
        if ((1.9 <= size) & (size < 2.2)).all():
            is_date = pd.to_datetime(text, format=form, errors="coerce").notna().all()
            return form if is_date else None
    return None


def _infer_unit(values: np.ndarray, what: str) -> str:
    size = float(np.median(np.abs(values))) if len(values) else 0.0
    refuse_two_meanings(values, what)
    unit = "s" if size < _YEARS_S[0] else epoch_unit(size)
    if unit is not None:
        return unit
    raise InputError(
        f"Expected times in s, ms, us or ns since 1970. Received: numbers of about {size:.17g} in "
        f"{what}, which are not from 1980 to 2077 in any of these units.",
        [
            {"time_format": form}
            for form in ("ms", "us", "ns", "s")
            if size * UNITS_NS[form] < LARGEST_NS
        ],
        "the times as dates, if they count from 1601 or 1904",
    )


def epoch_unit(size: float) -> str | None:
    """Returns the unit in which a number is a time since 1970 from the years 1979 to 2077, or
    None.
    """
    # not .NET's steps of 100 ns since the year 1
    units = ("s", "ms", "us", "ns")[: 3 if 6.3e17 < size < 6.5e17 else 4]
    return next(
        (unit for unit in units if _YEARS_S[0] <= size * UNITS_NS[unit] / 1e9 <= _YEARS_S[1]), None
    )


def are_spans(text: pd.Series) -> bool:
    """Whether text without missing cells is time spans, or times of day that begin or end beyond
    24 h, as elapsed ones do.
    """
    head = text.iloc[:LOOK]
    if not head.str.fullmatch(TIME_OF_DAY).mean() > 0.5:
        return bool(head.str.fullmatch(DURATION).mean() > 0.5)
    return bool(text.iloc[[0, -1]].str.fullmatch(_ELAPSED).any())


def date_forms(text: pd.Series) -> list[str]:
    """Finds the forms in which text without missing cells may hold dates: formats as for
    `datetime.strptime`, or `_ISO`.

    None: the text is no dates. Two: day and month cannot be told apart.
    """
    head = _plain(text.iloc[:LOOK])
    dates = pd.to_datetime(head, format=_ISO, utc=True, errors="coerce")
    if dates.notna().mean() > 0.5:
        return [_ISO]
    for cell in head.iloc[:3]:  # the first cells may be damaged
        if found := _DAY_OF_YEAR.fullmatch(cell):
            return [f"%Y{found['mark']}%j{_end(found)}"]
        # 25.01.1706:12:01 is no year 1706
        if (found := _DAY_MONTH.fullmatch(cell)) and (found["letters"] or found["gap"] != ":"):
            mark = found["mark"]
            year = "%Y" if found["century"] else "%y"
            orders = [f"%d{mark}%b{mark}{year}"] if found["letters"] else _orders(text, mark, year)
            return [form + _end(found) for form in orders]
        if (found := _YEAR_FIRST.fullmatch(cell)) and found["half"]:
            return [f"%Y{found['mark']}%m{found['mark']}%d{_end(found)}"]
        form = guess_datetime_format(cell) if _GUESSED.search(cell) else None
        if form and "%Y" in form and "%d" in form:
            return [form]
    return []


def _orders(text: pd.Series, mark: str, year: str) -> list[str]:
    """Returns the orders of day, month and year that all dates allow; with points, the day comes
    first.
    """
    days = pd.Series(text.str[:12].unique(), dtype="str")  # far fewer than rows
    parts = days.str.extract(rf"^\s*(\d\d?)\{mark}(\d\d?)\{mark}(\d\d)").dropna().astype(int)
    orders = [("%d", "%m", year), ("%m", "%d", year), ("%y", "%m", "%d")]
    most = {"%m": 12, "%d": 31}
    possible = [
        mark.join(order)
        for order in orders[: 3 if year == "%y" else 2]
        if all(
            (kind in most) <= parts[place].max() <= most.get(kind, 99)
            for place, kind in enumerate(order)
        )
    ]
    return possible[:1] if mark == "." else possible


def _end(found: re.Match) -> str:
    """Returns the format of the time of day and the zone behind a date."""
    if not found["time"]:
        return ""
    form = "%I:%M" if found["half"] else "%H:%M"
    form += ":%S" if found["seconds"] else ""
    form += ".%f" if found["fraction"] else ""
    form += found["half"][:-2] + "%p" if found["half"] else ""
    zone = found["zone"] or ""
    return found["gap"] + form + zone[: zone.startswith(" ")] + ("%z" if zone else "")


def _plain(text: pd.Series) -> pd.Series:
    """Rewrites what no parser takes, see `_REWRITTEN`."""
    text = text.str.strip()
    for pattern, plain in _REWRITTEN.items():
        text = text.str.replace(pattern, plain, regex=True)
    return text


def _parse_dates(text: pd.Series, form: str) -> tuple[pd.Series, np.ndarray]:
    """Parses dates of one form; returns them in UTC, and which cells state a zone: by an offset
    behind a time of day, or by the format.
    """
    try:
        dates = pd.to_datetime(text, format=form, errors="coerce")
        is_mixed = False
    except ValueError:  # several offsets, or none in some cells
        dates = pd.to_datetime(text, format=form, utc=True, errors="coerce")
        is_mixed = True
    is_zoned = dates.dt.tz is not None
    dates = dates.dt.tz_convert(None) if is_zoned else dates
    left = (dates.isna() & text.notna()).to_numpy()
    if left.any():
        rest = _plain(text[left].astype(str))
        late = pd.to_timedelta(rest.str.contains(_MIDNIGHT).astype(int), unit="D")
        rest = rest.str.replace(_MIDNIGHT, "00", regex=True)
        whole = form.replace(".%f", "")
        for other in dict.fromkeys((form, whole, whole.replace("%S", "%S.%f"))):
            found = (
                pd.to_datetime(rest, format=other, utc=True, errors="coerce").dt.tz_localize(None)
                + late
            )
            # whole seconds and fractions have different units
            unit = np.promote_types(dates.dtype, found.dtype)
            dates = dates.astype(unit).fillna(found.astype(unit))
    if form != _ISO:
        return dates, np.full(len(text), "%z" in form or "%Z" in form)
    if not is_mixed and not left.any():
        return dates, np.full(len(text), is_zoned)
    zone = r"[T ]\d\d(?::?\d\d(?::?\d\d(?:[.,]\d+)?)?)?\s?(?:Z|UTC|GMT|[+-]\d\d(?::?\d\d)?)\s*$"
    return dates, text.str.contains(zone).fillna(False).to_numpy(bool)


def localize_times(stamps: pd.DatetimeIndex, zone: str) -> pd.DatetimeIndex:
    """Assigns a time zone to times without one; raises an `InputError` if it is unknown.

    Of an hour that a clock repeats in autumn, the order of the rows shows which is meant; where it
    does not, times become NaT. So do local times that do not exist.
    """
    try:
        local = stamps.tz_localize(zone, ambiguous="NaT", nonexistent="NaT")
    except (KeyError, IndexError, ValueError, TypeError, OSError):  # IndexError: an empty name
        raise InputError(
            f"Expected a time zone such as Europe/Berlin. Received: timezone={zone!r}. Name "
            "another."
        ) from None
    known = np.flatnonzero(stamps.notna())
    order = -1 if len(known) > 1 and stamps[known[0]] > stamps[known[-1]] else 1
    try:
        return stamps[::order].tz_localize(zone, ambiguous="infer", nonexistent="NaT")[::order]
    except ValueError:  # the order does not show it everywhere
        return local


def refuse_steps_back(
    times: np.ndarray, rows: np.ndarray, log: CleaningLog, has_zone: bool
) -> None:
    """Refuses times that step back where sorting would mix what happened at different times.

    These are times that count from zero and begin again, as after a restart, dates that go back
    over times that they have shown before, and, unless a zone is given or stated, dates that step
    back by about one hour only, as a local clock does, or by a day to where there were none, as
    where the date of the first day stays past midnight. `times` are nanoseconds in the order of the
    source, and `rows` their rows there.
    """
    steps = np.diff(times)
    if (steps > 0).all() or (steps < 0).all():
        return
    if np.median(steps) < 0:  # the latest comes first
        times, rows, steps = times[::-1], rows[::-1], -steps[::-1]
    hour = UNITS_NS["h"]
    options = [{"time": "none"}]
    otherwise = "the parts one by one"
    usual = np.median(np.abs(steps))
    back = np.flatnonzero(steps < 0)

    def are(step: int) -> bool:
        is_near = np.abs(steps[back] + step) < 2 * usual
        return 3 * usual <= step and len(back) > 0 and bool(is_near.all())

    if log.counts:
        late = 10 * usual  # a single late row is followed by as long a step forward
        back = np.flatnonzero(
            (steps[:-1] < -late)
            & (np.abs(steps[1:]) <= late)
            & (times[1:-1] <= np.minimum.accumulate(times)[:-2] + late)
        )
        how = "count from zero and begin again, as after a restart"
    else:
        is_change = are(hour)
        if usual >= hour / 2:  # a late row is no step back by an hour only on a Sunday morning
            changes = np.flatnonzero(np.abs(steps + hour - usual) <= 0.01 * usual)
            stamps = pd.DatetimeIndex(times[changes])
            changes = changes[(stamps.day_of_week == 6) & (stamps.hour <= 3) & (usual <= hour)]
            is_change = len(changes) > 0
            back = changes if is_change else back
        if is_change and not has_zone:
            how = "state no zone and repeat one hour, as local clocks do"
            options = [{"timezone": "UTC"}]
            otherwise = "the zone of the clock, as Europe/Berlin"
        elif are(UNITS_NS["D"]) and len(np.unique(times)) == len(times) and not has_zone:
            how = "step back by one day, as where a date stays past midnight"
            otherwise = "the right dates, or --timezone if these are right"
        elif (
            are(12 * hour)
            and not has_zone
            and pd.DatetimeIndex(times).hour.isin(range(1, 13)).all()
        ):
            how = "step back by half a day, as hours from 1 to 12 do"
            otherwise = "times with AM or PM"
        else:
            back = [] if is_change else jumps_back(times)
            how = "go back and cover the same time once more, as where a clock was set"
            otherwise += ", or same_time='last' if rows correct earlier ones" if has_zone else ""
    if len(back):
        raise ClockError(
            f"Expected ascending times. Received: times that {how}, at "
            f"{log.place(rows[back[0] + 1])} of {log.channel}.",
            options,
            otherwise,
        )


def jumps_back(times: np.ndarray) -> list[int]:
    """Returns the rows, at most `_MAX_JUMPS`, after which a clock goes back by far and runs on over
    times that it has shown before. `times` are nanoseconds in the order of the source.
    """
    steps = np.diff(times)
    jumps = np.flatnonzero(steps < -10 * np.median(np.abs(steps))) if len(steps) else steps
    if not 1 <= len(jumps) <= _MAX_JUMPS:
        return []
    again = []
    longest = 3 * np.median(np.abs(steps))
    before = times[:0]
    for first, jump, end in zip([-1, *jumps], jumps, [*jumps[1:], len(times) - 1], strict=False):
        run = times[jump + 1 : end + 1]
        # the earlier ones are in order already, so that this takes little time
        before = np.sort(np.concatenate([before, times[first + 1 : jump + 1]]), kind="stable")
        place = np.searchsorted(before, run, "right")
        inside = (place > 0) & (place < len(before))
        # a gap that is filled late was not shown before
        num_twice = (before[place[inside]] - before[place[inside] - 1] <= longest).sum()
        if num_twice > 10 and (np.diff(run) >= 0).mean() > 0.9:
            again.append(int(jump))
    return again if 2 * len(again) >= len(jumps) else []
