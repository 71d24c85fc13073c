"""Labelled series: labels agree with the generated data."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.label_columns import LABELS
from enhsim_tf.datasets.labelled_series import series_labelled
from enhsim_tf.telemetry.placing import PlacedEvent
from tests.known_simulators import of_waves

WINDOW = 60
COARSE = SquareWaveSimulator([SquareWave(48, low=-0.5, high=0.5)])


def known(*channels, interval_s=2.0):
    """A simulator of known processes: the coarse signal plus white noise."""
    return of_waves([COARSE] * len(channels), WINDOW, 0.1, interval_s, channels=channels)


VOLTS = known("volts")


def test_several_channels_have_columns_of_their_own(refused):
    both, drift = known("volts", "amps"), Degraded("drift", 1.0, 0.5, "amps")
    series = series_labelled(both, 300, drift, 4)
    assert list(series) == ["volts", "amps", *LABELS, "mask volts", "mask amps"]
    np.testing.assert_array_equal(
        series["mask"], series["amps"] != both.generate_series(300, None, 4)[:, 1]
    )
    with refused("volts, amps", "'watts'"):
        series_labelled(both, 300, Degraded("drift", 1.0, 0.5, "watts"))


def test_channels_named_like_labels_keep_their_values():
    names = ("mask", "severity", "mask mask", "time_s")
    made, drift = known(*names), Degraded("drift", 1.0, 0.5, "mask")
    frame = series_labelled(made, 300, drift, 4)
    columns = [f"{name} (channel)" for name in names]
    assert list(frame)[:4] == columns and len(set(frame.reset_index())) == 14
    values, masks, _ = made.generate_labelled_series(300, drift, 4)
    np.testing.assert_array_equal(frame[columns], values)
    np.testing.assert_array_equal(frame["mask"], masks.any(axis=1))
    np.testing.assert_array_equal(frame["mask mask"], masks[:, 0])


@pytest.mark.parametrize(
    "scenario", [None, Degraded("dropout", 0.7, 0.3), Degraded("stuck", 0.0)], ids=str
)
def test_a_series_equals_that_of_the_simulator(scenario):
    frame = series_labelled(VOLTS, 1_234, scenario, 9)
    assert list(frame.columns) == ["value", *LABELS] and frame.index.name == "time_s"
    np.testing.assert_array_equal(frame["value"], VOLTS.generate_series(1_234, scenario, 9)[:, 0])
    np.testing.assert_array_equal(frame.index, 2.0 * np.arange(1_234))
    nominal = VOLTS.generate_series(1_234, None, 9)[:, 0]
    mask = frame["value"].to_numpy() != nominal
    # 0.3 * 1234 = 370.2
    assert mask.any() == bool(scenario and scenario.severity) and not mask[:370].any()
    np.testing.assert_array_equal(frame["mask"], mask)
    np.testing.assert_array_equal(frame["scenario"] == "dropout", mask)
    np.testing.assert_array_equal(frame["scenario"] == "nominal", ~mask)
    np.testing.assert_allclose(frame["severity"], np.where(mask, 0.7, 0), rtol=1e-6)
    for name, value in (("onset", mask.argmax()), ("end", 1_234 - mask[::-1].argmax())):
        assert frame[name].isna().tolist() == (~mask).tolist()
        assert (frame[name][mask] == value).all()


def test_wrong_schedules_are_refused(refused):
    stuck = PlacedEvent("stuck", 1.0, 100, 100)
    for wrong in (
        [stuck, PlacedEvent("drift", 1.0, 200, 50)],  # touching
        [stuck, PlacedEvent("drift", 1.0, 150, 10)],  # overlapping
        [stuck, PlacedEvent("drift", 1.0, 950, 51)],  # beyond the end
        [PlacedEvent("rust", 1.0, 0, 5)],
        [PlacedEvent("stuck", 2.0, 0, 5)],
        [PlacedEvent("stuck", 1.0, -1, 5)],
        [PlacedEvent("stuck", 1.0, 0, 0)],
    ):
        with refused(wrong[-1].kind):
            series_labelled(VOLTS, 1_000, schedule=wrong)


def test_a_series_with_a_start_has_times():
    start = "2024-02-28T23:59:59"
    made = known("volts", interval_s=0.1)
    frame = series_labelled(made, 1_000, Degraded("stuck", 0.5, 0.5), 1, start)
    expected = pd.date_range(start, periods=1_000, freq="100ms", tz="UTC")
    assert (frame.index == expected).all()  # to the nanosecond
    assert str(frame.index.tz) == "UTC" and frame.index.name == "time"
