"""Gaussian noise with the spectrum of real noise, as Keras networks, so that it is saved and generated like a trained noise network."""

import numpy as np

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.noise.surrogates import GaussianAutoregression

_MAX_ORDER = 40
_LEFT_OUT = 1e-6  # share of the variance in the tail of the impulse response that may be left out


def linear_noise(noise_windows: np.ndarray) -> NoiseGAN:
    """Fits an autoregression to noise and returns it as a `NoiseGAN` that needs no training.

    The generator is one convolution of white noise, whose weights are the impulse response of the fitted autoregression. The
    response is cut off where its tail holds a negligible share of the variance, at the latest after a window, and scaled to the variance of the noise. The
    discriminator is untrained.

    Args:
        noise_windows: Noise, float32 of shape `(windows, samples)`.

    Returns:
        The noise model. It generates zeros if the noise is zero throughout.
    """
    from scipy.signal import lfilter

    noise_windows = np.asarray(noise_windows, np.float64)
    window, mean, scale = noise_windows.shape[1], float(np.mean(noise_windows)), float(np.std(noise_windows))
    response, bias = np.zeros(1), mean
    if scale > 0:
        fitted = GaussianAutoregression.fit((noise_windows - mean) / scale, min(_MAX_ORDER, window - 1))
        response = lfilter([1.0], np.concatenate([[1.0], -fitted.coefficients]), np.eye(1, window)[0])
        power = np.cumsum(response**2)
        response = response[: int(np.searchsorted(power, (1 - _LEFT_OUT) * power[-1])) + 1]
        response, bias = response / np.sqrt(np.sum(response**2)), mean / scale
    convolution = keras.layers.Conv1D(1, len(response), kernel_initializer="zeros", name="Impulse_Response")
    generator = keras.Sequential([keras.Input((None, 1)), convolution], name="generator")
    convolution.set_weights([response[::-1, None, None].astype(np.float32), np.array([bias], np.float32)])
    return NoiseGAN(generator, build_discriminator(window, filters=8), scale=scale or 1.0)
