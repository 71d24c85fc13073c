"""The step that all generation of windows shares: one batch from coarse windows to telemetry ("Combined" in the paper's pipeline)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.enhanced_simulator.changes import blend_changes, fade_length, hold_values, spans, tolerance_of
from enhsim_tf.enhanced_simulator.checks import check_finite
from enhsim_tf.enhancer.training_pairs import apply_shift_and_gain
from enhsim_tf.telemetry.quantisation import Levels

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator


def complete_batch(
    simulator: "EnhancedSimulator", coarse: np.ndarray, levels: np.ndarray | None, noise_rng: np.random.Generator | None
) -> np.ndarray:
    """Enhances coarse windows, sets their level and adds noise.

    Args:
        simulator: The simulator.
        coarse: Coarse windows, float32 of shape `(windows, samples)`.
        levels: Offset and gain of each window, shape `(windows, 2)`, or None for a simulator whose level is constant.
        noise_rng: Random generator of the noise, or None for windows without noise.

    Returns:
        float32 array of the same shape, in the telemetry's unit.

    Raises:
        InputError: If a value is not finite.
    """
    windows = simulator.enhance(coarse)
    if levels is not None:
        windows = apply_shift_and_gain(windows, *levels.T)
    return check_finite(windows if noise_rng is None else simulator.add_noise(windows, noise_rng))


def complete_labelled_batch(
    simulator: "EnhancedSimulator",
    coarse: np.ndarray,
    nominal: np.ndarray,
    levels: np.ndarray | None,
    noise_rng: np.random.Generator | None,
    held: Sequence[tuple[int, int, int]] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Completes a batch of coarse windows, some of which a degraded mode has changed, and marks the changed samples.

    Args:
        simulator: The simulator.
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
    clean, mask = complete_batch(simulator, nominal, levels, None), np.zeros(coarse.shape, bool)
    windows = clean
    tolerance = tolerance_of(simulator.noise_sd, simulator.scale) if held or changed.any() else 0.0
    if changed.any():
        degraded = complete_batch(simulator, coarse, levels, None)
        windows, mask = blend_changes(clean, degraded, spans(changed), fade_length(coarse.shape[1]), tolerance)
    elif held:
        windows = clean.copy()
    hold_values(windows, mask, held, tolerance)
    if noise_rng is None:
        return check_finite(windows), mask
    noise = simulator.draw_noise(clean, noise_rng)
    return add_changed(windows, clean, noise, mask, simulator.quantisation)


def add_changed(
    changed: np.ndarray, nominal: np.ndarray, noise: np.ndarray, mask: np.ndarray, quantisation: Levels | None
) -> tuple[np.ndarray, np.ndarray]:
    """Adds noise to a run with changes, and keeps the mask true where quantisation removes a change.

    Args:
        changed: Run with changes, without noise.
        nominal: The nominal run of the same shape, without noise.
        noise: Noise of the same shape.
        mask: Marks the samples at which both runs differ.
        quantisation: Levels to which the sum is rounded, or None.

    Returns:
        `(values, mask)`: float32 values, and a boolean array that marks those that differ from the nominal run with the same noise.

    Raises:
        InputError: If a value is not finite.
    """
    values = check_finite(changed + noise)
    if quantisation is None:
        return values, mask
    values = quantisation.round(values)
    return values, mask & (values != quantisation.round(nominal + noise))
