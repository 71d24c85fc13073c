"""The mixture density network recovers known processes at a small size."""

import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.common.measures import autocorrelation
from studies.noise_models.networks.mixture_density import MixtureDensityNoise

pytestmark = pytest.mark.slow

WINDOW = 32


def test_an_autoregression_is_recovered():
    rng = np.random.default_rng(0)
    noise = lfilter([0.3], [1.0, -0.7], rng.standard_normal(800 * WINDOW)).reshape(-1, WINDOW)
    model = MixtureDensityNoise(seed=1, num_steps=100).fit(noise)
    generated = model.generate(800, rng)
    assert generated.shape == (800, WINDOW)
    assert generated.std() == pytest.approx(0.3 / np.sqrt(1 - 0.7**2), rel=0.05)
    assert autocorrelation(generated, 2)[1:] == pytest.approx([0.7, 0.49], abs=0.05)
    # the mean negative log-likelihood of the innovations, in standard deviations of the noise
    assert min(model.losses) == pytest.approx(
        0.5 * np.log(2 * np.pi * np.e * (1 - 0.7**2)), abs=0.03
    )


def test_noise_that_grows_with_the_signal_is_recovered():
    rng = np.random.default_rng(2)
    signal = np.sin(2 * np.pi * np.arange(800 * WINDOW) / 50).reshape(-1, WINDOW)
    model = MixtureDensityNoise(seed=3, num_steps=200).fit(
        (1 + 0.5 * signal) * rng.standard_normal(signal.shape), signal
    )
    generated = model.generate(800, rng, signal)
    slope, offset = np.polyfit(signal.ravel(), np.abs(generated).ravel() / np.sqrt(2 / np.pi), 1)
    assert (slope, offset) == pytest.approx((0.5, 1.0), abs=0.07)


def test_quantised_noise_keeps_its_levels():
    rng = np.random.default_rng(4)
    noise = 0.5 * np.rint(rng.standard_normal((200, WINDOW)) / 0.5)
    generated = MixtureDensityNoise(seed=5, num_steps=20).fit(noise).generate(50, rng)
    np.testing.assert_allclose(generated, 0.5 * np.rint(generated / 0.5), atol=1e-6)
