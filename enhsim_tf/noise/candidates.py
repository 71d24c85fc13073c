"""The noise models among which a fit chooses (an extension of section 2.3): how they are fitted."""

from typing import Protocol

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.names import CANDIDATES
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap

_MOST_ORDER = 200  # of the autoregression


class NoiseModel(Protocol):
    """What every noise model can do. Models that do not depend on the signal ignore it."""

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws noise for `number` windows; `signal` is the enhanced signal of the same shape, in the telemetry's unit."""

    def generate_series(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws one series of noise; `signal` is the enhanced signal of the same shape."""


def fit_candidate(name: str, noise: np.ndarray, signal: np.ndarray, starts: np.ndarray | None = None) -> NoiseModel:
    """Fits a noise model, one of `names.CANDIDATES`, to windows of noise; raises InputError if it cannot be fitted to this noise.

    Noise and the enhanced signal below it have the shape `(windows, samples, channels)`. `starts` are the first samples of the windows; None: no
    two overlap.
    """
    _, window, channels = noise.shape
    match name:
        case "none":
            return GaussianNoise(np.zeros((channels, channels)), window)
        case "gaussian":
            return GaussianNoise.fit(noise)
        case "autoregression":
            return GaussianNoise.fit_autoregressions(noise, min(_MOST_ORDER, window - 1))
        case "residual windows":
            return WindowBootstrap(noise, starts)
        case "matched residual windows":
            return MatchedWindowBootstrap.fit(noise, signal, starts)
    raise InputError(f"Expected a noise model among {', '.join(CANDIDATES)}. Received: {name!r}.")
