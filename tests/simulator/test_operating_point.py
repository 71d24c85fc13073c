import numpy as np
import pytest

from enhsim_tf.simulator.operating_point import beyond, changed_properties, lasting


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ([0] * 20 + [1] * 80, 20),
        ([0] * 20 + [1] * 79, None),  # seven windows and nine tenths
        ([1] * 100, 0),
        ([1] + [0] * 19 + [1] * 80, 20),  # an alarm of one sample before
        ([0] * 10 + [1] * 70 + [0] * 20, None),  # it has gone back
        ([0] * 10 + ([1] * 9 + [0]) * 9, 10),  # nine tenths are flagged
    ],
)
def test_where_a_departure_begins_by_hand(flags, expected):
    flags = np.array(flags, bool)
    assert lasting(flags, np.ones(len(flags), bool), window=10) == expected


def test_samples_without_scores_do_not_count():
    flags, scored = np.zeros(200, bool), np.zeros(200, bool)
    flags[120:], scored[50:100], scored[110:] = True, True, True
    assert lasting(flags, scored, window=10) == 120


def waves(level=0.0, amplitude=1.0, period=20, relation=1.0, seed=0):
    rng = np.random.default_rng(seed)
    starts = rng.integers(0, 1_000, (50, 1))
    first = np.sin(2 * np.pi * (starts + np.arange(100)) / period)
    second = np.sin(2 * np.pi * (starts + rng.integers(0, period, (50, 1)) * (relation == 0) + np.arange(100)) / period)
    return level + amplitude * np.stack([first, second], axis=2) + 0.05 * rng.standard_normal((50, 100, 2))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"level": 1.0}, "level"),
        ({"amplitude": 2.0}, "amplitude"),
        ({"period": 10}, "period"),
        ({"relation": 0.0}, "channel relation"),
        ({}, "shape"),
    ],
)
def test_what_has_changed_is_named_first(change, expected):
    assert changed_properties(waves(), waves(**change, seed=1))[0] == expected


def test_windows_beyond_the_limits_are_marked():
    series = np.zeros((60, 1))
    series[40:] = 3.0
    limits = np.array([[-1.0], [0.0]]), np.array([[2.0], [2.0]])
    np.testing.assert_array_equal(np.flatnonzero(beyond(series, limits, 10)), np.arange(40, 60))
