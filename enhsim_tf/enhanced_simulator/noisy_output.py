"""The step from coarse windows to telemetry ("Combined" in the paper's pipeline), for both kinds of model. It needs no network."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.enhanced_simulator.changes import add_changed, blend_changes, fade_length, hold_values, spans, tolerance_of
from enhsim_tf.enhanced_simulator.checks import check_finite
from enhsim_tf.enhancer.training_pairs import apply_shift_and_gain
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.telemetry.quantisation import Levels


class NoisyOutput:
    """A model with an `enhance` method, a noise model `noise` of standard deviation `noise_sd`, and the levels of its channel."""

    noise: NoiseModel
    noise_sd: float
    scale: float
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

    def complete(self, coarse: np.ndarray, levels: np.ndarray | None) -> np.ndarray:
        """Enhances coarse windows and sets the offset and gain of each, shape `(windows, 2)`; no noise is added."""
        windows = self.enhance(coarse)
        return check_finite(windows if levels is None else apply_shift_and_gain(windows, *levels.T))

    def complete_labelled(
        self,
        coarse: np.ndarray,
        nominal: np.ndarray,
        levels: np.ndarray | None,
        noise_rng: np.random.Generator | None,
        held: Sequence[tuple[int, int, int]] = (),
    ) -> tuple[np.ndarray, np.ndarray]:
        """Completes a batch of coarse windows, some of which a degraded mode has changed, and marks the changed samples.

        Args:
            coarse: Coarse windows, float32 of shape `(windows, samples)`.
            nominal: Nominal coarse windows of the same times, same shape.
            levels: Offset and gain of each window, shape `(windows, 2)`, or None for a simulator whose level is constant.
            noise_rng: Random generator of the noise, or None for windows without noise.
            held: Window, first sample and end of each range of samples at which a mechanism is stuck. Its telemetry stands still there,
                and the coarse window is not used.

        Returns:
            `(windows, mask)`: float32 windows in the telemetry's unit, and a boolean array of the same shape, which marks the samples
            that differ from the nominal windows with the same noise (see `changes`). All other samples equal them to the bit. Noise
            that follows the signal follows the nominal one.

        Raises:
            InputError: If a value is not finite.
        """
        changed = coarse != nominal
        changed[[row for row, *_ in held]] = False
        clean, mask = self.complete(nominal, levels), np.zeros(coarse.shape, bool)
        windows = clean
        tolerance = tolerance_of(self.noise_sd, self.scale) if held or changed.any() else 0.0
        if changed.any():
            degraded = self.complete(coarse, levels)
            windows, mask = blend_changes(clean, degraded, spans(changed), fade_length(coarse.shape[1]), tolerance)
        elif held:
            windows = clean.copy()
        hold_values(windows, mask, held, tolerance)
        if noise_rng is None:
            return check_finite(windows), mask
        noise = self.draw_noise(clean, noise_rng)
        return add_changed(windows, clean, noise, mask, self.quantisation)
