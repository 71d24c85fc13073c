"""How both kinds of model add noise to what they enhance."""

import numpy as np

from enhsim_tf.enhanced_simulator.checks import check_finite
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.telemetry.quantisation import Levels


class NoisyOutput:
    """A model with a noise model, `noise`, and the levels of its channel, `quantisation`."""

    noise: NoiseModel
    quantisation: Levels | None

    def draw_noise(self, clean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Generates noise for windows or for one series.

        Args:
            clean: Enhanced windows of shape `(windows, samples)`, or an enhanced series of shape `(samples,)`.
            rng: Random number generator.

        Returns:
            float32 array of the shape of `clean`, in the telemetry's unit.

        Raises:
            InputError: If a value is not finite.
        """
        draw = self.noise.generate if np.ndim(clean) == 2 else self.noise.generate_series
        return check_finite(draw(len(clean), rng, clean))

    def add_noise(self, clean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Adds noise to enhanced windows or to an enhanced series, and rounds to the levels of a quantised channel."""
        noisy = clean + self.draw_noise(clean, rng)
        return noisy if self.quantisation is None else self.quantisation.round(noisy)
