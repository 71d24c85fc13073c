"""Estimates without a network: on pairs whose answer is known."""

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.baselines import nearest_window_means, ridge_aligned_by_its_shape, ridge_windows
from enhsim_tf.enhancer.ridge import fit_ridge, nearest_windows
from enhsim_tf.enhancer.training_pairs import Pairs, cut_pairs, window_errors
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts

COARSE = SquareWaveSimulator([SquareWave(period_s=100, low=-1.0, high=1.0)])


def _pairs():
    rng = np.random.default_rng(0)
    coarse, target = rng.standard_normal((2, 60, 5)).astype(np.float32)
    gain = np.where(np.arange(60) % 3, 2.0, 0.0)  # every third does not follow the simulator
    learnt = Pairs(coarse, target, rng.normal(size=60), gain, 20.0 * np.arange(60))
    return learnt, Pairs(coarse[:4] + 1, target[:4], np.arange(4.0), np.array([1.0, 2.0, 0.5, 1.0]), np.zeros(4))


@pytest.mark.parametrize(
    ("estimate", "plain"),
    [
        (ridge_windows, lambda inputs, outputs, starts, new: fit_ridge(inputs, outputs, starts).predict(new)),
        (nearest_window_means, lambda inputs, outputs, starts, new: nearest_windows(inputs, outputs, new, 30)),
    ],
)
def test_estimates_learn_from_windows_that_move_in_the_units_of_the_simulator(estimate, plain):
    learnt, new = _pairs()
    kept = learnt.gain > 0
    expected = plain(learnt.coarse[kept], ((learnt.target - learnt.shift[:, None]) / 2)[kept], 2 * np.arange(60)[kept] * 5, new.coarse)
    found = estimate(learnt, new, interval_s=2.0)
    np.testing.assert_allclose(found, new.shift[:, None] + new.gain[:, None] * expected, atol=1e-5)
    assert found.dtype == np.float32


def _drifting(ahead_s, num_samples=6_000, noise=0.1, seed=0):
    """Telemetry whose wave is a sine with a harmonic, ahead of the simulator by a time that wanders."""
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * (np.arange(num_samples) + ahead_s * np.sin(np.arange(num_samples) / 2_000)) / 100
    return Telemetry((3 + 2 * (np.sin(phase) + 0.4 * np.cos(2 * phase)) + noise * rng.standard_normal(num_samples)).astype(np.float32))


def test_its_own_shape_sets_the_clock_better_than_the_edges():
    train, test = _drifting(20), _drifting(20, seed=1)
    learnt, new = (
        cut_pairs([part], COARSE, evenly_spaced_starts([part], 100, number), 100, True) for part, number in ((train, 400), (test, 40))
    )
    by_edges = window_errors(ridge_windows(learnt, new, 1.0), new.target)
    by_shape = window_errors(ridge_aligned_by_its_shape(learnt, new, COARSE, 1.0), new.target)
    assert np.median(by_shape) < 1.5 * 0.1 / np.std(test.values), "near the noise"
    assert np.median(by_shape) < np.median(by_edges) / 3


def test_a_sum_of_waves_is_not_aligned_again():
    several = SquareWaveSimulator([SquareWave(period_s=100), SquareWave(period_s=37)])
    learnt, new = _pairs()
    np.testing.assert_array_equal(ridge_aligned_by_its_shape(learnt, new, several, 1.0), ridge_windows(learnt, new, 1.0))
