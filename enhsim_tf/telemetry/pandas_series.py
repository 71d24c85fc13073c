"""Telemetry as pandas Series."""

from collections.abc import Sequence

import pandas as pd

from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds


def to_series(telemetry: Telemetry) -> pd.Series:
    """Converts telemetry to a pandas Series, with a `DatetimeIndex` in UTC, or a `RangeIndex` of sample numbers if it has no times."""
    check_telemetry(telemetry)
    if telemetry.has_time:
        index = pd.DatetimeIndex(
            nanoseconds(telemetry).astype("datetime64[ns]"), tz="UTC", name="time"
        )
    else:
        first = round(telemetry.offset_s)
        index = pd.RangeIndex(first, first + len(telemetry), name="sample")
    return pd.Series(telemetry.values, index=index, name=telemetry.name)


def index_of(parts: Sequence[Telemetry]) -> pd.Index:
    """Returns the index that the parts of a series have together, see `to_series`."""
    return pd.concat([to_series(part) for part in parts]).index
