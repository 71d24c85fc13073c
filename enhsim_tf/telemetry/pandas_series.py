"""Telemetry as pandas objects."""

import pandas as pd

from enhsim_tf.telemetry.series import Telemetry, check_telemetry


def to_series(telemetry: Telemetry) -> pd.Series | pd.DataFrame:
    """Converts telemetry to a pandas Series, of several channels to a DataFrame, with a
    `DatetimeIndex` in UTC, or a `RangeIndex` of sample numbers if it has no times.
    """
    check_telemetry(telemetry)
    frame = pd.DataFrame(telemetry.values, telemetry.index, list(telemetry.columns))
    return frame if len(telemetry.columns) > 1 else frame.iloc[:, 0]
