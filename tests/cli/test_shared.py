"""Tests of what the commands share."""

import numpy as np
import pandas as pd

from enhsim_tf.cli.shared import cleaned_channels
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.sources import read_source


def test_samples_at_which_another_channel_has_none_are_reported():
    times = pd.date_range("2024-03-01", periods=100, freq="s")
    table = pd.DataFrame(
        {"time": times, "volts": np.sin(np.arange(100.0)), "amps": np.arange(100.0) ** 2}
    )
    table.loc[80:, "amps"] = np.nan
    (telemetry,), reports = cleaned_channels(read_source(table), Cleaning(), None)
    assert len(telemetry) == 80
    assert reports["volts"].find("other channels").count == 20
    assert reports["amps"].find("other channels") is None
