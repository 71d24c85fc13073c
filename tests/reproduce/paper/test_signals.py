"""The ground truth is what its closed form says."""

import numpy as np
import pytest

from enhsim_tf.reproduce.paper.signals import sines


def test_sine_at_the_quarters_of_its_period():
    assert sines(np.array([0.0, 30.0, 60.0, 90.0, 120.0]), [120], [2.5]) == pytest.approx([0, 2.5, 0, -2.5, 0], abs=1e-12)


def test_sum_of_two_sines_at_a_time_worked_by_hand():
    # 40 s into periods of 480 s and 120 s: sin(30 degrees) / 2 + sin(120 degrees) / 4
    assert sines(np.array([40.0]), [480, 120], [0.5, 0.25]) == pytest.approx([0.25 + 0.25 * np.sqrt(3) / 2])


def test_mean_and_power_of_whole_periods():
    values = sines(np.arange(480.0), [480, 120], [0.5, 0.25])
    assert np.mean(values) == pytest.approx(0, abs=1e-12)
    assert np.mean(values**2) == pytest.approx(0.5**2 / 2 + 0.25**2 / 2)


def test_shape_of_the_times_is_kept():
    times = np.arange(12.0).reshape(3, 4)
    values = sines(times, [7], [1])
    assert values.shape == (3, 4) and values.dtype == np.float64
    assert (values.ravel() == sines(times.ravel(), [7], [1])).all()


def test_every_period_needs_its_amplitude():
    with pytest.raises(ValueError, match="shorter"):
        sines(np.arange(3.0), [480, 120], [0.5])
