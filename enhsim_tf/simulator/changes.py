"""Where a degraded mode changes generated telemetry: the samples that it changes, and the mask that marks exactly these.

The enhancer maps whole windows, so a change of a few coarse samples changes every sample of its output, also before the change
began. Generated telemetry therefore takes the enhanced degraded run only from the first to the last coarse sample that differs
from the nominal run of the same seed. Over a sixteenth of a window on both sides it fades into the enhanced nominal run, and
beyond that it equals the nominal run to the bit. Where a mechanism is stuck, the telemetry without noise keeps the value that it had
when the mechanism stopped: the enhancer has never seen a mechanism that stands still, and its output moves on. Differences up to a
tenth of the standard deviation of the noise are removed. A sample is therefore either marked, and differs by more than that
tolerance, or it is the sample of the nominal run.
"""

from collections.abc import Iterable

import numpy as np

from enhsim_tf.simulator.checks import check_finite
from enhsim_tf.telemetry.quantisation import Levels

TOLERANCE = 0.1  # largest difference from the nominal run that does not count as a change, in standard deviations of the noise
_LEAST_TOLERANCE = 1e-4  # of a simulator without noise, in units of the enhancer's scale
_FADES_IN_WINDOW = 16


def tolerance_of(noise_sd: float, scale: float) -> float:
    """Returns the largest difference from the nominal run that does not count as a change, in the unit of the telemetry.

    Args:
        noise_sd: Standard deviation of the generated noise.
        scale: Size of 1 in the enhancer's normalised units.
    """
    return max(TOLERANCE * noise_sd, _LEAST_TOLERANCE * scale)


def spans(changed: np.ndarray) -> np.ndarray:
    """Marks all samples from the first to the last changed one of each row.

    Args:
        changed: Boolean array of shape `(rows, samples)`.

    Returns:
        Boolean array of the same shape.
    """
    started = np.logical_or.accumulate(changed, axis=1)
    unfinished = np.logical_or.accumulate(changed[:, ::-1], axis=1)[:, ::-1]
    return started & unfinished


def fade_length(window: int) -> int:
    """Number of samples over which a change fades in and out, before and after the changed coarse samples.

    Args:
        window: Length of a window in samples.
    """
    return max(1, window // _FADES_IN_WINDOW)


def blend_changes(
    nominal: np.ndarray, degraded: np.ndarray, inside: np.ndarray, fade: int, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Puts the changes of a degraded run into the nominal run.

    Args:
        nominal: Enhanced nominal run, float32 of shape `(rows, samples)`.
        degraded: Enhanced degraded run of the same times, same shape.
        inside: Boolean array of the same shape, which marks the samples that the degraded run determines.
        fade: Number of samples on each side over which the runs are cross-faded.
        tolerance: Largest difference from the nominal run that does not count as a change.

    Returns:
        `(blended, mask)`: the float32 run, and a boolean array that marks the samples that differ from the nominal run. All other
        samples equal it to the bit.
    """
    weight = inside.astype(np.float64)
    for distance in range(1, fade + 1):
        share = 0.5 + 0.5 * np.cos(np.pi * distance / (fade + 1))
        weight[:, :-distance] = np.maximum(weight[:, :-distance], share * inside[:, distance:])
        weight[:, distance:] = np.maximum(weight[:, distance:], share * inside[:, :-distance])
    blended = (nominal + weight * (np.asarray(degraded, np.float64) - nominal)).astype(np.float32)
    mask = np.abs(blended.astype(np.float64) - nominal) > tolerance
    return np.where(mask, blended, nominal), mask


def hold_values(windows: np.ndarray, mask: np.ndarray, held: Iterable[tuple[int, int, int]], tolerance: float) -> None:
    """Puts the changes of stuck mechanisms into runs that are nominal there, and marks them, both in place.

    Args:
        windows: Enhanced run, float32 of shape `(rows, samples)`.
        mask: Boolean array of the same shape.
        held: Row, first sample and end of each range of samples that keeps the value of its first sample.
        tolerance: Largest difference from the nominal run that does not count as a change.
    """
    rows_of: dict[tuple[int, int], list[int]] = {}
    for row, begin, end in held:
        rows_of.setdefault((begin, end), []).append(row)
    for (begin, end), rows in rows_of.items():
        pieces = windows[rows, begin:end]
        changed = np.abs(pieces.astype(np.float64) - pieces[:, :1]) > tolerance
        windows[rows, begin:end] = np.where(changed, pieces[:, :1], pieces)
        mask[rows, begin:end] |= changed


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
