"""Conversion between telemetry and pandas Series."""

import dataclasses
from collections.abc import Sequence

import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds

_NO_REPAIRS = Cleaning(max_fill=0, min_part=1, same_time="refuse")
_BREAKS = ("gaps", "clock steps")  # accepted by the cleaning, which splits the series there
_MAX_ROUNDING = 0.05  # largest distance of a time from the regular grid, in intervals: rounded times, or a rounded interval


def to_series(telemetry: Telemetry) -> pd.Series:
    """Converts telemetry to a pandas Series.

    Returns:
        The series, with a `DatetimeIndex` in UTC, or with a `RangeIndex` of sample numbers if the telemetry has no times. The
        unit is in `series.attrs["unit"]`.
    """
    check_telemetry(telemetry)
    if telemetry.has_time:
        index = pd.DatetimeIndex(nanoseconds(telemetry).astype("datetime64[ns]"), tz="UTC", name="time")
    else:
        first = round(telemetry.offset_s)
        index = pd.RangeIndex(first, first + len(telemetry), name="sample")
    series = pd.Series(telemetry.values, index=index, name=telemetry.name)
    series.attrs["unit"] = telemetry.unit
    return series


def index_of(parts: Sequence[Telemetry]) -> pd.Index:
    """Returns the index that the parts of a series have together, see `to_series`."""
    return pd.concat([to_series(part) for part in parts]).index


def from_series(series: pd.Series, unit: str | None = None) -> Telemetry:
    """Converts a regular pandas Series to telemetry.

    Args:
        series: Numbers with a regular `DatetimeIndex` or a `RangeIndex`. Times may be off the regular grid by a twentieth of
            the interval, as rounded times are.
        unit: Unit of the values. None: `series.attrs["unit"]`, or "1".

    Returns:
        The telemetry.

    Raises:
        InputError: If the series would need repairs. Use `clean` for such a series.
    """
    cleaned = clean(series, _NO_REPAIRS)
    for finding in cleaned.report.findings:
        is_rounding = finding.kind == "jitter" and finding.details["largest_s"] <= _MAX_ROUNDING * cleaned.report.interval_s
        if finding.kind in _BREAKS or not (finding.action == "accepted" or is_rounding):
            what = finding.line().removeprefix(f"{finding.action}: ")
            raise InputError(f"Expected a regular series. Received: {cleaned.report.channel} with {what}. Clean it first: clean(series).")
    (telemetry,) = cleaned.parts
    return telemetry if unit is None else dataclasses.replace(telemetry, unit=unit)
