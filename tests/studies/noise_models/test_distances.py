"""Distances of windows against closed forms, hand-worked cases and their definitions written out."""

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

from enhsim_tf.common import measures
from studies.noise_models import distances
from tests.common.test_measures import autoregressive, normal


def test_autocorrelation_distance_is_the_largest_difference():
    one, other = (
        np.array([[2.0, 1, 0], [2, 0, 0]]),
        np.array([[1.0, 0.5, 0.5]]),
    )  # correlations 1, 1/4, 0 and 1, 1/2, 1/2
    assert distances.autocorrelation_distance(one, other) == pytest.approx(0.5)
    assert distances.autocorrelation_distance(9 * one, one) == pytest.approx(0)
    # a Gaussian process of correlation r has squares of correlation r^2
    white, coloured = normal(400, 500, seed=1), autoregressive(400, 500, 0.7)
    for describe, expected in (
        (measures.lagged_products, 0.7),
        (distances.lagged_square_products, 0.49),
    ):
        assert distances.autocorrelation_distance(
            describe(white, 50), describe(coloured, 50)
        ) == pytest.approx(expected, abs=0.02)


def test_log_scales_and_their_distance():
    assert distances.log_scales(np.array([[1.0, -1], [3, 1], [5, -5]])) == pytest.approx(
        [0, 0, np.log(5)]
    )
    scales = distances.log_scales(normal(50, 100))
    assert distances.log_scale_distance(scales[::-1] + 0.25, scales) == pytest.approx(0.25)
    # equal in the mean, spread by one: half of each lies half a unit away on either side
    assert distances.log_scale_distance(np.array([-1.0, 1]), np.array([0.0, 0])) == pytest.approx(1)


def test_kurtosis_and_tails_of_known_distributions():
    owner, shape, gaussian = np.random.default_rng(0), (400, 500), normal(400, 500)
    coin = (
        np.array([[1.0, -1], [1, -1]]) + 4
    )  # of excess kurtosis -2, where a uniform law has -1.2 and that of Laplace 3
    assert distances.kurtosis_difference(owner.uniform(size=shape), coin) == pytest.approx(
        0.8, abs=0.01
    )
    laplace = owner.laplace(size=shape)
    assert distances.kurtosis_difference(laplace, owner.uniform(size=shape)) == pytest.approx(
        4.2, abs=0.3
    )
    assert distances.tail_ratio(1.5 * gaussian, gaussian) == pytest.approx(1.5)
    # 0.999 of its absolute values lie below log(1000)
    assert distances.tail_ratio(laplace, gaussian) == pytest.approx(
        np.log(1000) / scipy.stats.norm.ppf(0.9995), rel=0.05
    )


@pytest.mark.parametrize("samples", [64, 65])
def test_multitaper_spectrum_from_its_definition(samples):
    # Slepian tapers are the eigenvectors of the sinc matrix of bandwidth 4 / samples; transforms by their sum
    time = np.arange(samples)
    apart = time[:, None] - time
    tapers = scipy.linalg.eigh(
        np.where(apart == 0, 8 / samples, np.sinc(8 / samples * apart) * 8 / samples)
    )[1][:, -7:]
    windows, bins = 3 * normal(5, samples), np.arange(1, (samples - 1) // 2 + 1)
    transform = np.exp(-2j * np.pi / samples * np.outer(time, bins))
    expected = np.mean([np.abs((windows * taper) @ transform) ** 2 for taper in tapers.T], axis=0)
    assert distances.window_spectra(windows) == pytest.approx(expected, rel=1e-6)


def test_spectral_distances_by_hand_and_in_closed_form():
    real, shape = np.ones((3, 4)) * [1, 10, 100, 1], np.exp([0.3, -0.3, 0.3, -0.3])
    outlier = np.array([[1.0], [1.0], [1e6]])  # one window in three does not move a median
    assert distances.geodesic_distance(outlier * real * shape, real) == pytest.approx(0.3)
    assert distances.geodesic_distance(np.exp(0.4) * real * shape, real) == pytest.approx(0.3)
    assert distances.log_spectral_distance(np.exp(0.4) * real * shape, real) == pytest.approx(0.5)
    white, coloured = (
        distances.window_spectra(windows)
        for windows in (normal(400, 500, seed=1), autoregressive(400, 500, 0.7))
    )
    log_ratio = np.log(0.51 / np.abs(1 - 0.7 * np.exp(-2j * np.pi * np.arange(1, 250) / 500)) ** 2)
    assert distances.geodesic_distance(coloured, white) == pytest.approx(
        np.std(log_ratio), rel=0.02
    )
    assert distances.log_spectral_distance(coloured, white) == pytest.approx(
        np.sqrt(np.mean(log_ratio**2)), rel=0.02
    )


def test_a_generator_that_stands_still_is_infinitely_far_and_finite():
    still, real = np.zeros((30, 100)), normal(30, 100)
    for describe, compare in (
        (distances.window_spectra, distances.geodesic_distance),
        (distances.window_spectra, distances.log_spectral_distance),
        (distances.log_scales, distances.log_scale_distance),
        (lambda windows: measures.lagged_products(windows, 20), distances.autocorrelation_distance),
        *(
            (lambda windows: windows, each)
            for each in (distances.kurtosis_difference, distances.tail_ratio)
        ),
        *(
            (lambda windows: windows[:, :3], each)
            for each in (distances.density, distances.coverage, distances.mmd_squared)
        ),
    ):
        assert np.isfinite(compare(describe(still), describe(real))) and np.isfinite(
            compare(describe(real), describe(still))
        )


def test_convolution_features_written_out(monkeypatch):
    monkeypatch.setattr(distances, "_NUM_KERNELS", 2)
    windows = normal(3, 40)
    features = distances.convolution_features(windows)
    assert features.shape == (3, 3 * 2 * 2) and features.dtype == np.float32  # dilations 1, 2, 4
    owner, expected = np.random.default_rng(0), []
    for dilation in (1, 2, 4):
        kernels, thresholds = owner.standard_normal((9, 2)), owner.standard_normal(2)
        for pool in (np.max, lambda response, threshold: np.mean(response > threshold)):
            for kernel, threshold in zip(kernels.T, thresholds, strict=True):
                spread = np.zeros(8 * dilation + 1)
                spread[::dilation] = kernel / np.sqrt(np.sum(kernel**2))
                responses = [np.correlate(window, spread, mode="valid") for window in windows]
                expected.append(
                    [
                        pool(response) if pool is np.max else pool(response, threshold)
                        for response in responses
                    ]
                )
    assert features == pytest.approx(np.transpose(expected), abs=1e-5)


def test_density_and_coverage_by_hand_and_in_theory(monkeypatch):
    pairs = [
        (normal(300, 4, seed=2 * seed), normal(300, 4, seed=2 * seed + 1)) for seed in range(20)
    ]
    assert np.mean([distances.coverage(*pair) for pair in pairs]) == pytest.approx(
        1 - 2.0**-5, abs=0.01
    )
    assert np.mean([distances.density(*pair) for pair in pairs]) == pytest.approx(1, abs=0.05)
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

    def kernel(one, other):
        return np.exp(-np.sum(((one - other) / unit) ** 2) / (2 * np.median(lengths) ** 2))

    expected = sum(
        kernel(generated[i], generated[j]) for i in range(12) for j in range(12) if i != j
    ) / (12 * 11)
    expected += sum(kernel(real[i], real[j]) for i in range(15) for j in range(15) if i != j) / (
        15 * 14
    )
    expected -= 2 * sum(kernel(one, other) for one in generated for other in real) / (12 * 15)
    assert distances.mmd_squared(generated, real) == pytest.approx(expected)
