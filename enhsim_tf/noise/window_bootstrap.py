"""Resampled residuals: noise models that draw whole windows of real noise (baselines of section 2.3)."""

import functools
import math
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.errors import InputError

_NUM_SEGMENTS = 64  # of a window; two signals are compared by their means over these segments
_EQUAL = 0.01  # signals that differ by less than this share of their standard deviation count as equal
_BATCH = 2**19  # distances that are computed at a time, few enough for a processor's cache
_MOST_LANDMARKS = 2_500  # stored signals whose neighbours are found, which bounds the time
_LAST_START = 2**60  # the end of a window is still an integer of 64 bits


class WindowBootstrap:
    """Draws whole windows of real noise.

    A call first draws windows that share no sample with those it drew before, because a classifier recognises what it has seen. When none is
    left, all are drawn with replacement (Efron 1979). All channels are drawn together, so their cross-correlation is that of the real noise.

    A longer series consists of windows that overlap by a quarter and are cross-faded with a sine and a cosine. The squares of these
    weights add up to one, which preserves the variance of windows that are uncorrelated. The mean of all windows is not faded.

    Args:
        windows: Windows of real noise, float32 of shape `(windows, samples, channels)`, or without the last axis.
        starts: First sample of each window, shape `(windows,)`. None: no two windows overlap.
    """

    def __init__(self, windows: np.ndarray, starts: np.ndarray | None = None):
        self.windows, self.starts = _checked(windows, starts)

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws windows, float32 of shape `(number, samples, channels)`. The signal has no effect."""
        sparing, drawn = _Sparing(self.starts, *self.windows.shape[:2]), []
        for candidate in rng.permutation(len(self.windows)).tolist():
            if len(drawn) == number:
                break
            if sparing.is_free[candidate]:
                sparing.take(candidate)
                drawn.append(candidate)
        again = rng.integers(0, len(self.windows), number - len(drawn))
        return self.windows[np.concatenate([np.array(drawn, np.int64), again])]

    def generate_series(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws a series of any length without seams, float32 of shape `(num_samples, channels)`. The signal has no effect."""
        mean = np.mean(self.windows, axis=(0, 1), dtype=np.float64)
        return _cross_faded(self.windows.shape[1], num_samples, rng, lambda starts: (self.generate(len(starts), rng), mean))


class MatchedWindowBootstrap:
    """Draws whole windows of real noise whose signal is similar to the one that the noise is added to.

    The noise of many sensors depends on what they measure, and so do the errors of the enhancer that residuals contain. A window is drawn,
    as by `WindowBootstrap`, from those with the nearest signals: as many as the square root of the number of all windows (Lall and Sharma
    1996), and all whose signal is the same. The distance of two signals is that of their means over 64 segments. The neighbours of a
    signal are those of the stored signal nearest to it. If the signal never repeats, these can be few stretches of the record.

    In a longer series, the mean of the neighbours is cross-faded with weights that add up to one, and the rest as by `WindowBootstrap`.

    Args:
        windows: As for `WindowBootstrap`.
        signals: Means of the signal below each window over segments, shape `(windows, segments)`; see `fit`.
        starts: As for `WindowBootstrap`.
    """

    def __init__(self, windows: np.ndarray, signals: np.ndarray, starts: np.ndarray | None = None):
        (self.windows, self.starts), self.signals = _checked(windows, starts), np.asarray(signals, np.float32)
        expected = (len(self.windows), min(_NUM_SEGMENTS, self.windows.shape[1]) * math.prod(self.windows.shape[2:]))
        if self.signals.shape != expected or not np.isfinite(self.signals).all():
            raise InputError(f"Expected the finite signal of each window, shape {expected}. Received: shape {self.signals.shape}.")

    @classmethod
    def fit(cls, windows: np.ndarray, signal: np.ndarray, starts: np.ndarray | None = None) -> "MatchedWindowBootstrap":
        """Stores windows of noise, the signal below them, of the same shape, and where they start."""
        return cls(windows, _segment_means(signal, np.shape(windows)), starts)

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws windows, float32 of the shape of `signal`, the signal that the noise is added to, in the unit of the fit."""
        return self.windows[self._draw(self._nearest(signal, number), rng)]

    def generate_series(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws a series of any length without seams, float32 of the shape of `signal`: `(num_samples, channels)`; see `generate`."""
        window, signal = self.windows.shape[1], _checked_signal(signal, (num_samples, *self.windows.shape[2:])).astype(np.float32)

        def draw(starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            near = self._nearest(signal[np.clip(starts[:, None] + np.arange(window), 0, num_samples - 1)], len(starts))
            used, place = np.unique(near, return_inverse=True)
            means = np.stack([self.windows[self._neighbours.of[each]].mean(axis=0) for each in used])
            return self.windows[self._draw(near, rng)], means[place]

        return _cross_faded(window, num_samples, rng, draw)

    def _nearest(self, signal: np.ndarray | None, number: int) -> np.ndarray:
        signal = _checked_signal(signal, (number, *self.windows.shape[1:]))
        with threadpool_limits(1):  # several threads take longer for products of this size
            return self._neighbours.nearest(signal.reshape(*signal.shape[:2], -1))

    def _draw(self, near: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws one of the neighbours of each landmark, one that shares no sample with those drawn before if there is one."""
        neighbours, sparing = self._neighbours.of, _Sparing(self.starts, *self.windows.shape[:2])
        sizes = np.array([len(some) for some in neighbours])
        begins, places = np.cumsum(sizes) - sizes, rng.random(len(near))
        chosen, spent = np.concatenate(neighbours)[begins[near] + (places * sizes[near]).astype(int)], set()
        for row, landmark in enumerate(near.tolist()):
            if landmark in spent:
                continue
            free = neighbours[landmark][sparing.is_free[neighbours[landmark]]]
            if len(free):
                chosen[row] = free[int(places[row] * len(free))]
                sparing.take(chosen[row])
            else:
                spent.add(landmark)  # what was drawn is never free again
        return chosen

    @functools.cached_property
    def _neighbours(self) -> "_Neighbours":
        return _Neighbours(self.signals, self.windows.shape[1], math.prod(self.windows.shape[2:]))


class _Neighbours:
    """Which stored signals are nearest to a given one.

    One of each group of stored signals that count as equal is a landmark; of very many, some are. `of` holds, for each landmark, the numbers of
    the stored signals nearest to it. A given signal is compared with the landmarks on the principal components that hold all but a
    share of `_EQUAL**2` of the variance, each channel in its own unit.
    """

    def __init__(self, signals: np.ndarray, window: int, channels: int):
        signals = signals.reshape(len(signals), -1, channels)
        lengths, centre = np.diff(_edges(window)), signals.mean(axis=0, dtype=np.float64).astype(np.float32)
        known = signals - centre.astype(np.float64)
        spread = np.std(known, axis=(0, 1))
        unit = np.where(spread > 0, spread, 1.0)
        known = (known / unit).reshape(len(signals), -1)
        _, sizes, axes = np.linalg.svd(known, full_matrices=False)
        held = np.cumsum(sizes[::-1] ** 2)[::-1]
        axes = axes[: max(1, np.count_nonzero(held > _EQUAL**2 * held[0]))].T
        places, equal = known @ axes, _EQUAL**2 * len(axes)
        _, first = np.unique(np.round(places / math.sqrt(equal / axes.shape[1])), axis=0, return_index=True)
        first = first[np.linspace(0, len(first) - 1, min(len(first), _MOST_LANDMARKS)).astype(int)]
        self.of, landmarks = _nearest_of(known[first], known, equal), places[first].astype(np.float32)
        # the square of a distance is that of the landmark minus twice a product, beside what is the same for all landmarks
        self._landmarks, self._halves = landmarks.T, 0.5 * np.sum(landmarks**2, axis=1)
        self._centre = np.repeat(centre, lengths, axis=0)  # subtracted first: smaller numbers, smaller rounding errors
        axes = axes.reshape(-1, channels, axes.shape[1]) / (lengths[:, None, None] * unit[:, None])  # from means of segments to samples
        self._axes = np.repeat(axes, lengths, axis=0).reshape(window * channels, -1).astype(np.float32)

    def nearest(self, signal: np.ndarray) -> np.ndarray:
        """Returns the nearest landmark of each signal of shape `(windows, samples, channels)`."""
        wanted = (signal - self._centre).astype(np.float32).reshape(len(signal), -1) @ self._axes
        found, step = np.empty(len(wanted), np.int64), max(1, _BATCH // len(self._halves))
        for begin in range(0, len(wanted), step):
            rows = slice(begin, begin + step)
            found[rows] = np.argmax(wanted[rows] @ self._landmarks - self._halves, axis=1)
        return found


def _nearest_of(places: np.ndarray, known: np.ndarray, equal: float) -> list[np.ndarray]:
    """For each place, the nearest known ones: as many as the square root of their number, and all within the squared distance `equal`."""
    nearest, length, found = math.ceil(math.sqrt(len(known))), np.einsum("ij,ij->i", known, known), []
    step = max(1, _BATCH // len(known))
    for some in (places[begin : begin + step] for begin in range(0, len(places), step)):
        apart = np.maximum(length - 2 * some @ known.T + np.einsum("ij,ij->i", some, some)[:, None], 0.0)
        near = np.argpartition(apart, nearest - 1, axis=1)[:, :nearest]
        reach = np.take_along_axis(apart, near, axis=1).max(axis=1)
        found += [own if far > equal else np.flatnonzero(row <= equal) for own, far, row in zip(near, reach, apart, strict=True)]
    return found


class _Sparing:
    """Which windows share no sample with those that were drawn before, given their starts; None: no two windows overlap."""

    def __init__(self, starts: np.ndarray | None, number: int, window: int):
        starts = window * np.arange(number) if starts is None else starts
        self.is_free, self._order = np.ones(number, bool), np.argsort(starts, kind="stable")
        apart = ((starts - window, "right"), (starts + window, "left"))
        self._first, self._last = (np.searchsorted(starts[self._order], edge, side) for edge, side in apart)

    def take(self, chosen: int) -> None:
        """Notes that a window was drawn."""
        self.is_free[self._order[self._first[chosen] : self._last[chosen]]] = False


def _checked(windows: np.ndarray, starts: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Returns windows of noise as float32, and where they start as integers."""
    windows = np.asarray(windows, np.float32)
    if windows.ndim not in (2, 3) or windows.shape[0] < 1 or windows.shape[1] < 4 or not np.isfinite(windows).all():
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


def _checked_signal(signal: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    if signal is None or np.shape(signal) != shape:
        raise InputError(f"Expected the enhanced signal of shape {shape}, which this noise follows. Received: {np.shape(signal)}.")
    if not np.isfinite(signal).all():
        raise InputError("Expected a finite enhanced signal, which this noise follows. Received: values that are not finite.")
    return np.asarray(signal)


def _edges(window: int) -> np.ndarray:
    """Edges of segments of nearly equal length."""
    return np.linspace(0, window, min(_NUM_SEGMENTS, window) + 1).astype(int)


def _segment_means(signal: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    """Returns the means of signals over segments, shape `(windows, segments * channels)`."""
    signal, edges = _checked_signal(signal, shape), _edges(shape[1])
    sums = np.add.reduceat(np.asarray(signal, np.float64).reshape(*shape[:2], -1), edges[:-1], axis=1)
    return (sums / np.diff(edges)[:, None]).reshape(shape[0], -1).astype(np.float32)


def _cross_faded(
    window: int, num_samples: int, rng: np.random.Generator, draw: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray | float]]
) -> np.ndarray:
    """Joins windows of noise to a series without seams; `draw` returns windows that begin at given samples, and what neighbours have in common."""
    fade = window // 4
    hop = window - fade
    lead = int(rng.integers(0, hop))  # where the first window begins, so that every sample has the same distribution
    num_windows = -(-(num_samples + lead + fade) // hop)
    rise = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade)
    weights = np.concatenate([rise, np.ones(window - 2 * fade), rise[::-1]])
    begin = fade + lead
    drawn, common = draw(hop * np.arange(num_windows) - begin)
    weights = weights.reshape(-1, *[1] * (drawn.ndim - 2))
    pieces = weights * (drawn - common) + weights**2 * common  # the squares of the weights of two neighbours add up to one
    series = np.zeros((num_windows * hop + fade, *drawn.shape[2:]))
    for number, piece in enumerate(pieces):
        series[number * hop : number * hop + window] += piece
    return series[begin : begin + num_samples].astype(np.float32)
