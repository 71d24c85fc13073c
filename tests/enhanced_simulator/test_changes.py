"""Tests that exactly the samples that a scenario has changed are marked, on random scenarios and an enhancer that spreads changes."""

import keras
import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.coarse_simulator.schedule import ScheduledMode, held_samples
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator.changes import TOLERANCE, blend_changes, spans
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.noise.surrogates import GaussianNoise

WINDOW, FADE = 64, 4
COARSE = SquareWaveSimulator([SquareWave(40, low=-0.5, high=0.5)])


@pytest.fixture(scope="module")
def spreading():
    """A simulator whose enhancer spreads every change over the whole window, with levels that change."""
    rng = np.random.default_rng(0)
    enhancer = keras.Sequential([keras.Input((WINDOW,)), keras.layers.Dense(WINDOW)])
    enhancer.layers[0].set_weights([np.eye(WINDOW) + 0.05 * rng.standard_normal((WINDOW, WINDOW)), np.zeros(WINDOW)])
    levels = np.stack([rng.normal(0, 1, 20), rng.uniform(0.8, 1.2, 20)], axis=1)
    return EnhancedSimulator(COARSE, enhancer, GaussianNoise(0.1, WINDOW), levels=levels)


def test_spans_and_blends_by_hand():
    changed = np.array([[0, 1, 0, 1, 0, 0], [0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]], bool)
    np.testing.assert_array_equal(spans(changed), [[0, 1, 1, 1, 0, 0], [0] * 6, [1, 0, 0, 0, 0, 0]])
    inside = np.array([[0, 0, 0, 1, 0, 0, 0]], bool)
    blended, mask = blend_changes(np.zeros((1, 7), np.float32), np.ones((1, 7), np.float32), inside, 1, 0.1)
    np.testing.assert_allclose(blended[0], [0, 0, 0.5, 1, 0.5, 0, 0])  # half-way at the sample on each side
    np.testing.assert_array_equal(mask[0], [0, 0, 1, 1, 1, 0, 0])
    blended, mask = blend_changes(np.zeros((1, 7), np.float32), np.ones((1, 7), np.float32), inside, 1, 0.6)
    np.testing.assert_array_equal(blended[0], [0, 0, 0, 1, 0, 0, 0])  # what is within the tolerance is removed
    np.testing.assert_array_equal(mask[0], blended[0] > 0)


def test_unmarked_samples_of_a_hundred_scenarios_equal_the_nominal_run(spreading):
    rng, tolerance = np.random.default_rng(1), TOLERANCE * spreading.noise_sd
    num_changed = 0
    for number in range(100):
        scenario = Degraded(list(MODES)[number % len(MODES)], rng.uniform(0.05, 1), rng.uniform(0, 0.95))
        nominal, clean = spreading.generate(8, None, number), spreading.generate_clean(8, None, number)
        ((windows, mask),) = spreading.generate_labelled_chunks(8, scenario, number)
        np.testing.assert_array_equal(windows, spreading.generate(8, scenario, number))
        np.testing.assert_array_equal(windows[~mask], nominal[~mask])
        assert (np.abs(spreading.generate_clean(8, scenario, number) - clean)[mask] > tolerance).all()
        coarse = spreading.generate_coarse(8, scenario, number) != spreading.generate_coarse(8, None, number)
        for marks, changed in zip(mask, coarse, strict=True):
            near = np.convolve(spans(changed[None])[0], np.ones(2 * FADE + 1), "same") > 0
            if scenario.mode == "stuck":
                begin, end = held_samples(scenario, WINDOW)
                near[begin:end] = True
            assert not marks[~near].any()  # at most a sixteenth of a window beyond the coarse change
            num_changed += marks.any()
    assert num_changed > 600


def test_unmarked_samples_of_random_series_equal_the_nominal_series(spreading):
    rng, modes = np.random.default_rng(2), list(MODES)
    for seed in range(20):
        schedule = [
            ScheduledMode(modes[rng.integers(6)], rng.uniform(0.2, 1), 40 + 200 * place + int(rng.integers(90)), int(rng.integers(1, 90)))
            for place in range(3)
        ]
        nominal = spreading.generate_series(700, None, seed)
        values, mask, events = spreading.generate_labelled_series(700, seed=seed, schedule=schedule)
        np.testing.assert_array_equal(values[~mask], nominal[~mask])
        assert (values[mask] != nominal[mask]).all()
        inside = np.zeros(700, bool)
        for event in schedule:
            inside[max(0, event.begin - FADE) : event.end + FADE] = True
        assert not mask[~inside].any()
        covered = np.zeros(700, bool)
        for mode, severity, onset, end in events:
            assert mask[onset] and mask[end - 1] and (mode, severity) in {(each.mode, each.severity) for each in schedule}
            covered[onset:end] = True
        assert covered[mask].all()


@pytest.mark.parametrize("severity", [0.05, 0.5, 1.0])
def test_a_stuck_mechanism_gives_still_telemetry_until_its_end(spreading, severity):
    scenario, tolerance = Degraded("stuck", severity, 0.25), TOLERANCE * spreading.noise_sd
    windows = spreading.generate_clean(20, scenario, 3)
    last = 16 + int(severity * 47)  # of 48 samples from the onset on, the first one is the one at which the mechanism stops
    assert held_samples(scenario, WINDOW) == (16, last + 1)
    assert np.abs(windows[:, 16 : last + 1] - windows[:, 16:17]).max() <= tolerance
    np.testing.assert_array_equal(windows[:, last + 1 :], spreading.generate_clean(20, None, 3)[:, last + 1 :])
    coarse, times = COARSE.simulate(np.arange(float(WINDOW))[None], scenario)[0], np.arange(WINDOW)
    assert len(set(coarse[16 : last + 1])) == 1 and (coarse[last + 1 :] == COARSE.simulate(times[None])[0, last + 1 :]).all()
    schedule = [ScheduledMode("stuck", severity, 100, 48), ScheduledMode("drift", 1.0, 300, 50)]
    without = EnhancedSimulator(COARSE, spreading.enhancer, GaussianNoise(0.0, WINDOW), levels=spreading.levels)
    values, mask, events = without.generate_labelled_series(500, seed=2, schedule=schedule)
    np.testing.assert_allclose(values[100 : last + 85], values[100], atol=2e-4)
    assert events[0][0] == "stuck" and events[0][3] <= last + 85 and not mask[last + 85 : 290].any()


def test_nominal_telemetry_has_no_marks(spreading):
    ((_, mask),) = spreading.generate_labelled_chunks(5, None, 1)
    _, marks, events = spreading.generate_labelled_series(300, seed=1)
    _, unchanged, none = spreading.generate_labelled_series(300, Degraded("stuck", 0.0), seed=1)
    assert not mask.any() and not marks.any() and not events and not unchanged.any() and not none
