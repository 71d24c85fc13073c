"""Resampled residuals: noise models that draw whole windows of real noise (baselines of section 2.3)."""

import math
from collections.abc import Callable

import numpy as np

from enhsim_tf.common.errors import InputError

_NUM_SEGMENTS = 64  # of a window; two signals are compared by their means over these segments
_EQUAL = 0.01  # signals that differ by less than this share of their standard deviation count as equal
_BATCH = 2**24  # distances that are computed at a time
_LAST_START = 2**60  # the end of a window is still an integer of 64 bits


class WindowBootstrap:
    """Draws whole windows of real noise.

    A call first draws windows that share no sample with those it drew before: among windows that are drawn with replacement, or overlap,
    a classifier recognises what it has seen, whatever the noise is like. When no such window is left, all are drawn with replacement
    (Efron 1979). Drawing them in turn instead would put the same windows into training and threshold of a detector.

    Within a window, the noise is real, with all its correlations. A longer series consists of windows that overlap by a quarter
    and are cross-faded with a sine and a cosine. The squares of these weights add up to one, which preserves the variance,
    because two windows that are drawn at random are uncorrelated, or nearly so if there are few. The mean of all windows is not faded.

    Args:
        windows: Windows of real noise, float32 of shape `(windows, samples)`.
        starts: First sample of each window, shape `(windows,)`. None: no two windows overlap.

    Raises:
        InputError: If there is no window, a value is not finite, or `starts` are not a whole number for each window.
    """

    def __init__(self, windows: np.ndarray, starts: np.ndarray | None = None):
        self.windows, self.starts = _checked(windows, starts)

    @classmethod
    def fit(cls, windows: np.ndarray, starts: np.ndarray | None = None) -> "WindowBootstrap":
        """Stores noise windows of shape `(windows, samples)`, and where they start."""
        return cls(windows, starts)

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws windows, float32 of shape `(number, samples)`. The signal has no effect."""
        draws, everything = _SparingDraws(self, rng), np.arange(len(self.windows))
        return self.windows[[draws.draw(everything) for _ in range(number)]]

    def generate_series(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws a series of any length without seams, float32 of shape `(num_samples,)`. The signal has no effect."""
        mean = float(np.mean(self.windows, dtype=np.float64))
        return _cross_faded(self.windows.shape[1], num_samples, rng, lambda starts: (self.generate(len(starts), rng), mean))


class MatchedWindowBootstrap:
    """Draws whole windows of real noise whose signal is similar to the one that the noise is added to.

    The noise of many sensors depends on what they measure, and residuals contain errors of the enhancer, which do, too. A window of
    noise is drawn at random from those with the nearest signals: as many as the square root of the number of all windows, and all
    whose signal is the same. The distance of two signals is that of their means over 64 segments. The idea, and the number of
    neighbours, are those of the nearest-neighbour bootstrap of Lall and Sharma (1996), which resamples the successors of similar
    pasts instead. Of these windows, one is drawn as by `WindowBootstrap`. If the signal never repeats, the nearest windows can be few
    stretches of the record.

    In a longer series, the mean of the candidates, which neighbouring windows have in common, is cross-faded with weights that add
    up to one, and the rest as by `WindowBootstrap`.

    Args:
        windows: Windows of real noise, float32 of shape `(windows, samples)`.
        signals: Means of the signal below each window over segments, shape `(windows, segments)`; see `fit`.
        starts: First sample of each window, shape `(windows,)`; see `WindowBootstrap`.

    Raises:
        InputError: If there is no window, a value is not finite, the numbers of windows differ, or `starts` are not whole numbers.
    """

    def __init__(self, windows: np.ndarray, signals: np.ndarray, starts: np.ndarray | None = None):
        (self.windows, self.starts), self.signals = _checked(windows, starts), np.asarray(signals, np.float32)
        expected = (len(self.windows), min(_NUM_SEGMENTS, self.windows.shape[1]))
        if self.signals.shape != expected or not np.isfinite(self.signals).all():
            raise InputError(f"Expected the finite signal of each window, shape {expected}. Received: shape {self.signals.shape}.")

    @classmethod
    def fit(cls, windows: np.ndarray, signal: np.ndarray, starts: np.ndarray | None = None) -> "MatchedWindowBootstrap":
        """Stores noise windows, the signal below them, both of shape `(windows, samples)`, and where they start."""
        return cls(windows, _segment_means(signal, np.shape(windows)), starts)

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws windows.

        Args:
            number: Number of windows.
            rng: Random number generator.
            signal: The signal that the noise is added to, shape `(number, samples)`, in the unit of the fit.

        Returns:
            float32 array of shape `(number, samples)`.

        Raises:
            InputError: If there is no finite signal of this shape.
        """
        drawn, _ = self._draw(signal, number, rng, with_mean=False)
        return drawn

    def generate_series(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws a series of any length without seams.

        Args:
            num_samples: Length of the series.
            rng: Random number generator.
            signal: The signal that the noise is added to, shape `(num_samples,)`, in the unit of the fit.

        Returns:
            float32 array of shape `(num_samples,)`.
        """
        window, signal = self.windows.shape[1], np.asarray(signal, np.float32)
        if signal.shape != (num_samples,):
            raise InputError(f"Expected the enhanced signal of shape {(num_samples,)}, which this noise follows. Received: {signal.shape}.")

        def draw(starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            below = signal[np.clip(starts[:, None] + np.arange(window), 0, num_samples - 1)]
            return self._draw(below, len(starts), rng, with_mean=True)

        return _cross_faded(window, num_samples, rng, draw)

    def _draw(
        self, signal: np.ndarray | None, number: int, rng: np.random.Generator, with_mean: bool
    ) -> tuple[np.ndarray, np.ndarray | float]:
        """Draws windows, and computes the mean of the windows that each was drawn from."""
        from sklearn.metrics.pairwise import euclidean_distances

        window, draws = self.windows.shape[1], _SparingDraws(self, rng)
        wanted = _segment_means(signal, (number, window)).astype(np.float64)
        centre = self.signals.mean(axis=0, dtype=np.float64)
        known, wanted = self.signals - centre, wanted - centre  # smaller numbers, smaller rounding errors
        nearest = math.ceil(math.sqrt(len(known)))
        equal = _EQUAL**2 * known.shape[1] * np.var(self.signals, dtype=np.float64)
        drawn, means = np.empty((number, window), np.float32), np.empty((number if with_mean else 0, window), np.float32)
        for begin in range(0, number, max(1, _BATCH // len(known))):
            rows = slice(begin, begin + max(1, _BATCH // len(known)))
            apart = euclidean_distances(wanted[rows], known, squared=True)
            reach = np.maximum(np.partition(apart, nearest - 1, axis=1)[:, nearest - 1], equal)
            is_near = apart <= reach[:, None]
            drawn[rows] = self.windows[[draws.draw(np.flatnonzero(near)) for near in is_near]]
            if with_mean:
                means[rows] = (is_near.astype(np.float32) @ self.windows) / is_near.sum(axis=1, keepdims=True)
        return drawn, means if with_mean else 0.0


class _SparingDraws:
    """Draws windows that share no sample with those drawn before, as long as there are any.

    Args:
        noise: Its `windows` and `starts` are used.
        rng: Draws among equals.
    """

    def __init__(self, noise: WindowBootstrap | MatchedWindowBootstrap, rng: np.random.Generator):
        number, window = noise.windows.shape
        self._rng, self._is_free = rng, np.ones(number, bool)
        starts = window * np.arange(number) if noise.starts is None else noise.starts
        self._order = np.argsort(starts, kind="stable")
        apart = ((starts - window, "right"), (starts + window, "left"))
        self._first, self._last = (np.searchsorted(starts[self._order], edge, side) for edge, side in apart)

    def draw(self, candidates: np.ndarray) -> int:
        """Draws one of the given windows, and returns its number."""
        free = candidates[self._is_free[candidates]]
        drawn_from = free if len(free) else candidates
        chosen = int(drawn_from[self._rng.integers(len(drawn_from))])
        self._is_free[self._order[self._first[chosen] : self._last[chosen]]] = False
        return chosen


def _checked(windows: np.ndarray, starts: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Returns windows of noise as float32, and where they start as integers."""
    windows = np.asarray(windows, np.float32)
    if windows.ndim != 2 or windows.shape[0] < 1 or windows.shape[1] < 4 or not np.isfinite(windows).all():
        raise InputError(f"Expected finite windows of noise of at least 4 samples. Received: shape {windows.shape}. Extract noise first.")
    if starts is None:
        return windows, None
    starts = np.asarray(starts)
    if starts.shape != windows.shape[:1] or starts.dtype.kind not in "iu" or not 0 <= starts.min() <= starts.max() <= _LAST_START:
        span = f", from {starts.min()} to {starts.max()}" if starts.size and starts.dtype.kind in "iuf" else ""
        raise InputError(
            f"Expected the starts of {len(windows)} windows of noise, a whole number from 0 to {_LAST_START} for each. "
            f"Received: shape {starts.shape} of {starts.dtype}{span}. Give the first sample of each window."
        )
    return windows, starts.astype(np.int64)


def _segment_means(signal: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    """Returns the means of signals over segments of nearly equal length, shape `(windows, segments)`."""
    if signal is None or np.shape(signal) != shape:
        raise InputError(f"Expected the enhanced signal of shape {shape}, which this noise follows. Received: {np.shape(signal)}.")
    if not np.isfinite(signal).all():
        raise InputError("Expected a finite enhanced signal, which this noise follows. Received: values that are not finite.")
    edges = np.linspace(0, shape[1], min(_NUM_SEGMENTS, shape[1]) + 1).astype(int)
    return np.add.reduceat(np.asarray(signal, np.float64), edges[:-1], axis=1).astype(np.float32) / np.diff(edges).astype(np.float32)


def _cross_faded(
    window: int, num_samples: int, rng: np.random.Generator, draw: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray | float]]
) -> np.ndarray:
    """Joins windows of noise to a series without seams.

    Args:
        window: Length of a window in samples.
        num_samples: Length of the series.
        rng: Draws where the first window begins, so that every sample of the series has the same distribution.
        draw: Draws windows, given where they begin in the series, and what neighbouring windows have in common.

    Returns:
        float32 array of shape `(num_samples,)`.
    """
    fade = window // 4
    hop = window - fade
    lead = int(rng.integers(0, hop))
    num_windows = -(-(num_samples + lead + fade) // hop)
    rise = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade)
    weights = np.concatenate([rise, np.ones(window - 2 * fade), rise[::-1]])
    begin = fade + lead
    drawn, common = draw(hop * np.arange(num_windows) - begin)
    pieces = weights * (drawn - common) + weights**2 * common  # the squares of the weights of two neighbours add up to one
    series = np.zeros(num_windows * hop + fade)
    for number, piece in enumerate(pieces):
        series[number * hop : number * hop + window] += piece
    return series[begin : begin + num_samples].astype(np.float32)
