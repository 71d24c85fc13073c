"""Each measure compared with a closed form, or with values computed by hand."""

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

from enhsim_tf.common import measures
from studies.robustness import distances


def normal(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def autoregressive(num_windows, samples, coefficient, seed=0):
    """AR(1) windows of variance 1."""
    innovations = normal(num_windows, samples, seed=seed)
    values = innovations.copy()
    for sample in range(1, samples):
        values[:, sample] = coefficient * values[:, sample - 1] + np.sqrt(1 - coefficient**2) * innovations[:, sample]
    return values


def windows_of_t(num_windows, seed=5):
    return np.random.default_rng(seed).standard_t(5, (num_windows, 500))


def test_nrmse_by_hand():
    truth = np.array([[0.0, 2.0], [4.0, 6.0]])  # standard deviation sqrt(5)
    assert measures.nrmse(truth, truth) == 0
    assert measures.nrmse(np.full((2, 2), 3.0), truth) == pytest.approx(1)  # the mean
    assert measures.nrmse(truth + [[1, 1], [-1, -3]], truth) == pytest.approx(np.sqrt(12 / 4 / 5))


def test_nrmse_of_a_small_unit_in_float32():
    truth = np.array([0, 2, 4, 6], np.float32) * np.float32(1e-25)  # squares are below what float32 can say
    assert measures.nrmse(truth[::-1].copy(), truth) == pytest.approx(2)


def test_roughness_of_a_sine():
    # a step of a sine of amplitude a and frequency f is a cosine of amplitude 2 a sin(pi f)
    time, amplitude, frequency = np.arange(401), 1.5, 3 / 40
    windows = amplitude * np.sin(2 * np.pi * frequency * time + np.array([[0.0], [1.0], [2.0]]))
    assert measures.roughness(windows) == pytest.approx(2 * amplitude * np.sin(np.pi * frequency) / np.sqrt(2))


def test_roughness_of_white_noise_and_of_a_ramp():
    assert measures.roughness(0.3 * normal(200, 500)) == pytest.approx(0.3 * np.sqrt(2), rel=0.02)
    assert measures.roughness(np.arange(10.0)[None]) == pytest.approx(0)


@pytest.mark.parametrize("directions", [1, 2, 7])
def test_effective_rank_counts_equal_directions(directions):
    basis = np.linalg.qr(normal(20, 20))[0][:directions]
    windows = np.arange(20) + 3 * np.concatenate([basis, -basis])  # the mean window does not count
    assert measures.effective_rank(windows) == pytest.approx(directions)


def test_effective_rank_of_two_unequal_directions():
    # energies 9 and 1: shares 0.9 and 0.1
    windows = np.array([[3.0, 0], [-3, 0], [0, 1], [0, -1]])
    assert measures.effective_rank(windows) == pytest.approx(np.exp(-0.9 * np.log(0.9) - 0.1 * np.log(0.1)))


@pytest.mark.filterwarnings("error")
def test_noise_that_does_not_vary_has_no_warning():
    assert measures.effective_rank(np.ones((5, 8))) == 1
    assert measures.scale_difference(np.zeros((5, 8)), normal(5, 8)) == np.inf
    assert measures.scale_difference(np.zeros((5, 8)), np.ones((5, 8))) == 0


def test_effective_rank_of_white_noise():
    # the eigenvalues of n samples over N windows follow Marchenko and Pastur's law, their entropy is log n - n / (2 N)
    samples, num_windows = 60, 400
    expected = samples * np.exp(-samples / (2 * num_windows))
    assert measures.effective_rank(normal(num_windows, samples)) == pytest.approx(expected, rel=0.01)


def test_autocorrelation_by_hand():
    windows = np.array([[1.0, -1, 1, -1], [-1, 1, -1, 1]])
    assert measures.autocorrelation(windows, 3) == pytest.approx([1, -1, 1, -1])
    windows = np.array([[0.0, 1, 0, -1]]) + 3  # products at lag 2: 0 and -1; mean square 1/2
    assert measures.autocorrelation(windows, 2) == pytest.approx([1, 0, -1])


def test_autocorrelation_of_an_autoregressive_process():
    measured = measures.autocorrelation(autoregressive(400, 500, 0.8), 6)
    assert measured == pytest.approx(0.8 ** np.arange(7), abs=0.02)
    assert measured[0] == 1


def test_scale_difference_is_the_logarithm_of_the_ratio():
    windows = normal(20, 50)
    assert measures.scale_difference(windows, windows + 9) == pytest.approx(0)
    for factor in (1.1, 2.0):
        assert measures.scale_difference(factor * windows, windows) == pytest.approx(np.log(factor))
        assert measures.scale_difference(windows, factor * windows) == pytest.approx(np.log(factor))


def test_marginal_distance_of_a_shift_and_of_a_stretch():
    real = 2 * normal(400, 500)
    assert measures.marginal_distance(real[::-1, ::-1], real) == 0  # only the values count, not their order
    assert measures.marginal_distance(real + 0.6, real) == pytest.approx(0.6 / np.std(real))
    assert measures.marginal_distance(0.6 + 2 * normal(400, 500, seed=1), real) == pytest.approx(0.3, abs=0.01)
    by_definition = scipy.stats.wasserstein_distance(windows_of_t(60).ravel(), real[:60].ravel()) / np.std(real[:60])
    assert measures.marginal_distance(windows_of_t(60), real[:60]) == pytest.approx(by_definition, rel=0.005)
    # a Gaussian stretched by s is |s - 1| E|z| = |s - 1| sqrt(2 / pi) away
    assert measures.marginal_distance(1.5 * real, real) == pytest.approx(0.5 * np.sqrt(2 / np.pi), rel=0.01)


@pytest.mark.parametrize("samples", [128, 129])
def test_power_spectrum_of_white_noise_is_flat(samples):
    spectrum = distances.power_spectrum(0.5 * normal(2_000, samples))
    assert spectrum.shape == (samples // 2,)
    assert np.mean(spectrum) == pytest.approx(0.25, rel=0.01)
    assert spectrum == pytest.approx(np.full(samples // 2, 0.25), rel=5 * np.sqrt(2 / 2_000))


def test_power_spectrum_of_a_sine_peaks_at_its_frequency():
    windows = np.sin(2 * np.pi * 17 / 200 * np.arange(200) + np.array([[0.0], [1.0]]))
    spectrum = distances.power_spectrum(windows)
    assert np.argmax(spectrum) + 1 == 17  # the zero frequency is left out
    assert spectrum[14:19].sum() == pytest.approx(spectrum.sum(), rel=1e-3)


def test_lagged_products_by_hand():
    windows = np.array([[1.0, 2, 4], [-1, -2, -4]])  # their mean is 0
    assert measures.lagged_products(windows, 2) == pytest.approx(np.array([[7, 5, 4], [7, 5, 4]]))
    assert measures.lagged_products(windows + 9, 2) == pytest.approx(np.array([[7, 5, 4], [7, 5, 4]]))
    squares = np.array([[1.0, 4, 16]] * 2) - 7
    assert distances.lagged_square_products(windows + 9, 1)[0] == pytest.approx([np.mean(squares[0] ** 2), (6 * 3 - 3 * 9) / 2])


def test_autocorrelation_distance_is_the_largest_difference():
    one, other = np.array([[2.0, 1, 0], [2, 0, 0]]), np.array([[1.0, 0.5, 0.5]])  # correlations 1, 1/4, 0 and 1, 1/2, 1/2
    assert distances.autocorrelation_distance(one, other) == pytest.approx(0.5)
    assert distances.autocorrelation_distance(9 * one, one) == pytest.approx(0)


def test_autocorrelation_distance_of_processes_in_closed_form():
    # a Gaussian process of correlation r has squares of correlation r^2
    white, coloured = normal(400, 500, seed=1), autoregressive(400, 500, 0.7)
    for describe, expected in ((measures.lagged_products, 0.7), (distances.lagged_square_products, 0.49)):
        assert distances.autocorrelation_distance(describe(white, 50), describe(coloured, 50)) == pytest.approx(expected, abs=0.02)


def test_log_scales_and_their_distance():
    windows = np.array([[1.0, -1], [3, 1], [5, -5]])  # standard deviations 1, 1, 5
    assert distances.log_scales(windows) == pytest.approx([0, 0, np.log(5)])
    scales = distances.log_scales(normal(50, 100))
    assert distances.log_scale_distance(scales[::-1] + 0.25, scales) == pytest.approx(0.25)
    # equal in the mean, spread by one: half of each lies half a unit away on either side
    assert distances.log_scale_distance(np.array([-1.0, 1]), np.array([0.0, 0])) == pytest.approx(1)


def test_kurtosis_of_known_distributions():
    owner, shape = np.random.default_rng(0), (400, 500)
    assert distances.excess_kurtosis(np.array([[1.0, -1], [1, -1]]) + 4) == pytest.approx(-2)
    assert distances.excess_kurtosis(owner.uniform(size=shape)) == pytest.approx(-1.2, abs=0.01)
    assert distances.excess_kurtosis(owner.laplace(size=shape)) == pytest.approx(3, abs=0.3)
    assert distances.kurtosis_difference(owner.laplace(size=shape), owner.uniform(size=shape)) == pytest.approx(4.2, abs=0.3)


def test_tail_ratio_of_known_quantiles():
    gaussian = normal(400, 500)
    assert distances.tail_ratio(1.5 * gaussian, gaussian) == pytest.approx(1.5)
    laplace = np.random.default_rng(1).laplace(size=(400, 500))  # 0.999 of its absolute values lie below log(1000)
    assert distances.tail_ratio(laplace, gaussian) == pytest.approx(np.log(1000) / scipy.stats.norm.ppf(0.9995), rel=0.05)


@pytest.mark.parametrize("samples", [64, 65])
def test_multitaper_spectrum_from_its_definition(samples):
    # Slepian tapers are the eigenvectors of the sinc matrix of bandwidth 4 / samples; transforms by their sum
    time = np.arange(samples)
    apart = time[:, None] - time
    tapers = scipy.linalg.eigh(np.where(apart == 0, 8 / samples, np.sinc(8 / samples * apart) * 8 / samples))[1][:, -7:]
    windows, bins = 3 * normal(5, samples), np.arange(1, (samples - 1) // 2 + 1)
    transform = np.exp(-2j * np.pi / samples * np.outer(time, bins))
    expected = np.mean([np.abs((windows * taper) @ transform) ** 2 for taper in tapers.T], axis=0)
    assert distances.window_spectra(windows) == pytest.approx(expected, rel=1e-6)


def test_spectral_distances_by_hand():
    real = np.ones((3, 4)) * [1, 10, 100, 1]
    shape = np.exp([0.3, -0.3, 0.3, -0.3])
    outlier = np.array([[1.0], [1.0], [1e6]])  # one window in three does not move a median
    assert distances.geodesic_distance(outlier * real * shape, real) == pytest.approx(0.3)
    assert distances.geodesic_distance(np.exp(0.4) * real * shape, real) == pytest.approx(0.3)
    assert distances.log_spectral_distance(np.exp(0.4) * real * shape, real) == pytest.approx(0.5)


def test_spectral_distances_of_an_autoregressive_process_in_closed_form():
    white, coloured = (distances.window_spectra(windows) for windows in (normal(400, 500, seed=1), autoregressive(400, 500, 0.7)))
    frequency = np.arange(1, 250) / 500
    log_ratio = np.log(0.51 / np.abs(1 - 0.7 * np.exp(-2j * np.pi * frequency)) ** 2)
    assert distances.geodesic_distance(coloured, white) == pytest.approx(np.std(log_ratio), rel=0.02)
    assert distances.log_spectral_distance(coloured, white) == pytest.approx(np.sqrt(np.mean(log_ratio**2)), rel=0.02)


def test_a_generator_that_stands_still_is_infinitely_far_and_finite():
    still, real = np.zeros((30, 100)), normal(30, 100)
    for describe, compare in (
        (distances.window_spectra, distances.geodesic_distance),
        (distances.window_spectra, distances.log_spectral_distance),
        (distances.log_scales, distances.log_scale_distance),
        (lambda windows: measures.lagged_products(windows, 20), distances.autocorrelation_distance),
        (lambda windows: windows, distances.kurtosis_difference),
        (lambda windows: windows, distances.tail_ratio),
    ):
        assert np.isfinite(compare(describe(still), describe(real)))
