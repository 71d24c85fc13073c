from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.simulator.operating_point import beyond, changed_properties, find_departure, lasting


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


def departed(level, amplitude, scored):
    """Forty nominal periods of 20 samples, then forty with another level and amplitude, in two stretches; what `find_departure` says."""
    wave = np.sin(2 * np.pi * np.arange(800) / 20)
    series = np.concatenate([wave, level + amplitude * wave]).astype(np.float32)[:, None]
    nominal = series[:800]
    simulator = SimpleNamespace(window=20, nominal=nominal, nominal_run=None, judged_series=lambda telemetry, run: [telemetry])
    scores = np.where(np.arange(1_600) < 800, 0.5, scored)
    return find_departure(simulator, lambda moved: moved[:, 0], scores, [(0, series[:1_000]), (1_000, series[1_000:])]), wave


def test_scores_after_a_departure_are_those_of_telemetry_moved_back():
    found, wave = departed(level=3.0, amplitude=2.0, scored=2.0)
    assert found.begin == 790, "half of the window that begins there has the other level"
    assert set(found.what) == {"level", "amplitude"}
    np.testing.assert_allclose(found.scores[:790], 0.5)
    np.testing.assert_allclose(found.scores[800:], wave, atol=1e-5)  # the score here is the telemetry itself


# windows of nominal telemetry all have the level 0 and the standard deviation .707, of which a tenth is allowed on each side
@pytest.mark.parametrize(
    ("level", "amplitude", "begin"),
    [(0.07, 1.0, None), (-0.07, 1.0, None), (0.08, 1.0, 800), (-0.08, 1.0, 800), (0.0, 1.09, None), (0.0, 1.12, 800), (0.0, 0.88, 800)],
)
def test_telemetry_that_is_not_flagged_has_left_beyond_a_tenth_of_its_amplitude(level, amplitude, begin):
    found, _ = departed(level, amplitude, scored=0.5)
    assert (found and found.begin) == begin


def test_a_simulator_without_nominal_telemetry_names_the_shape():
    simulator, scores = SimpleNamespace(window=20, nominal=None), np.repeat([0.5, 2.0], 400)
    found = find_departure(simulator, None, scores, [(0, np.zeros((800, 1)))])
    assert (found.begin, found.what) == (400, ("shape",))
    np.testing.assert_array_equal(found.scores, scores)
