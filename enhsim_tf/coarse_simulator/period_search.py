"""Finds the square wave in a series by box least squares (Kovacs, Zucker and Mazeh 2002).

The series is folded at each trial frequency, and the box that explains the most variance is found from cumulative sums.
"""

from typing import NamedTuple

import numpy as np

from enhsim_tf.common.errors import InputError

_NUM_BINS = 200  # bins of a folded period
_NUM_PEAKS = 12  # highest peaks of the periodogram that are used as trial frequencies
_OVERSAMPLING = 4  # frequency oversampling of the periodogram


class Box(NamedTuple):
    """A fitted square wave: one box per cycle, in units of samples."""

    frequency: float  # cycles per sample
    begin: float  # phase at which the box begins, from 0 to 1, where sample 0 has phase 0
    duty: float  # fraction of the cycle inside the box
    low: float  # mean of the series outside the box
    high: float  # mean of the series inside the box


def fit_box(values: np.ndarray, name: str = "the series") -> Box:
    """Fits a square wave to a series of shape `(samples,)` by least squares; `name` is for the message.

    Raises:
        InputError: If the series has no period that can be found.
    """
    centred, num_samples = values - values.mean(), len(values)
    index = np.arange(num_samples, dtype=np.float64)

    # trial frequencies: peaks of the periodogram, and one half and one third of each, since harmonics may be stronger than the
    # fundamental
    power = np.abs(np.fft.rfft(centred, _OVERSAMPLING * num_samples)) ** 2
    power[: 2 * _OVERSAMPLING] = 0  # a period must occur at least twice
    peaks = 1 + np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]))
    peaks = peaks[np.argsort(power[peaks])[::-1][:_NUM_PEAKS]]
    trials = {peak / (_OVERSAMPLING * num_samples) / divisor for peak in peaks for divisor in (1, 2, 3)}
    trials = sorted(trial for trial in trials if 2 / num_samples <= trial <= 0.25)
    if not trials:
        raise InputError(
            f"Expected something periodic, at least two periods of at least four samples. Received: {name}, in which no period was found."
        )

    # refine the frequency until a step moves the last cycle by less than a thousandth of a period
    best = max(trials, key=lambda trial: _best_box(index * trial, centred)[0])
    step = 1 / (_OVERSAMPLING * num_samples)
    while step * num_samples > 1e-3:
        best = max(best + step * np.arange(-4, 5), key=lambda trial: _best_box(index * trial, centred)[0])
        step /= 3
    _, begin, duty = _best_box(index * best, centred)
    inside = np.mod(index * best - begin, 1.0) < duty
    return Box(float(best), begin, duty, float(values[~inside].mean()), float(values[inside].mean()))


def _best_box(cycles: np.ndarray, centred: np.ndarray) -> tuple[float, float, float]:
    """Finds the best box of the series folded at `cycles`; returns (explained variance, begin, duty) of the box."""
    bins = (np.mod(cycles, 1.0) * _NUM_BINS).astype(np.int64)
    counts = np.bincount(bins, minlength=_NUM_BINS)
    sums = np.bincount(bins, centred, minlength=_NUM_BINS)
    totals = np.concatenate([[0], np.cumsum(np.tile(sums, 2))])
    numbers = np.concatenate([[0], np.cumsum(np.tile(counts, 2))])
    begin, width = np.arange(_NUM_BINS)[:, None], np.arange(1, _NUM_BINS)[None]
    total, number = totals[begin + width] - totals[begin], numbers[begin + width] - numbers[begin]
    rest = len(centred) - number
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where((number > 0) & (rest > 0) & (total > 0), total**2 / number + total**2 / rest, 0) / len(centred)
    row, column = np.unravel_index(np.argmax(explained), explained.shape)
    return float(explained[row, column]), float(row / _NUM_BINS), float((column + 1) / _NUM_BINS)
