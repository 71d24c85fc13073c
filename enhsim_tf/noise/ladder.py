"""A ladder of noise models, from no noise to trained networks (an extension of section 2.3).

Each noise model is a rung of the ladder. The simplest rung that suffices depends on the noise.
`enhanced_simulator.noise_choice` evaluates the rungs on held-out noise.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np


@dataclasses.dataclass(frozen=True)
class Watch:
    """Who watches a training.

    Args:
        verbose: Whether a GAN shows a progress bar. With None, the bar is shown only on a terminal.
        on_iteration: Called after each iteration with the number of completed iterations.
        note: Called with a sentence for each training that diverged, and with one if a GAN was replaced.
    """

    verbose: bool | None = False
    on_iteration: Callable[[int], None] | None = None
    note: Callable[[str], None] = lambda line: None


NOBODY = Watch()
Fit = Callable[..., Any]


def _none(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.surrogates import GaussianNoise

    return GaussianNoise(0.0, noise.shape[1])


def _gaussian(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.surrogates import GaussianNoise

    return GaussianNoise.fit(noise)


def _autoregression(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.surrogates import GaussianAutoregression

    return GaussianAutoregression.fit(noise, min(200, noise.shape[1] - 1))


def _residual_windows(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.window_bootstrap import WindowBootstrap

    return WindowBootstrap.fit(noise)


def _matched_windows(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap

    return MatchedWindowBootstrap.fit(noise, signal)


def _network(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork

    return AutoregressiveNetwork.untrained(noise, signal, seed).fit(noise, num_iterations, signal, on_iteration=watch.on_iteration)


def _paper_gan(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    return fit_paper_gan(noise, num_iterations, seed, None, watch)


def fit_paper_gan(noise: np.ndarray, num_iterations: int, seed: int, unit: float | None = None, watch: Watch = NOBODY) -> Any:
    """Trains the paper's GAN.

    Args:
        noise: Noise windows of shape `(windows, samples)`.
        num_iterations: Number of iterations.
        seed: Seed of the weights and the training.
        unit: Unit of the noise in the networks. None: that in which the noise has the amplitude of the paper's noise.
        watch: Who watches the training.

    Returns:
        The noise networks, or Gaussian noise in their form if the training diverges (see `guarded_training`).
    """
    from enhsim_tf.noise.discriminator import build_discriminator
    from enhsim_tf.noise.extraction import noise_unit
    from enhsim_tf.noise.gan import NoiseGAN
    from enhsim_tf.noise.generator import build_generator
    from enhsim_tf.noise.guarded_training import train_guarded

    def build() -> NoiseGAN:
        networks = [make(noise.shape[1], seed=seed) for make in (build_generator, build_discriminator)]
        return NoiseGAN(*networks, scale=noise_unit(noise) if unit is None else unit, seed=seed)

    return train_guarded(build, noise, num_iterations, watch.verbose, watch.on_iteration, watch.note)


def _convolutional_gan(noise: np.ndarray, signal: np.ndarray | None, num_iterations: int, seed: int, watch: Watch = NOBODY) -> Any:
    from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan
    from enhsim_tf.noise.guarded_training import train_guarded

    def build() -> Any:
        return convolutional_noise_gan(noise, num_iterations, seed)

    return train_guarded(build, noise, num_iterations, watch.verbose, watch.on_iteration, watch.note)


RUNGS: dict[str, Fit] = {
    "none": _none,
    "Gaussian": _gaussian,
    "autoregression": _autoregression,
    "residual windows": _residual_windows,
    "matched residual windows": _matched_windows,
    "autoregressive network": _network,
    "GAN of the paper": _paper_gan,
    "convolutional GAN": _convolutional_gan,
}
"""Maps the name of a rung to a function of noise windows, signal windows or None, number of iterations, seed and `Watch`, which fits it.
The simplest comes first."""


def generate(model: Any, num_windows: int, seed: int | np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
    """Generates windows of noise with the model of any rung; `signal` reaches those models that follow it."""
    if getattr(model, "follows_signal", False):
        return model.generate(num_windows, seed, signal)
    return model.generate(num_windows, seed)


def generate_series(model: Any, num_samples: int, seed: int | np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
    """Generates a series of noise with the model of any rung; `signal` reaches those models that follow it."""
    if getattr(model, "follows_signal", False):
        return model.generate_series(num_samples, seed, signal)
    return model.generate_series(num_samples, seed)
