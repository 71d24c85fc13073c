"""A ladder of noise models, from no noise to trained networks (an extension of section 2.3).

Each noise model is a rung of the ladder. The simplest rung that suffices depends on the noise.
`enhanced_simulator.noise_choice` evaluates the rungs on held-out noise.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

Fit = Callable[[np.ndarray, np.ndarray | None, int, int], Any]


def _none(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.surrogates import GaussianNoise

    return GaussianNoise(0.0, noise.shape[1])


def _gaussian(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.surrogates import GaussianNoise

    return GaussianNoise.fit(noise)


def _autoregression(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.surrogates import GaussianAutoregression

    return GaussianAutoregression.fit(noise, min(200, noise.shape[1] - 1))


def _residual_windows(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.window_bootstrap import WindowBootstrap

    return WindowBootstrap.fit(noise)


def _network(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork

    return AutoregressiveNetwork.untrained(noise, signal, seed).fit(noise, num_iterations, signal)


def _paper_gan(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.discriminator import build_discriminator
    from enhsim_tf.noise.extraction import noise_unit
    from enhsim_tf.noise.gan import NoiseGAN
    from enhsim_tf.noise.generator import build_generator

    window = noise.shape[1]
    gan = NoiseGAN(build_generator(window, seed=seed), build_discriminator(window, seed=seed), scale=noise_unit(noise), seed=seed)
    gan.fit(noise, num_iterations, verbose=False)
    return gan


def _convolutional_gan(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int) -> Any:
    from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan

    gan = convolutional_noise_gan(noise, num_iterations, seed)
    gan.fit(noise, num_iterations, verbose=False)
    return gan


RUNGS: dict[str, Fit] = {
    "none": _none,
    "Gaussian": _gaussian,
    "autoregression": _autoregression,
    "residual windows": _residual_windows,
    "autoregressive network": _network,
    "GAN of the paper": _paper_gan,
    "convolutional GAN": _convolutional_gan,
}
"""Maps the name of a rung to a function of noise windows, signal windows or None, number of iterations and seed, which fits it. The
simplest comes first."""


def generate(model: Any, num_windows: int, seed: int | np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
    """Generates windows of noise with the model of any rung; `signal` reaches those models that follow it."""
    if getattr(model, "follows_signal", False):
        return model.generate(num_windows, seed, signal)
    return model.generate(num_windows, seed)
