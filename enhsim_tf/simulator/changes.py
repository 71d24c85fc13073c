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
    nominal: np.ndarray,
    degraded: np.ndarray,
    drawn: Drawn,
    ranges: Iterable[tuple[int, int]],
    fade: int,
    tolerance: np.ndarray,
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
    weights = 0.5 + 0.5 * np.cos(
        np.pi * np.arange(fade + 2) / (fade + 1)
    )  # from 1 where the degraded run is taken to 0 beyond the fade
    for begin, end in ranges:
        here = slice(max(0, begin - fade), end + fade)
        own = slice(begin - here.start, end - here.start)
        held = None if drawn.held is None else drawn.held[:, begin:end] - begin
        is_held = np.False_ if held is None else held != np.arange(end - begin)[:, None]
        differs = drawn.coarse[:, begin:end] != drawn.nominal[:, begin:end]
        rows = (differs | is_held).any(axis=(1, 2))
        differs, old = (differs & ~is_held)[rows], nominal[rows, here]
        first, last = (
            begin + differs.argmax(axis=1)[:, None],
            end - 1 - differs[:, ::-1].argmax(axis=1)[:, None],
        )
        places = np.arange(nominal.shape[1])[here, None]
        distance = np.maximum(
            first - places, places - last
        )  # negative between the first and the last sample that differ
        weight = weights[distance.clip(0, fade + 1)] * differs.any(axis=1)[:, None]
        found = (old + weight * (np.asarray(degraded[rows, here], np.float64) - old)).astype(
            np.float32
        )
        changed = np.abs(found.astype(np.float64) - old) > tolerance
        found = np.where(changed, found, old)
        if held is not None:
            moving = found[:, own]
            still = np.take_along_axis(moving, held[rows], axis=1)
            stands = np.abs(moving.astype(np.float64) - still) > tolerance
            found[:, own], changed[:, own] = (
                np.where(stands, still, moving),
                changed[:, own] | stands,
            )
        runs[rows, here], mask[rows, here] = (
            np.where(changed, found, runs[rows, here]),
            mask[rows, here] | changed,
        )
    return runs, mask
