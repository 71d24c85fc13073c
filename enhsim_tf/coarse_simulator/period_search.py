"""The square wave that is in a series: box least squares (Kovacs, Zucker and Mazeh 2002).

For each trial frequency the series is folded, and the box that explains most variance is read off cumulative sums.
"""

import dataclasses

import numpy as np

from enhsim_tf.common.errors import InputError

_NUM_BINS = 200  # of a folded period
_NUM_PEAKS = 12  # of the periodogram, followed up
_OVERSAMPLING = 4  # of the periodogram


@dataclasses.dataclass(frozen=True)
class Box:
    """A square wave in units of samples.

    Args:
        frequency: Cycles a sample.
        begin: Where in the cycle of sample 0 the box begins, from 0 to 1.
        duty: Share of the cycle inside the box.
        low: Mean outside the box.
        high: Mean inside the box.
        explained: Variance that the wave explains.
    """

    frequency: float
    begin: float
    duty: float
    low: float
    high: float
    explained: float


def fit_box(values: np.ndarray, name: str = "the series") -> Box:
    """Fits the square wave that explains most of a series in the least-squares sense.

    Args:
        values: Series of shape `(samples,)`.
        name: What the series is called, for the message.

    Raises:
        InputError: If nothing periodic is found.
    """
    centred, num_samples = values - values.mean(), len(values)
    index = np.arange(num_samples, dtype=np.float64)

    # trial frequencies: peaks of the periodogram, and their halves and thirds for a wave whose harmonics are stronger
    # than its fundamental
    power = np.abs(np.fft.rfft(centred, _OVERSAMPLING * num_samples)) ** 2
    power[: 2 * _OVERSAMPLING] = 0  # below two cycles nothing is periodic
    peaks = 1 + np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]))
    peaks = peaks[np.argsort(power[peaks])[::-1][:_NUM_PEAKS]]
    trials = {peak / (_OVERSAMPLING * num_samples) / divisor for peak in peaks for divisor in (1, 2, 3)}
    trials = sorted(trial for trial in trials if 2 / num_samples <= trial <= 0.25)
    if not trials:
        raise InputError(f"Expected something periodic, at least two periods of at least four samples. Received: {name}, which is not.")

    # refine until the last cycle moves by less than a thousandth of a period
    best = max(trials, key=lambda trial: _best_box(index * trial, centred)[0])
    step = 1 / (_OVERSAMPLING * num_samples)
    while step * num_samples > 1e-3:
        best = max(best + step * np.arange(-4, 5), key=lambda trial: _best_box(index * trial, centred)[0])
        step /= 3
    explained, begin, duty = _best_box(index * best, centred)
    inside = np.mod(index * best - begin, 1.0) < duty
    return Box(float(best), begin, duty, float(values[~inside].mean()), float(values[inside].mean()), explained)


def _best_box(cycles: np.ndarray, centred: np.ndarray) -> tuple[float, float, float]:
    """The best high box of a series folded on `cycles`: (variance explained, where it begins, its duty)."""
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
