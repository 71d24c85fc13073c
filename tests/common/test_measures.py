"""Each measure and feature compared with a closed form, or with values computed by hand; two-sample
tests with their definitions.
"""

import numpy as np
import pytest
import scipy.signal
import scipy.stats

from enhsim_tf.common.measures import (
    autocorrelation,
    effective_rank,
    lagged_products,
    marginal_distance,
    nrmse,
    roughness,
    scale_difference,
)
from enhsim_tf.common.two_sample import two_sample_auc, window_features


def normal(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def autoregressive(num_windows, samples, coefficient, seed=0):
    """AR(1) windows of variance 1."""
    draws = np.sqrt(1 - coefficient**2) * normal(num_windows, samples + 50, seed=seed)
    return scipy.signal.lfilter([1], [1, -coefficient], draws)[:, 50:]


def test_nrmse_by_hand():
    truth = np.array([[0.0, 2.0], [4.0, 6.0]])  # standard deviation sqrt(5)
    assert nrmse(truth, truth) == 0
    assert nrmse(np.full((2, 2), 3.0), truth) == pytest.approx(1)  # the mean
    assert nrmse(truth + [[1, 1], [-1, -3]], truth) == pytest.approx(np.sqrt(12 / 4 / 5))
    # squares are below what float32 can say
    tiny = np.array([0, 2, 4, 6], np.float32) * np.float32(1e-25)
    assert nrmse(tiny[::-1].copy(), tiny) == pytest.approx(2)


def test_roughness_in_closed_form():
    # a step of a sine of amplitude a and frequency f is a cosine of amplitude 2 a sin(pi f)
    time, amplitude, frequency = np.arange(401), 1.5, 3 / 40
    windows = amplitude * np.sin(2 * np.pi * frequency * time + np.array([[0.0], [1.0], [2.0]]))
    assert roughness(windows) == pytest.approx(
        2 * amplitude * np.sin(np.pi * frequency) / np.sqrt(2)
    )


def test_effective_rank_in_closed_form():
    # energies 9 and 1: shares 0.9 and 0.1; the mean window does not count
    windows = np.array([[3.0, 0], [-3, 0], [0, 1], [0, -1]]) + [5, 7]
    expected = np.exp(-0.9 * np.log(0.9) - 0.1 * np.log(0.1))
    assert effective_rank(windows) == pytest.approx(expected)


@pytest.mark.filterwarnings("error")
def test_noise_that_does_not_vary_has_no_warning():
    assert effective_rank(np.ones((5, 8))) == 1
    assert scale_difference(np.zeros((5, 8)), normal(5, 8)) == np.inf
    assert scale_difference(np.zeros((5, 8)), np.ones((5, 8))) == 0


@pytest.mark.parametrize(
    ("windows", "expected"),
    [
        ([[1.0, -1, 1, -1], [-1, 1, -1, 1]], [1, -1, 1, -1]),
        ([[3.0, 4, 3, 2]], [1, 0, -1]),  # products at lag 2: 0 and -1; mean square 1/2
    ],
)
def test_autocorrelation_by_hand(windows, expected):
    found = autocorrelation(np.array(windows), len(expected) - 1)
    assert found == pytest.approx(expected)


def test_lagged_products_by_hand():
    windows = np.array([[1.0, 2, 4], [-1, -2, -4]]) + 9
    assert lagged_products(windows, 2) == pytest.approx(np.array([[7, 5, 4], [7, 5, 4]]))


@pytest.mark.parametrize("factor", [1.1, 2.0])
def test_scale_difference_is_the_logarithm_of_the_ratio(factor):
    windows = normal(20, 50)
    assert scale_difference(windows, windows + 9) == pytest.approx(0)
    assert scale_difference(factor * windows, windows) == pytest.approx(np.log(factor))
    assert scale_difference(windows, factor * windows) == pytest.approx(np.log(factor))


def test_marginal_distance_of_a_shift_and_by_definition():
    real, other = 2 * normal(60, 500), np.random.default_rng(5).standard_t(5, (60, 500))
    # only the values count, not their order
    assert marginal_distance(real[::-1, ::-1], real) == 0
    assert marginal_distance(real + 0.6, real) == pytest.approx(0.6 / np.std(real))
    by_definition = scipy.stats.wasserstein_distance(other.ravel(), real.ravel()) / np.std(real)
    assert marginal_distance(other, real) == pytest.approx(by_definition, rel=0.005)


# -- features of windows -------------------------------------------------------------------------


def test_features_of_a_window_worked_by_hand():
    window = np.array([[1.0, -1, 1, -1, 1, -1, 1, -1]])
    steps_sd = np.std([-4, 4, -4, 4, -4, 4, -4])
    expected = [3, np.log(2), 1 - 3, 5, np.log(steps_sd), -1]
    assert window_features(3 + 2 * window)[0, :6] == pytest.approx(expected)


def test_eight_bands_that_double_in_width():
    # a sine in the middle of each octave of 1 ... 250 cycles a window is strongest in the band of
    # its octave
    cycles = np.array([1, 3, 6, 11, 23, 45, 90, 180])
    features = window_features(np.sin(2 * np.pi * cycles[:, None] / 500 * np.arange(500)))
    assert features.shape == (8, 14)
    assert np.argmax(features[:, 6:], axis=1).tolist() == list(range(8))
    assert np.isfinite(window_features(np.full((2, 500), 7.0, np.float32))).all()


# -- two-sample tests ----------------------------------------------------------------------------


def test_two_samples_of_one_process_cannot_be_told_apart():
    auc = two_sample_auc(normal(200, 100, seed=1), normal(200, 100, seed=2), seed=0)
    # standard error of the rank sum
    assert auc == pytest.approx(0.5, abs=5 * np.sqrt(401 / (12 * 200**2)))


def test_two_samples_of_two_processes_can_and_the_same_seed_says_the_same(refused):
    first, again = (
        two_sample_auc(autoregressive(100, 100, 0.7), normal(120, 100, seed=3), seed=0)
        for _ in range(2)
    )
    assert first > 0.98 and first == again
    with refused("10 windows"):
        two_sample_auc(normal(9, 100), normal(40, 100), seed=0)


def test_two_sample_folds_hold_out_neighbours():
    # stretches of ten windows at a level of their own, of either kind by chance: whoever met a
    # neighbour in training knows its level and so its kind
    levels = np.random.default_rng(0).permutation(40).reshape(2, 20)
    generated, real = (np.repeat(kind, 10)[:, None] + 0.01 * normal(200, 50) for kind in levels)
    assert two_sample_auc(generated, real, seed=0) < 0.75
