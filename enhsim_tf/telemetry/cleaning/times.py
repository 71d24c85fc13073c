"""Parses a raw column as times: date-times, ISO 8601 text, other formats, numbers since 1970, time zones and clock changes.

An empty cell is a missing time. A cell that cannot be parsed either raises an `InputError` that names its row or is marked, so
that the caller can count it.
"""

import datetime
import re
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import column, format_cell, is_missing, is_text, parse_numbers
from enhsim_tf.telemetry.cleaning.report import CleaningLog, Finding, iso_time

UNITS_NS = {"D": 86_400 * 10**9, "h": 3_600 * 10**9, "min": 60 * 10**9, "s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_EPOCHS = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
_YEARS_S = (3.1e8, 4.2e9)  # seconds since 1970 in the years 1979 to 2103
_LARGEST_NS = 9.2e18  # limit of int64 nanoseconds since 1970: years 1678 to 2262


def parse_times(
    times: Any, what: str, drop: bool = False, unit: str | None = None, form: str | None = None
) -> tuple[pd.DatetimeIndex, np.ndarray, list[Finding]]:
    """Parses a column of times.

    Args:
        times: Date-times, ISO 8601 text, objects, time spans, or numbers counted from 1970 or from any other zero.
        what: Description of the source, for messages.
        drop: If True, a time that cannot be parsed is marked and treated as missing. If False, it raises an `InputError`.
        unit: Unit of numeric times, one of `UNITS_NS`. None: inferred from their magnitude.
        form: Format of text, as for `datetime.strptime`. None: ISO 8601.

    Returns:
        `(stamps, bad, findings)`: times with NaT where missing, in UTC if the source gives a time zone and without a zone
        otherwise; the mask of times that could not be parsed; and findings for the cleaning log.

    Raises:
        InputError: If the times cannot be parsed, or their unit cannot be inferred.
    """
    if unit is not None and unit not in UNITS_NS:
        raise InputError(f"Expected time_unit, one of: {', '.join(UNITS_NS)}. Received: time_unit={unit!r}.")
    if isinstance(times, pd.MultiIndex):
        raise InputError(f"Expected one time for a row. Received: an index of {times.nlevels} levels from {what}. Name one time column.")
    times = column(times, what)
    if isinstance(times.dtype, pd.PeriodDtype):
        times = (
            pd.to_datetime(times.astype(str).where(times.notna()), format="ISO8601", errors="coerce")
            if len(times)
            else times.astype(object)
        )
    kind = times.dtype
    if pd.api.types.is_datetime64_any_dtype(kind):
        return _times_from_dates(times, what, drop)
    if pd.api.types.is_timedelta64_dtype(kind):
        return _times_from_numbers(times.dt.total_seconds(), what, drop, "s")
    if pd.api.types.is_bool_dtype(kind) or not (pd.api.types.is_numeric_dtype(kind) or is_text(times)) or kind.kind == "c":
        raise InputError(f"Expected times as ISO 8601 date-times or seconds. Received: dtype {kind} from {what}. Name another time column.")
    if not is_text(times):
        return _times_from_numbers(times, what, drop, unit)
    cells = times.astype(object)
    missing = is_missing(cells)
    given = cells[~missing]
    if given.map(lambda cell: isinstance(cell, datetime.date | np.datetime64)).all():  # datetime is a subclass of date
        aware = given.map(lambda cell: getattr(cell, "tzinfo", None) is not None).any()
        dates = pd.to_datetime(cells.where(~missing), utc=bool(aware), errors="coerce")
        return _times_from_dates(pd.Series(dates), what, drop)
    if form is None and not parse_numbers(given.iloc[:1], what, drop=True)[1].any():  # if the first cell is a number, all may be
        values, bad, _ = parse_numbers(cells, what, drop=True)
        if not bad.any():
            exact = pd.to_numeric(cells.where(~missing), errors="coerce")  # integer nanoseconds keep their precision
            is_exact = pd.api.types.is_integer_dtype(exact.dtype)
            return _times_from_numbers(exact if is_exact else pd.Series(values), what, drop, unit)
    return _times_from_text(cells, missing, what, drop, form)


def _refuse_time(cells: pd.Series, bad: np.ndarray, what: str, then: str) -> None:
    row = int(np.argmax(bad))
    try:
        received = format_cell(cells.iloc[row])
    except (NotImplementedError, OverflowError, ValueError):  # the time is too far in the future or past to be converted to its zone
        received = "a time out of range"
    raise InputError(
        f"Expected times as ISO 8601 date-times or seconds. Received: {received} at row {row} of {what}, and "
        f"{int(bad.sum()) - 1:,} more. {then}, or leave them out with on_bad_times='drop' (--drop-bad)."
    )


def _times_from_dates(times: pd.Series, what: str, drop: bool) -> tuple[pd.DatetimeIndex, np.ndarray, list[Finding]]:
    stamps, findings = pd.DatetimeIndex(times), []
    if stamps.tz is not None:
        if str(stamps.tz) != "UTC":
            findings.append(Finding("time zone", len(stamps), f"times of the zone {stamps.tz}, converted to UTC: {len(stamps):,}"))
        stamps = stamps.tz_convert("UTC")
    coarse = stamps.tz_localize(None).to_numpy().astype("datetime64[s]").astype(np.int64)
    bad = stamps.notna() & (np.abs(coarse.astype(np.float64)) > _LARGEST_NS / 1e9)
    if bad.any() and not drop:
        _refuse_time(times, bad, what, "Give times from 1678 to 2261")
    return stamps.where(~bad).as_unit("ns"), bad, findings


def _times_from_numbers(times: pd.Series, what: str, drop: bool, unit: str | None) -> tuple[pd.DatetimeIndex, np.ndarray, list[Finding]]:
    values = times.to_numpy(np.float64, na_value=np.nan)
    finite = np.isfinite(values)
    unit = unit or _infer_unit(values[finite], what)
    factor = UNITS_NS[unit]
    bad = ~np.isnan(values) & ~(np.abs(values) < _LARGEST_NS / factor)
    if bad.any() and not drop:
        _refuse_time(times, bad, what, "Correct them or name another time column")
    usable = finite & ~bad
    since = np.full(len(values), pd.NaT.value, np.int64)
    if pd.api.types.is_integer_dtype(times.dtype):
        since[usable] = times[usable].to_numpy().astype(np.int64) * factor  # integers keep their precision
    else:
        whole = np.floor(values[usable])
        since[usable] = whole.astype(np.int64) * factor + np.round((values[usable] - whole) * factor).astype(np.int64)
    findings = []
    if usable.any():
        is_epoch = np.median(np.abs(values[usable])) * factor >= _YEARS_S[0] * 1e9
        name = _EPOCHS.get(unit, unit)
        text = f"times are numbers: {name} since 1970, the first is {iso_time(since[usable][0])}" if is_epoch else f"times count {name}"
        findings.append(Finding("time unit", int(usable.sum()), text, details={"unit": unit}))
    return pd.DatetimeIndex(since.view("datetime64[ns]")).tz_localize("UTC"), bad, findings


def _infer_unit(values: np.ndarray, what: str) -> str:
    size = float(np.median(np.abs(values))) if len(values) else 0.0
    if len(values) and (values == np.floor(values)).all():
        for digits, form in ((8, "%Y%m%d"), (14, "%Y%m%d%H%M%S")):
            if 1.9 * 10 ** (digits - 1) <= values.min() and values.max() < 2.2 * 10 ** (digits - 1):
                text = pd.Series(values[:1_000].astype(np.int64).astype(str))
                if pd.to_datetime(text, format=form, errors="coerce").notna().all():
                    raise InputError(
                        f"Expected dates as text or times as numbers. Received: {text.iloc[0]} in {what}, which reads as both. "
                        f"Give time_format='{form}', or time_unit='s'."
                    )
    for unit in _EPOCHS:
        low, high = (bound * 1e9 / UNITS_NS[unit] for bound in _YEARS_S)
        if (unit == "s" and size < low) or low <= size <= high:
            return unit
    raise InputError(
        f"Expected times in s, ms, us or ns since 1970. Received: numbers of about {size:g} in {what}, which are not from 1980 to 2100 in any of these units. "
        "Give time_unit."
    )


def _times_from_text(
    cells: pd.Series, missing: np.ndarray, what: str, drop: bool, form: str | None
) -> tuple[pd.DatetimeIndex, np.ndarray, list[Finding]]:
    findings = []
    text = cells.where(~missing).map(lambda cell: str(cell) if isinstance(cell, str | datetime.date | np.datetime64) else None)
    of_text = text.map(lambda cell: isinstance(cell, str)).to_numpy(bool)
    words = text[of_text].astype(str).str.strip()
    leap, zoned = np.zeros((2, len(cells)), bool)
    leap[of_text] = words.str.contains(r":\d\d:60")
    zoned[of_text] = words.str.contains(r"(?:Z|[+-]\d\d:?\d\d)$")
    text[of_text] = words.str.replace(r"(:\d\d):60", r"\1:59", regex=True)
    try:
        stamps = pd.to_datetime(text, utc=True, format=form or "ISO8601", errors="coerce")
    except (ValueError, TypeError, KeyError, IndexError, OverflowError, re.error):  # an invalid format
        raise InputError(f"Expected time_format as datetime.strptime takes it, such as '%d.%m.%y %H:%M:%S'. Received: {form!r}.") from None
    bad = (stamps.isna() & ~missing).to_numpy(bool)
    if bad.any() and not drop:
        _refuse_time(cells, bad, what, f"Give time_format (such as {'%d.%m.%y %H:%M:%S'!r}) or name another time column")
    stamps, too_far, _ = _times_from_dates(stamps, what, drop)
    stamps = stamps + pd.to_timedelta(leap.astype(np.int64), unit="s").as_unit("ns")
    if leap.any():
        rows = tuple(f"row {row}" for row in np.flatnonzero(leap)[:3])
        findings.append(Finding("leap seconds", int(leap.sum()), f"leap seconds, taken as the following second: {leap.sum():,}", rows))
    given = zoned[~missing & ~bad]
    aware = given.any()
    if aware and not given.all():
        findings.append(
            Finding("time zone", int((~given).sum()), f"times without a zone among others with one, taken as UTC: {(~given).sum():,}")
        )
    if not aware and not (form and "%z" in form):
        stamps = stamps.tz_localize(None)
    return stamps, bad | too_far, findings


def localize_times(stamps: pd.DatetimeIndex, zone: str) -> pd.DatetimeIndex:
    """Assigns a time zone to local times.

    Local times that do not exist because of a clock change become NaT. So do times that occur twice, if the order of the rows does
    not show which one is meant.

    Args:
        stamps: Times without a zone.
        zone: Name of the time zone.

    Returns:
        Times with the zone.

    Raises:
        InputError: If the time zone is unknown.
    """
    try:
        try:
            return stamps.tz_localize(zone, ambiguous="infer", nonexistent="NaT")
        except ValueError:  # the order of the rows does not resolve the repeated hour
            return stamps.tz_localize(zone, ambiguous="NaT", nonexistent="NaT")
    except (KeyError, ValueError, TypeError, OSError):
        raise InputError(f"Expected a time zone such as Europe/Berlin. Received: timezone={zone!r}. Name another.") from None


def refuse_repeated_local_hour(times: np.ndarray, numbers: np.ndarray, log: CleaningLog, name: str) -> None:
    """Checks for times that a local clock repeats when it is set back by one hour.

    Without a time zone, sorting by time would mix the two hours.

    Args:
        times: Times in nanoseconds, int64, in the order of the source.
        numbers: Source row of each time.
        log: The cleaning log, which describes the place for the message.
        name: Channel name, for the message.

    Raises:
        InputError: If times step back, and every step back is about one hour.
    """
    steps = np.diff(times)
    usual = np.median(np.abs(steps)) if len(steps) else 0
    back = np.flatnonzero(steps < 0)
    hour = UNITS_NS["h"]
    if len(back) and usual < hour / 2 and (np.abs(steps[back] + hour) <= 2 * usual).all():
        place = log.place(numbers[back[0] + 1])
        raise InputError(
            f"Expected ascending times, or their time zone. Received: times without a zone that step back by one hour at {place} of {name}, "
            "as local clocks do. Give timezone (such as 'Europe/Berlin', or 'UTC' to take them as they are)."
        )
