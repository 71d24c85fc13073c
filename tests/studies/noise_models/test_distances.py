"""Distances of windows against closed forms, hand-worked cases and their definitions written
out.
"""

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

from enhsim_tf.common import measures
from studies.noise_models import distances
from tests.common.test_measures import normal


def test_autocorrelation_distance_is_the_largest_difference():
    # correlations 1, 1/4, 0 and 1, 1/2, 1/2
    one, other = np.array([[2.0, 1, 0], [2, 0, 0]]), np.array([[1.0, 0.5, 0.5]])
    assert distances.autocorrelation_distance(one, other) == pytest.approx(0.5)
    assert distances.autocorrelation_distance(9 * one, one) == pytest.approx(0)
    # squares less their mean: -11, -2 and 13 thirds
    squares = distances.lagged_square_products(np.array([[1.0, 2, -3]]), 1)
    assert squares == pytest.approx(np.array([[294 / 27, -2 / 9]]))


def test_log_scales_and_their_distance():
    windows = np.array([[1.0, -1], [3, 1], [5, -5]])
    assert distances.log_scales(windows) == pytest.approx([0, 0, np.log(5)])
    scales = distances.log_scales(normal(50, 100))
    assert distances.log_scale_distance(scales[::-1] + 0.25, scales) == pytest.approx(0.25)
    # equal in the mean, spread by one: half of each lies half a unit away on either side
    assert distances.log_scale_distance(np.array([-1.0, 1]), np.array([0.0, 0])) == pytest.approx(1)


def test_kurtosis_and_tails_of_known_distributions():
    owner, shape, gaussian = np.random.default_rng(0), (400, 500), normal(400, 500)
    # of excess kurtosis -2, where a uniform law has -1.2 and that of Laplace 3
    coin = np.array([[1.0, -1], [1, -1]]) + 4
    uniform, laplace = owner.uniform(size=shape), owner.laplace(size=shape)
    assert distances.kurtosis_difference(uniform, coin) == pytest.approx(0.8, abs=0.01)
    assert distances.kurtosis_difference(laplace, uniform) == pytest.approx(4.2, abs=0.3)
    assert distances.tail_ratio(1.5 * gaussian, gaussian) == pytest.approx(1.5)
    # 0.999 of its absolute values lie below log(1000)
    assert distances.tail_ratio(laplace, gaussian) == pytest.approx(
        np.log(1000) / scipy.stats.norm.ppf(0.9995), rel=0.05
    )


@pytest.mark.parametrize("samples", [64, 65])
def test_multitaper_spectrum_from_its_definition(samples):
    # Slepian tapers are the eigenvectors of the sinc matrix of bandwidth 4 / samples; transforms by
    # their sum
    time = np.arange(samples)
    apart = time[:, None] - time
    sinc = np.where(apart == 0, 8 / samples, np.sinc(8 / samples * apart) * 8 / samples)
    tapers = scipy.linalg.eigh(sinc)[1][:, -7:]
    windows, bins = 3 * normal(5, samples), np.arange(1, (samples - 1) // 2 + 1)
    transform = np.exp(-2j * np.pi / samples * np.outer(time, bins))
    expected = np.mean([np.abs((windows * taper) @ transform) ** 2 for taper in tapers.T], axis=0)
    assert distances.window_spectra(windows) == pytest.approx(expected, rel=1e-6)


def test_spectral_distances_by_hand():
    real, shape = np.ones((3, 4)) * [1, 10, 100, 1], np.exp([0.3, -0.3, 0.3, -0.3])
    outlier = np.array([[1.0], [1.0], [1e6]])  # one window in three does not move a median
    assert distances.geodesic_distance(outlier * real * shape, real) == pytest.approx(0.3)
    assert distances.geodesic_distance(np.exp(0.4) * real * shape, real) == pytest.approx(0.3)
    assert distances.log_spectral_distance(np.exp(0.4) * real * shape, real) == pytest.approx(0.5)


def test_a_generator_that_stands_still_is_infinitely_far_and_finite():
    still, real = np.zeros((30, 100)), normal(30, 100)
    for describe, *distances_of_it in (
        (distances.window_spectra, distances.geodesic_distance, distances.log_spectral_distance),
        (distances.log_scales, distances.log_scale_distance),
        (lambda windows: measures.lagged_products(windows, 20), distances.autocorrelation_distance),
        (lambda windows: windows, distances.kurtosis_difference, distances.tail_ratio),
        (
            lambda windows: windows[:, :3],
            distances.density,
            distances.coverage,
            distances.mmd_squared,
        ),
    ):
        for distance in distances_of_it:
            for pair in ((still, real), (real, still)):
                assert np.isfinite(distance(*map(describe, pair)))


def test_convolution_features_written_out(monkeypatch):
    monkeypatch.setattr(distances, "_NUM_KERNELS", 2)
    windows = normal(3, 40)
    features = distances.convolution_features(windows)
    assert features.shape == (3, 3 * 2 * 2) and features.dtype == np.float32  # dilations 1, 2, 4
    owner, expected = np.random.default_rng(0), []
    for dilation in (1, 2, 4):
        kernels, thresholds = owner.standard_normal((9, 2)), owner.standard_normal(2)
        largest, shares = [], []
        for kernel, threshold in zip(kernels.T, thresholds, strict=True):
            spread = np.zeros(8 * dilation + 1)
            spread[::dilation] = kernel / np.sqrt(np.sum(kernel**2))
            responses = [np.correlate(window, spread, mode="valid") for window in windows]
            largest.append([response.max() for response in responses])
            shares.append([np.mean(response > threshold) for response in responses])
        expected += largest + shares
    assert features == pytest.approx(np.transpose(expected), abs=1e-5)


def test_density_and_coverage_by_hand(monkeypatch):
    monkeypatch.setattr(distances, "_NUM_NEIGHBOURS", 1)
    real = np.array([[0.0], [1.0], [2.0], [10.0]])  # to the nearest: 1, 1, 1 and 8
    generated = np.array([[0.5], [0.6], [9.0], [30.0]])
    # 0.5 and 0.6 lie in the reach of 0 and 1, 9 in that of 10; 30 and the reach of 2 stay empty
    assert distances.density(generated, real) == pytest.approx(5 / 4)
    assert distances.coverage(generated, real) == pytest.approx(3 / 4)


def test_mmd_written_out():
    generated, real = normal(12, 3, seed=1) + 0.5, normal(15, 3) * [1, 10, 100]
    unit = np.std(real, axis=0)
    lengths = [np.linalg.norm((real[i] - real[j]) / unit) for i in range(15) for j in range(i)]

    def kernels(some, others):
        apart = np.linalg.norm((some[:, None] - others) / unit, axis=2)
        return np.exp(-(apart**2) / (2 * np.median(lengths) ** 2))

    expected = -2 * kernels(generated, real).mean()
    for some in (generated, real):  # without the pairs of a window with itself
        expected += (kernels(some, some).sum() - len(some)) / (len(some) * (len(some) - 1))
    assert distances.mmd_squared(generated, real) == pytest.approx(expected)
