"""Each measure and feature compared with a closed form, or with values computed by hand; two-sample tests with their definitions."""

import numpy as np
import pytest
import scipy.signal
import scipy.stats

from enhsim_tf.common import measures
from enhsim_tf.common.two_sample import two_sample_auc, window_features


def normal(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def autoregressive(num_windows, samples, coefficient, seed=0):
    """AR(1) windows of variance 1."""
    return scipy.signal.lfilter(
        [np.sqrt(1 - coefficient**2)],
        [1, -coefficient],
        normal(num_windows, samples + 50, seed=seed),
    )[:, 50:]


def test_nrmse_by_hand():
    truth = np.array([[0.0, 2.0], [4.0, 6.0]])  # standard deviation sqrt(5)
    assert measures.nrmse(truth, truth) == 0
    assert measures.nrmse(np.full((2, 2), 3.0), truth) == pytest.approx(1)  # the mean
    assert measures.nrmse(truth + [[1, 1], [-1, -3]], truth) == pytest.approx(np.sqrt(12 / 4 / 5))
    tiny = np.array([0, 2, 4, 6], np.float32) * np.float32(
        1e-25
    )  # squares are below what float32 can say
    assert measures.nrmse(tiny[::-1].copy(), tiny) == pytest.approx(2)


def test_roughness_in_closed_form():
    # a step of a sine of amplitude a and frequency f is a cosine of amplitude 2 a sin(pi f)
    time, amplitude, frequency = np.arange(401), 1.5, 3 / 40
    windows = amplitude * np.sin(2 * np.pi * frequency * time + np.array([[0.0], [1.0], [2.0]]))
    assert measures.roughness(windows) == pytest.approx(
        2 * amplitude * np.sin(np.pi * frequency) / np.sqrt(2)
    )
    assert measures.roughness(0.3 * normal(200, 500)) == pytest.approx(0.3 * np.sqrt(2), rel=0.02)
    assert measures.roughness(np.arange(10.0)[None]) == pytest.approx(0)


@pytest.mark.parametrize("directions", [1, 2, 7])
def test_effective_rank_counts_equal_directions(directions):
    basis = np.linalg.qr(normal(20, 20))[0][:directions]
    windows = np.arange(20) + 3 * np.concatenate([basis, -basis])  # the mean window does not count
    assert measures.effective_rank(windows) == pytest.approx(directions)


def test_effective_rank_in_closed_form():
    windows = np.array([[3.0, 0], [-3, 0], [0, 1], [0, -1]])  # energies 9 and 1: shares 0.9 and 0.1
    assert measures.effective_rank(windows) == pytest.approx(
        np.exp(-0.9 * np.log(0.9) - 0.1 * np.log(0.1))
    )
    # the eigenvalues of n samples over N windows follow Marchenko and Pastur's law, their entropy is log n - n / (2 N)
    assert measures.effective_rank(normal(400, 60)) == pytest.approx(
        60 * np.exp(-60 / (2 * 400)), rel=0.01
    )


@pytest.mark.filterwarnings("error")
def test_noise_that_does_not_vary_has_no_warning():
    assert measures.effective_rank(np.ones((5, 8))) == 1
    assert measures.scale_difference(np.zeros((5, 8)), normal(5, 8)) == np.inf
    assert measures.scale_difference(np.zeros((5, 8)), np.ones((5, 8))) == 0


def test_autocorrelation_by_hand_and_of_an_autoregressive_process():
    assert measures.autocorrelation(
        np.array([[1.0, -1, 1, -1], [-1, 1, -1, 1]]), 3
    ) == pytest.approx([1, -1, 1, -1])
    windows = np.array([[0.0, 1, 0, -1]]) + 3  # products at lag 2: 0 and -1; mean square 1/2
    assert measures.autocorrelation(windows, 2) == pytest.approx([1, 0, -1])
    assert measures.autocorrelation(autoregressive(400, 500, 0.8), 6) == pytest.approx(
        0.8 ** np.arange(7), abs=0.02
    )
    windows = np.array([[1.0, 2, 4], [-1, -2, -4]]) + 9
    assert measures.lagged_products(windows, 2) == pytest.approx(np.array([[7, 5, 4], [7, 5, 4]]))


@pytest.mark.parametrize("factor", [1.1, 2.0])
def test_scale_difference_is_the_logarithm_of_the_ratio(factor):
    windows = normal(20, 50)
    assert measures.scale_difference(windows, windows + 9) == pytest.approx(0)
    assert measures.scale_difference(factor * windows, windows) == pytest.approx(np.log(factor))
    assert measures.scale_difference(windows, factor * windows) == pytest.approx(np.log(factor))


def test_marginal_distance_of_a_shift_and_of_a_stretch():
    real, other = 2 * normal(400, 500), np.random.default_rng(5).standard_t(5, (60, 500))
    assert (
        measures.marginal_distance(real[::-1, ::-1], real) == 0
    )  # only the values count, not their order
    assert measures.marginal_distance(real + 0.6, real) == pytest.approx(0.6 / np.std(real))
    by_definition = scipy.stats.wasserstein_distance(other.ravel(), real[:60].ravel()) / np.std(
        real[:60]
    )
    assert measures.marginal_distance(other, real[:60]) == pytest.approx(by_definition, rel=0.005)
    # a Gaussian stretched by s is |s - 1| E|z| = |s - 1| sqrt(2 / pi) away
    assert measures.marginal_distance(1.5 * real, real) == pytest.approx(
        0.5 * np.sqrt(2 / np.pi), rel=0.01
    )


# -- features of windows ---------------------------------------------------------------------------------------------------


def test_features_of_a_window_worked_by_hand():
    window = np.array([[1.0, -1, 1, -1, 1, -1, 1, -1]])
    found = window_features(3 + 2 * window)[0, :6]
    assert found == pytest.approx(
        [3, np.log(2), 1 - 3, 5, np.log(np.std([-4, 4, -4, 4, -4, 4, -4])), -1]
    )


def test_features_of_white_noise_are_those_of_its_closed_form():
    mean, log_sd, kurtosis, _, log_steps, correlation = np.mean(
        window_features(0.5 * normal(400, 500))[:, :6], axis=0
    )
    assert [mean, log_sd, kurtosis, log_steps, correlation] == pytest.approx(
        [0, np.log(0.5), 0, np.log(0.5 * np.sqrt(2)), 0], abs=0.02
    )


def test_eight_bands_that_double_in_width():
    # a sine in the middle of each octave of 1 ... 250 cycles a window is strongest in the band of its octave
    cycles = np.array([1, 3, 6, 11, 23, 45, 90, 180])
    features = window_features(np.sin(2 * np.pi * cycles[:, None] / 500 * np.arange(500)))
    assert features.shape == (8, 14)
    assert np.argmax(features[:, 6:], axis=1).tolist() == list(range(8))
    assert np.isfinite(window_features(np.full((2, 500), 7.0, np.float32))).all()


# -- two-sample tests ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 3])
def test_two_samples_of_one_process_cannot_be_told_apart(seed):
    auc = two_sample_auc(normal(200, 100, seed=seed), normal(200, 100, seed=seed + 1), seed=0)
    assert auc == pytest.approx(
        0.5, abs=5 * np.sqrt(401 / (12 * 200**2))
    )  # standard error of the rank sum


def test_two_samples_of_two_processes_can_and_the_same_seed_says_the_same(refused):
    first, again = (
        two_sample_auc(autoregressive(100, 100, 0.7), normal(120, 100, seed=3), seed=0)
        for _ in range(2)
    )
    assert first > 0.98 and first == again
    with refused("10 windows"):
        two_sample_auc(normal(9, 100), normal(40, 100), seed=0)


def test_two_sample_folds_hold_out_neighbours():
    # stretches of ten windows at a level of their own, of either kind by chance: whoever met a neighbour in training
    # knows its level and so its kind
    levels = np.random.default_rng(0).permutation(40).reshape(2, 20)
    generated, real = (np.repeat(kind, 10)[:, None] + 0.01 * normal(200, 50) for kind in levels)
    assert two_sample_auc(generated, real, seed=0) < 0.75
