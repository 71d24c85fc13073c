"""Where a degraded mode changes generated telemetry: the samples that it changes, and the mask that marks exactly these.

The enhancer maps whole windows, so a change of a few coarse samples changes every sample of its output, also before the change began.
Generated telemetry therefore takes the enhanced degraded run only from the first to the last coarse sample that differs from the nominal run
of the same seed, and fades into the nominal run over a sixteenth of a window on both sides. Where a mechanism is stuck, the telemetry without
noise keeps its value: the enhancer has never seen a mechanism that stands still. Differences up to a tenth of the standard deviation of the
noise are removed, so a sample is either marked, and differs by more, or it is that of the nominal run to the bit.
"""

from collections.abc import Iterable

import numpy as np

from enhsim_tf.simulator.alignment import Drawn

TOLERANCE = 0.1  # largest difference from the nominal run that does not count as a change, in standard deviations of the noise
LEAST_TOLERANCE = 1e-4  # of a simulator without noise, in standard deviations of the telemetry
_FADES_IN_WINDOW = 16


def fade_length(window: int) -> int:
    """Number of samples over which a change fades in and out, before and after the changed coarse samples of a window."""
    return max(1, window // _FADES_IN_WINDOW)


def put_changes(
    nominal: np.ndarray, degraded: np.ndarray, drawn: Drawn, ranges: Iterable[tuple[int, int]], fade: int, tolerance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Puts the changes of degraded runs into nominal ones; returns the float32 runs, and a mask of the samples that differ.

    Args:
        nominal: Enhanced nominal runs, float32 of shape `(runs, samples, channels)`.
        degraded: Enhanced degraded runs of the same times, same shape.
        drawn: The coarse runs, one column for each channel.
        ranges: First sample and end of each degraded mode.
        fade: Number of samples on each side over which the runs are cross-faded.
        tolerance: Largest difference from the nominal run that does not count as a change, shape `(channels,)`.
    """
    runs, mask = nominal.copy(), np.zeros(nominal.shape, bool)
    for begin, end in ranges:
        here = slice(max(0, begin - fade), end + fade)
        own, inside = slice(begin - here.start, end - here.start), np.zeros(nominal[:, here].shape, bool)
        differs = drawn.coarse[:, begin:end] != drawn.nominal[:, begin:end]
        if drawn.held is not None:
            held = drawn.held[:, begin:end] - begin
            differs &= held == np.arange(end - begin)[:, None]
        begun, unfinished = (np.logical_or.accumulate(each, axis=1) for each in (differs, differs[:, ::-1]))
        inside[:, own] = begun & unfinished[:, ::-1]  # from the first to the last sample that differs
        found, changed = _cross_faded(nominal[:, here], degraded[:, here], inside, fade, tolerance)
        if drawn.held is not None:
            moving = found[:, own]
            still = np.take_along_axis(moving, held, axis=1)
            stands = np.abs(moving.astype(np.float64) - still) > tolerance
            found[:, own], changed[:, own] = np.where(stands, still, moving), changed[:, own] | stands
        runs[:, here], mask[:, here] = np.where(changed, found, runs[:, here]), mask[:, here] | changed
    return runs, mask


def _cross_faded(
    nominal: np.ndarray, degraded: np.ndarray, inside: np.ndarray, fade: int, tolerance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Takes the degraded run inside and fades into the nominal one around it; the second result marks what differs."""
    weight = inside.astype(np.float64)
    for distance in range(1, fade + 1):
        share = 0.5 + 0.5 * np.cos(np.pi * distance / (fade + 1))
        weight[:, :-distance] = np.maximum(weight[:, :-distance], share * inside[:, distance:])
        weight[:, distance:] = np.maximum(weight[:, distance:], share * inside[:, :-distance])
    blended = (nominal + weight * (np.asarray(degraded, np.float64) - nominal)).astype(np.float32)
    mask = np.abs(blended.astype(np.float64) - nominal) > tolerance
    return np.where(mask, blended, nominal), mask
