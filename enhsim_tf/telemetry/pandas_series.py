"""Telemetry as pandas Series."""

from collections.abc import Sequence

import pandas as pd

from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds


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
