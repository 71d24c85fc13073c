"""Sequences that detectors find at matched false-alarm rates, and how many they would find by chance.

Detectors whose thresholds give different false-alarm rates cannot be compared by what they find. Here each threshold is set such
that at most the same share of the nominal test windows is above it. Chance is what the same scores find when the labels are
shifted around the circle of the test record; the threshold is set anew for each shift, so the comparison is exact if scores and
labels are unrelated.

Scores are given as ranks: the rank of a window is the number of windows whose score is at most its own.
"""

from collections.abc import Sequence

import numpy as np

RATES = (0.01, 0.05, 0.1)
"""Shares of nominal test windows at which finds are compared."""


def windows_that_meet(begins: np.ndarray, window: int, num_samples: int, ranges: Sequence[tuple[int, int]], shift: int = 0) -> np.ndarray:
    """Tells which windows share a sample with which labelled range, after the labels were shifted around the circle.

    Args:
        begins: First sample of each window, shape `(windows,)`.
        window: Length of a window in samples.
        num_samples: Length of the record, the circumference of the circle.
        ranges: Labelled samples, as half-open ranges.
        shift: Number of samples by which the labels are shifted.

    Returns:
        Boolean array of shape `(ranges, windows)`.
    """
    bounds = np.asarray(ranges, np.int64).reshape(-1, 2)
    ahead = (bounds[:, :1] + shift - begins) % num_samples  # from the first sample of the window to that of the range
    return (ahead < window) | ((-ahead) % num_samples < np.diff(bounds, axis=1))


def shifts_around(num_samples: int, stride: int) -> np.ndarray:
    """Returns every shift of the labels by a multiple of the stride, the first of which is 0."""
    return np.arange(0, num_samples, stride)


def matched_thresholds(ranks: np.ndarray, is_nominal: np.ndarray, rates: Sequence[float] = RATES) -> np.ndarray:
    """Returns the lowest thresholds of each detector that at most these shares of the nominal windows are above.

    Args:
        ranks: Ranks of the scores, shape `(detectors, windows)`.
        is_nominal: Which windows are nominal, shape `(windows,)`.
        rates: Largest shares of nominal windows above the threshold.

    Returns:
        Ranks, shape `(rates, detectors)`.
    """
    nominal = np.sort(ranks[:, is_nominal], axis=1, kind="stable")
    return np.stack([nominal[:, -1 - int(np.floor(rate * nominal.shape[1] + 1e-9))] for rate in rates])


def finds_by_shift(
    ranks: np.ndarray,
    begins: np.ndarray,
    window: int,
    num_samples: int,
    ranges: Sequence[tuple[int, int]],
    thresholds: np.ndarray,
    rates: Sequence[float] = RATES,
) -> np.ndarray:
    """Finds of each detector for the labels as they are, and for the labels shifted around the circle.

    Args:
        ranks: Ranks of the scores, shape `(detectors, windows)`.
        begins: First sample of each window, evenly spaced.
        window: Length of a window in samples.
        num_samples: Length of the record.
        ranges: Labelled samples, as half-open ranges.
        thresholds: Further thresholds, which do not depend on the labels, shape `(rules, detectors)`.
        rates: False-alarm rates at which thresholds are matched.

    Returns:
        Boolean array of shape `(shifts, rates + rules, detectors, sequences)`. The first shift is 0.
    """
    found = []
    for shift in shifts_around(num_samples, int(begins[1] - begins[0]) if len(begins) > 1 else window):
        meets = windows_that_meet(begins, window, num_samples, ranges, int(shift))
        limits = np.concatenate([matched_thresholds(ranks, ~meets.any(axis=0), rates), thresholds])
        found.append(np.stack([(ranks[:, windows] > limits[..., None]).any(axis=2) for windows in meets], axis=2))
    return np.array(found)


def chance_of(by_shift: Sequence[np.ndarray], num_draws: int = 20_000, seed: int = 0) -> tuple[float, float]:
    """Expected number of finds by chance, and the probability that chance finds as many as were found.

    The labels of each channel are shifted independently.

    Args:
        by_shift: For each channel, the number of finds for each shift, shape `(shifts,)`, unshifted labels first. A number may be a
            mean over detectors.
        num_draws: Draws of one shift per channel.
        seed: Seed of the draws.

    Returns:
        The expected number, and the p-value. The unshifted labels count as one of the draws, so it is not below `1 / (num_draws + 1)`.
    """
    rng = np.random.default_rng(seed)
    drawn = sum(counts[rng.integers(0, len(counts), num_draws)] for counts in by_shift)
    found = sum(counts[0] for counts in by_shift)
    as_many = int(np.sum(drawn >= found - 1e-9))
    return float(sum(np.mean(counts) for counts in by_shift)), (as_many + 1) / (num_draws + 1)
