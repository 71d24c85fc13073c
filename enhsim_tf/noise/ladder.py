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


@dataclasses.dataclass(frozen=True)
class FitTask:
    """What a rung is fitted to, and how.

    Args:
        noise: Noise windows of shape `(windows, samples)`.
        signal: The signal below them, of the same shape, for noise that may follow it; or None.
        num_iterations: Number of iterations of a network.
        seed: Seed of the weights and the training.
        starts: Start of each window in samples, shape `(windows,)`. None: no two windows overlap, and they are in the order of time.
        watch: Who watches the training.
    """

    noise: np.ndarray
    signal: np.ndarray | None
    num_iterations: int
    seed: int
    starts: np.ndarray | None = None
    watch: Watch = NOBODY


Fit = Callable[[FitTask], Any]


def _none(task: FitTask) -> Any:
    from enhsim_tf.noise.surrogates import GaussianNoise

    return GaussianNoise(0.0, task.noise.shape[1])


def _gaussian(task: FitTask) -> Any:
    from enhsim_tf.noise.surrogates import GaussianNoise

    return GaussianNoise.fit(task.noise)


def _autoregression(task: FitTask) -> Any:
    from enhsim_tf.noise.surrogates import GaussianAutoregression

    return GaussianAutoregression.fit(task.noise, min(200, task.noise.shape[1] - 1))


def _residual_windows(task: FitTask) -> Any:
    from enhsim_tf.noise.window_bootstrap import WindowBootstrap

    return WindowBootstrap.fit(task.noise, task.starts)


def _matched_windows(task: FitTask) -> Any:
    from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap

    return MatchedWindowBootstrap.fit(task.noise, task.signal, task.starts)


def _network(task: FitTask) -> Any:
    from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork

    network = AutoregressiveNetwork.untrained(task.noise, task.signal, task.seed)
    return network.fit(task.noise, task.num_iterations, task.signal, task.starts, on_iteration=task.watch.on_iteration)


def _paper_gan(task: FitTask) -> Any:
    return fit_paper_gan(task)


def fit_paper_gan(task: FitTask, unit: float | None = None) -> Any:
    """Trains the paper's GAN.

    Args:
        task: What it is fitted to, and how.
        unit: Unit of the noise in the networks. None: that in which the noise has the amplitude of the paper's noise.

    Returns:
        The noise networks, or Gaussian noise in their form if the training diverges (see `guarded_training`).
    """
    from enhsim_tf.noise.discriminator import build_discriminator
    from enhsim_tf.noise.extraction import noise_unit
    from enhsim_tf.noise.gan import NoiseGAN
    from enhsim_tf.noise.generator import build_generator

    def build() -> NoiseGAN:
        networks = [make(task.noise.shape[1], seed=task.seed) for make in (build_generator, build_discriminator)]
        return NoiseGAN(*networks, scale=noise_unit(task.noise) if unit is None else unit, seed=task.seed)

    return _train(build, task)


def _convolutional_gan(task: FitTask) -> Any:
    from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan

    return _train(lambda: convolutional_noise_gan(task.noise, task.num_iterations, task.seed), task)


def _train(build: Callable[[], Any], task: FitTask) -> Any:
    from enhsim_tf.noise.guarded_training import train_guarded

    watch = task.watch
    return train_guarded(build, task.noise, task.num_iterations, watch.verbose, watch.on_iteration, watch.note)


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
"""Maps the name of a rung to a function that fits it. The simplest comes first."""


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
