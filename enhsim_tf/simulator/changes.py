"""Where a degraded mode changes generated telemetry: the samples that it changes, and the mask that
marks exactly these.

The enhancer maps whole windows, so a change of a few coarse samples changes every sample of its
output, also before the change began. Generated telemetry therefore takes the enhanced degraded run
only from the first to the last coarse sample that differs from the nominal run of the same seed,
and fades into the nominal run over a sixteenth of a window on both sides. Where a mechanism is
stuck, the telemetry without noise keeps its value: the enhancer has never seen a mechanism that
stands still. Differences up to a tenth of the standard deviation of the noise are removed, so a
sample is either marked, and differs by more, or it is that of the nominal run to the bit.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse.alignment import Drawn

# largest difference from the nominal run that does not count as a change, in standard deviations of
# the noise
TOLERANCE = 0.1
LEAST_TOLERANCE = 1e-4  # of a simulator without noise, in standard deviations of the telemetry
_FADES_IN_WINDOW = 16


def fade_length(window: int) -> int:
    """Number of samples over which a change fades in and out, before and after the changed coarse
    samples of a window.
    """
    return max(1, window // _FADES_IN_WINDOW)


def borders(ranges: Sequence[tuple[int, int]], num_samples: int) -> list[int]:
    """Returns the first sample that belongs to each range, and the end of a series; what lies
    between two ranges belongs to the nearer.
    """
    middles = [(before[1] + after[0]) // 2 for before, after in itertools.pairwise(ranges)]
    return [0, *middles, num_samples]


def put_changes(
    nominal: np.ndarray,
    degraded: np.ndarray,
    drawn: Drawn,
    ranges: Sequence[tuple[int, int]],
    window: int,
    tolerance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Puts the changes of degraded runs into nominal ones; returns the float32 runs, and a mask of
    the samples that differ.

    Args:
        nominal: Enhanced nominal runs, float32 of shape `(runs, samples, channels)`.
        degraded: Enhanced degraded runs of the same times, same shape.
        drawn: The coarse runs, one column for each channel.
        ranges: First sample and end of each degraded mode, in the order of time. Each changes
            only samples within its `borders`.
        window: Length of a window, of which the runs are cross-faded over a sixteenth on each side.
        tolerance: Largest difference from the nominal run that does not count as a change, shape
            `(channels,)`.
    """
    fade = fade_length(window)
    runs = nominal.copy()
    mask = np.zeros(nominal.shape, bool)
    # from 1 where the degraded run is taken to 0 beyond the fade
    weights = 0.5 + 0.5 * np.cos(np.pi * np.arange(fade + 2) / (fade + 1))
    edges = borders(ranges, nominal.shape[1])
    for (begin, end), low, high in zip(ranges, edges[:-1], edges[1:], strict=True):
        here = slice(max(low, begin - fade), min(high, end + fade))
        inside = slice(begin - here.start, end - here.start)
        held = drawn.held[:, begin:end] - begin
        is_held = held != np.arange(end - begin)[:, None]
        differs = drawn.coarse[:, begin:end] != drawn.nominal[:, begin:end]
        rows = (differs | is_held).any(axis=(1, 2))
        differs = (differs & ~is_held)[rows]
        old = nominal[rows, here]
        # of each channel
        first = begin + differs.argmax(axis=1)[:, None]
        last = end - 1 - differs[:, ::-1].argmax(axis=1)[:, None]
        places = np.arange(nominal.shape[1])[here, None]
        # negative between the first and the last sample that differ
        distance = np.maximum(first - places, places - last)
        weight = weights[distance.clip(0, fade + 1)] * differs.any(axis=1)[:, None]
        mixed = old + weight * (np.asarray(degraded[rows, here], np.float64) - old)
        mixed = mixed.astype(np.float32)
        changed = np.abs(mixed.astype(np.float64) - old) > tolerance
        mixed = np.where(changed, mixed, old)
        moving = mixed[:, inside]
        still = np.take_along_axis(moving, held[rows], axis=1)
        stands = np.abs(moving.astype(np.float64) - still) > tolerance
        mixed[:, inside] = np.where(stands, still, moving)
        changed[:, inside] |= stands
        runs[rows, here] = np.where(changed, mixed, runs[rows, here])
        mask[rows, here] |= changed
    return runs, mask
