"""Each measure against a closed form or windows worked by hand."""

import numpy as np
import pytest

from enhsim_tf import fidelity


def normal(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def autoregressive(num_windows, samples, coefficient, seed=0):
    """AR(1) windows of variance 1."""
    innovations = normal(num_windows, samples, seed=seed)
    values = innovations.copy()
    for sample in range(1, samples):
        values[:, sample] = coefficient * values[:, sample - 1] + np.sqrt(1 - coefficient**2) * innovations[:, sample]
    return values


def test_nrmse_by_hand():
    truth = np.array([[0.0, 2.0], [4.0, 6.0]])  # standard deviation sqrt(5)
    assert fidelity.nrmse(truth, truth) == 0
    assert fidelity.nrmse(np.full((2, 2), 3.0), truth) == pytest.approx(1)  # the mean
    assert fidelity.nrmse(truth + [[1, 1], [-1, -3]], truth) == pytest.approx(np.sqrt(12 / 4 / 5))


def test_nrmse_of_a_small_unit_in_float32():
    truth = np.array([0, 2, 4, 6], np.float32) * np.float32(1e-25)  # squares are below what float32 can say
    assert fidelity.nrmse(truth[::-1].copy(), truth) == pytest.approx(2)


def test_roughness_of_a_sine():
    # a step of a sine of amplitude a and frequency f is a cosine of amplitude 2 a sin(pi f)
    time, amplitude, frequency = np.arange(401), 1.5, 3 / 40
    windows = amplitude * np.sin(2 * np.pi * frequency * time + np.array([[0.0], [1.0], [2.0]]))
    assert fidelity.roughness(windows) == pytest.approx(2 * amplitude * np.sin(np.pi * frequency) / np.sqrt(2))


def test_roughness_of_white_noise_and_of_a_ramp():
    assert fidelity.roughness(0.3 * normal(200, 500)) == pytest.approx(0.3 * np.sqrt(2), rel=0.02)
    assert fidelity.roughness(np.arange(10.0)[None]) == pytest.approx(0)


@pytest.mark.parametrize("directions", [1, 2, 7])
def test_effective_rank_counts_equal_directions(directions):
    basis = np.linalg.qr(normal(20, 20))[0][:directions]
    windows = np.arange(20) + 3 * np.concatenate([basis, -basis])  # the mean window does not count
    assert fidelity.effective_rank(windows) == pytest.approx(directions)


def test_effective_rank_of_two_unequal_directions():
    # energies 9 and 1: shares 0.9 and 0.1
    windows = np.array([[3.0, 0], [-3, 0], [0, 1], [0, -1]])
    assert fidelity.effective_rank(windows) == pytest.approx(np.exp(-0.9 * np.log(0.9) - 0.1 * np.log(0.1)))


def test_effective_rank_of_white_noise():
    # the eigenvalues of n samples over N windows follow Marchenko and Pastur's law, their entropy is log n - n / (2 N)
    samples, num_windows = 60, 400
    expected = samples * np.exp(-samples / (2 * num_windows))
    assert fidelity.effective_rank(normal(num_windows, samples)) == pytest.approx(expected, rel=0.01)


def test_autocorrelation_by_hand():
    windows = np.array([[1.0, -1, 1, -1], [-1, 1, -1, 1]])
    assert fidelity.autocorrelation(windows, 3) == pytest.approx([1, -1, 1, -1])
    windows = np.array([[0.0, 1, 0, -1]]) + 3  # products at lag 2: 0 and -1; mean square 1/2
    assert fidelity.autocorrelation(windows, 2) == pytest.approx([1, 0, -1])


def test_autocorrelation_of_an_autoregressive_process():
    measured = fidelity.autocorrelation(autoregressive(400, 500, 0.8), 6)
    assert measured == pytest.approx(0.8 ** np.arange(7), abs=0.02)
    assert measured[0] == 1


def test_scale_difference_is_the_logarithm_of_the_ratio():
    windows = normal(20, 50)
    assert fidelity.scale_difference(windows, windows + 9) == pytest.approx(0)
    for factor in (1.1, 2.0):
        assert fidelity.scale_difference(factor * windows, windows) == pytest.approx(np.log(factor))
        assert fidelity.scale_difference(windows, factor * windows) == pytest.approx(np.log(factor))


def test_marginal_distance_of_a_shift_and_of_a_stretch():
    real = 2 * normal(400, 500)
    assert fidelity.marginal_distance(real[::-1, ::-1], real) == 0  # only the values count, not their order
    assert fidelity.marginal_distance(real + 0.6, real) == pytest.approx(0.6 / np.std(real))
    assert fidelity.marginal_distance(0.6 + 2 * normal(400, 500, seed=1), real) == pytest.approx(0.3, abs=0.01)
    # a Gaussian stretched by s is |s - 1| E|z| = |s - 1| sqrt(2 / pi) away
    assert fidelity.marginal_distance(1.5 * real, real) == pytest.approx(0.5 * np.sqrt(2 / np.pi), rel=0.01)


@pytest.mark.parametrize("samples", [128, 129])
def test_power_spectrum_of_white_noise_is_flat(samples):
    spectrum = fidelity.power_spectrum(0.5 * normal(2_000, samples))
    assert spectrum.shape == (samples // 2,)
    assert np.mean(spectrum) == pytest.approx(0.25, rel=0.01)
    assert spectrum == pytest.approx(np.full(samples // 2, 0.25), rel=5 * np.sqrt(2 / 2_000))


def test_power_spectrum_of_a_sine_peaks_at_its_frequency():
    windows = np.sin(2 * np.pi * 17 / 200 * np.arange(200) + np.array([[0.0], [1.0]]))
    spectrum = fidelity.power_spectrum(windows)
    assert np.argmax(spectrum) + 1 == 17  # the zero frequency is left out
    assert spectrum[14:19].sum() == pytest.approx(spectrum.sum(), rel=1e-3)


def test_features_of_a_window_worked_by_hand():
    window = np.array([[1.0, -1, 1, -1, 1, -1, 1, -1]])
    mean, log_sd, kurtosis, highest, log_steps, correlation = fidelity.window_features(3 + 2 * window)[0, :6]
    assert (mean, highest) == (3, 5)
    assert log_sd == pytest.approx(np.log(2))
    assert kurtosis == pytest.approx(1 - 3)
    assert log_steps == pytest.approx(np.log(np.std([-4, 4, -4, 4, -4, 4, -4])))
    assert correlation == pytest.approx(-1)


def test_features_of_white_noise_are_those_of_its_closed_form():
    features = fidelity.window_features(0.5 * normal(400, 500))
    expected = [0, np.log(0.5), 0, None, np.log(0.5 * np.sqrt(2)), 0]
    for column, value in enumerate(expected):
        if value is not None:
            assert np.mean(features[:, column]) == pytest.approx(value, abs=0.02)


def test_eight_bands_that_double_in_width():
    # a sine in the middle of each octave of 1 ... 250 cycles a window is strongest in the band of its octave
    cycles = np.array([1, 3, 6, 11, 23, 45, 90, 180])
    windows = np.sin(2 * np.pi * cycles[:, None] / 500 * np.arange(500))
    features = fidelity.window_features(windows)
    assert features.shape == (8, 14)
    assert np.argmax(features[:, 6:], axis=1).tolist() == list(range(8))


def test_features_of_a_window_that_stands_still_are_finite():
    assert np.isfinite(fidelity.window_features(np.full((2, 500), 7.0, np.float32))).all()


@pytest.mark.parametrize("seed", [1, 3])
def test_two_samples_of_one_process_cannot_be_told_apart(seed):
    auc = fidelity.two_sample_auc(normal(200, 100, seed=seed), normal(200, 100, seed=seed + 1), seed=0)
    assert auc == pytest.approx(0.5, abs=5 * np.sqrt(401 / (12 * 200**2)))  # standard error of the rank sum


def test_two_samples_of_two_processes_can_and_the_same_seed_says_the_same():
    first, again = (fidelity.two_sample_auc(autoregressive(100, 100, 0.7), normal(120, 100, seed=3), seed=0) for _ in range(2))
    assert first > 0.98 and first == again


def test_two_sample_folds_hold_out_neighbours():
    # stretches of ten windows at a level of their own, of either kind by chance: whoever met a neighbour in training
    # knows its level and so its kind
    levels = np.random.default_rng(0).permutation(40).reshape(2, 20)
    generated, real = (np.repeat(kind, 10)[:, None] + 0.01 * normal(200, 50) for kind in levels)
    assert fidelity.two_sample_auc(generated, real, seed=0) < 0.75


def test_two_sample_auc_refuses_too_few_windows(refused):
    with refused("10 windows"):
        fidelity.two_sample_auc(normal(9, 100), normal(40, 100), seed=0)
