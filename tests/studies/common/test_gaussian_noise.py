"""The Gaussian noise models, compared with closed forms."""

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.signal import lfilter

from studies.common.gaussian_noise import GaussianAutoregression, fit_candidate


def test_gaussian_noise_is_white_with_the_deviation_of_its_source():
    source = 5.0 + 0.3 * default_rng(0).standard_normal((400, 100))
    draw = fit_candidate("gaussian", source, np.zeros_like(source))
    noise = draw(np.zeros((500, 100)), default_rng(1))
    assert noise.dtype == np.float32
    expected = np.std(source) * default_rng(1).standard_normal((500, 100))
    np.testing.assert_allclose(noise, expected, rtol=1e-6)


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
    model = GaussianAutoregression([first, second], 0.3, samples)
    noise = model.generate(number, default_rng(4))
    assert noise.shape == (number, samples) and noise.dtype == np.float32
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


def test_autoregressions_that_are_refused(refused):
    with refused("stationary"):
        GaussianAutoregression([1.2], 0.1, 30)
    with refused("stationary"):
        GaussianAutoregression([0.5, 0.5], 0.1, 30)  # a root on the unit circle
    with refused("noise that varies"):
        GaussianAutoregression.fit(np.ones((5, 30)), 4)
