"""How both kinds of model add noise to what they enhance."""

from typing import Any

import numpy as np

from enhsim_tf.enhanced_simulator.checks import check_finite
from enhsim_tf.noise import ladder
from enhsim_tf.telemetry.quantisation import Levels


class NoisyOutput:
    """A model with a noise model, `noise`, and the levels of its channel, `quantisation`."""

    noise: Any
    quantisation: Levels | None

    def in_unit(self, clean: np.ndarray) -> np.ndarray:
        """Converts enhanced values to the units of the enhancer."""
        raise NotImplementedError

    def draw_noise(self, clean: np.ndarray, seed: int | np.random.Generator) -> np.ndarray:
        """Generates noise for windows or for one series. Noise that follows the signal receives it in units of the enhancer.

        Args:
            clean: Enhanced windows of shape `(windows, samples)`, or an enhanced series of shape `(samples,)`.
            seed: Seed, or a random number generator, whose state advances.

        Returns:
            float32 array of the shape of `clean`, in the telemetry's unit.

        Raises:
            InputError: If a value is not finite.
        """
        draw = ladder.generate if np.ndim(clean) == 2 else ladder.generate_series
        signal = self.in_unit(clean) if getattr(self.noise, "follows_signal", False) else None
        return check_finite(draw(self.noise, len(clean), seed, signal))

    def add_noise(self, clean: np.ndarray, seed: int | np.random.Generator) -> np.ndarray:
        """Adds noise to enhanced windows or to an enhanced series, and rounds to the levels of a quantised channel."""
        noisy = clean + self.draw_noise(clean, seed)
        return noisy if self.quantisation is None else self.quantisation.round(noisy)
