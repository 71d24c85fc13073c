"""The Gaussian noise models, compared with closed forms."""

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.signal import lfilter

from studies.common.gaussian_noise import GaussianAutoregression, GaussianNoise


def test_gaussian_noise_of_several_channels_keeps_their_covariance():
    # the third channel is constant
    covariance = np.array([[4.0, 1.2, 0.0], [1.2, 1.0, 0.0], [0.0, 0.0, 0.0]])
    source = default_rng(0).multivariate_normal(np.zeros(3), covariance, (400, 100))
    fitted = GaussianNoise.fit(source)
    found = fitted.root @ fitted.root.T
    assert found == pytest.approx(covariance, abs=5 * 4 * np.sqrt(2 / 40_000))
    noise = fitted.generate(500, default_rng(1))
    assert noise.shape == (500, 100, 3) and noise.dtype == np.float32
    generated = np.cov(noise.reshape(-1, 3), rowvar=False)
    assert generated == pytest.approx(found, abs=5 * 4 * np.sqrt(2 / 50_000))


def second_order(first, second, number, samples, seed):
    """Windows of an AR(2) process with innovations of standard deviation 1, after a burn-in of 500
    samples.
    """
    draws = default_rng(seed).standard_normal((number, samples + 500))
    return lfilter([1.0], [1.0, -first, -second], draws)[:, 500:]


@pytest.mark.parametrize(("first", "second"), [(1.2, -0.5), (0.3, 0.4), (1.9, -0.95)])
def test_autoregression_recovers_its_coefficients(first, second):
    windows = 0.2 * second_order(first, second, 200, 300, seed=3)
    fitted = GaussianAutoregression.fit(windows, max_order=2)
    error = 5 * np.sqrt((1 - second**2) / windows.size)  # of a least-squares AR(2)
    assert fitted.coefficients == pytest.approx([first, second], abs=error)
    assert fitted.innovation_sd == pytest.approx(0.2, rel=5 / np.sqrt(2 * windows.size))


def test_akaike_chooses_an_order_that_suffices():
    found = GaussianAutoregression.fit(second_order(1.2, -0.5, 100, 200, seed=0)).coefficients
    assert len(found) >= 2
    assert found == pytest.approx([1.2, -0.5] + [0] * (len(found) - 2), abs=5 / np.sqrt(20_000))


def test_generated_autoregression_is_stationary_and_has_the_closed_form():
    number, samples, first, second = 20_000, 40, 1.2, -0.5
    model = GaussianNoise(np.eye(1), samples, [GaussianAutoregression([first, second], 0.3)])
    noise = model.generate(number, default_rng(4))
    assert noise.shape == (number, samples, 1) and noise.dtype == np.float32
    noise = noise[:, :, 0]
    expected = [1, first / (1 - second)]  # the recursion of Yule and Walker
    while len(expected) < samples:
        expected.append(first * expected[-1] + second * expected[-2])
    sd = 0.3 / np.sqrt(1 - first * expected[1] - second * expected[2])
    # five standard errors, at every sample: the first has the variance of the last
    assert np.std(noise, axis=0, dtype=np.float64) == pytest.approx(
        np.full(samples, sd), rel=5 / np.sqrt(2 * number)
    )
    for begin in (0, 1, 20):
        products = noise[:, begin : begin + 1].astype(np.float64) * noise[:, begin:]
        assert products.mean(axis=0) / sd**2 == pytest.approx(
            np.array(expected[: samples - begin]), abs=5 * np.sqrt(2 / number)
        )


def test_joint_autoregression_recovers_the_channels_and_their_cross_correlation():
    number, samples, correlation = 400, 300, 0.8
    covariance = np.array([[1, correlation], [correlation, 1]])
    draws = default_rng(0).multivariate_normal([0, 0], covariance, (number, samples))
    memories, scales = (0.9, -0.5), (2.0, 7.0)
    values = np.stack(
        [lfilter([1.0], [1.0, -memories[channel]], draws[:, :, channel]) for channel in (0, 1)],
        axis=2,
    )
    fitted = GaussianNoise.fit_autoregressions(values[:, 100:] * scales, max_order=1)
    error = 5 / np.sqrt(number * 200)
    for fit, memory, scale in zip(fitted.processes, memories, scales, strict=True):
        assert fit.coefficients == pytest.approx([memory], abs=error)
        assert fit.innovation_sd == pytest.approx(scale, rel=error)
    assert fitted.root @ fitted.root.T == pytest.approx(covariance, abs=error)
    noise = fitted.generate(2_000, default_rng(1))[:, 150:]
    assert noise.shape == (2_000, 50, 2) and noise.dtype == np.float32
    # closed form of two AR(1): E xy = c / (1 - ab), E xx = 1 / (1 - a^2), E yy = 1 / (1 - b^2)
    expected = correlation / (1 + 0.9 * 0.5) * np.sqrt((1 - 0.9**2) * (1 - 0.5**2))
    found = np.corrcoef(noise.reshape(-1, 2), rowvar=False)[0, 1]
    assert found == pytest.approx(expected, abs=0.01)
    sds = [2 / np.sqrt(1 - 0.81), 7 / np.sqrt(1 - 0.25)]
    assert noise.std(axis=(0, 1)) == pytest.approx(sds, rel=0.03)


def test_autoregressions_that_are_refused(refused):
    with refused("stationary"):
        GaussianAutoregression([1.2], 0.1)
    with refused("stationary"):
        GaussianAutoregression([0.5, 0.5], 0.1)  # a root on the unit circle
    with refused("0 or more", "-1.0"):
        GaussianAutoregression([0.5], -1.0)
    with refused("noise that varies"):
        GaussianAutoregression.fit(np.ones((5, 30)), 4)
