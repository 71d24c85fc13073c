"""Noise models by name, and what each of them does. Nothing slow is imported, so that the command
line can list the names.

To add a noise model, write its class and add one line to `NOISES`; the contract is tested for all
of them.
"""

import importlib
from typing import TYPE_CHECKING, Protocol

from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import numpy as np


class NoiseModel(Protocol):
    """What every noise model does.

    Args:
        saved: Names of the arguments of the constructor, each of which is an attribute too: arrays,
            numbers, texts, or sequences of these.
    """

    saved: tuple[str, ...]

    @classmethod
    def fit(cls, windows: "np.ndarray", signal: "np.ndarray") -> "NoiseModel":
        """Fits the model to windows of noise and the enhanced signal below them, both of shape
        `(windows, samples, channels)`.
        """

    def generate(
        self, number: int, rng: "np.random.Generator", signal: "np.ndarray"
    ) -> "np.ndarray":
        """Draws windows, float32 of shape `(number, samples, channels)`, which are added to a
        signal of this shape.
        """

    def generate_series(
        self, num_samples: int, rng: "np.random.Generator", signal: "np.ndarray"
    ) -> "np.ndarray":
        """Draws one series, float32 of shape `(num_samples, channels)`, which is added to a signal
        of this shape.
        """


NONE = "none"
RESIDUAL_WINDOWS = "residual windows"
MATCHED = "matched residual windows"
NOISES = {
    NONE: "window_bootstrap.NoNoise",
    RESIDUAL_WINDOWS: "window_bootstrap.UnmatchedBootstrap",
    MATCHED: "window_bootstrap.WindowBootstrap",
}
"""The module in this package and the class of each noise model that a fit offers."""


def noise_model(name: str) -> type[NoiseModel]:
    """Returns the class of a noise model; raises InputError if there is none of this name."""
    if name not in NOISES:
        raise InputError(
            f"Expected a noise model, one of: {', '.join(NOISES)}. Received: {name!r}."
        )
    module, _, kind = NOISES[name].rpartition(".")
    return getattr(importlib.import_module(f"enhsim_tf.noise.{module}"), kind)
