"""Noise models that draw whole windows of real noise again (an extension of section 2.3)."""

import functools
import math

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.errors import InputError

_NUM_SEGMENTS = 64  # of a window; two signals are compared by their means over these segments
# signals that differ by less than this share of their standard deviation count as equal
_EQUAL = 0.01
_BATCH = 2**19  # distances that are computed at a time, few enough for a processor's cache
_MOST_LANDMARKS = 2_500  # stored signals whose neighbours are found, which bounds the time


class WindowBootstrap:
    """Draws whole windows of real noise again, with replacement (Efron 1979), of all channels
    together, which keeps their cross-correlation.

    The noise of many sensors depends on what they measure, and so do the errors of the enhancer
    that residuals contain. If the signals below the windows are given, a window is drawn from those
    whose signals are nearest to the one that the noise is added to: as many as the square root of
    the number of all windows (Lall and Sharma 1996), and all whose signal is the same. The distance
    of two signals is that of their means over 64 segments. The neighbours of a signal are those of
    the stored signal nearest to it. If the signal never repeats, these can be few stretches of the
    record.

    A longer series consists of windows that overlap by a quarter and are cross-faded. What the
    neighbours have in common has weights that add up to one, the rest a sine and a cosine, whose
    squares do, so that the variance of uncorrelated windows stays.

    Args:
        windows: Windows of real noise, float32 of shape `(windows, samples, channels)`, or without
            the last axis.
        signals: Means of the signal below each window over segments, shape `(windows, segments)`;
            see `fit`. None: the signal has no effect.
    """

    saved = ("windows", "signals")

    def __init__(self, windows: np.ndarray, signals: np.ndarray | None = None):
        self.windows = np.asarray(windows, np.float32)
        self.signals = None if signals is None else np.asarray(signals, np.float32)

    @classmethod
    def fit(cls, windows: np.ndarray, signal: np.ndarray) -> "WindowBootstrap":
        """Stores windows of noise and the signal below them, of the same shape, which the noise
        follows.
        """
        shape = np.shape(windows)
        signal = _checked_signal(signal, shape)
        edges = _edges(shape[1])
        sums = np.add.reduceat(
            np.asarray(signal, np.float64).reshape(*shape[:2], -1), edges[:-1], axis=1
        )
        return cls(windows, (sums / np.diff(edges)[:, None]).reshape(shape[0], -1))

    def generate(
        self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None
    ) -> np.ndarray:
        """Draws windows, float32 of shape `(number, samples, channels)`; `signal` is what the noise
        is added to, in the unit of the fit.
        """
        return self.windows[self._draw(self._nearest(signal, number), rng)]

    def generate_series(
        self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None
    ) -> np.ndarray:
        """Draws a series of any length without seams, float32 of shape `(num_samples, channels)`;
        see `generate`.
        """
        window = self.windows.shape[1]
        fade = window // 4
        hop = window - fade
        # samples before the first one, so that every sample has the same distribution
        lead = fade + int(rng.integers(0, hop))
        starts = hop * np.arange(-(-(num_samples + lead) // hop)) - lead
        below = None
        if self.signals is not None:
            signal = _checked_signal(signal, (num_samples, *self.windows.shape[2:])).astype(
                np.float32
            )
            below = signal[np.clip(starts[:, None] + np.arange(window), 0, num_samples - 1)]
        near = self._nearest(below, len(starts))
        used, place = np.unique(near, return_inverse=True)
        common = np.stack([self.windows[self._groups[landmark]].mean(axis=0) for landmark in used])[
            place
        ]
        drawn = self.windows[self._draw(near, rng)]
        rise = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade)
        weights = np.concatenate([rise, np.ones(window - 2 * fade), rise[::-1]]).reshape(
            -1, *[1] * (drawn.ndim - 2)
        )
        # the squares of the weights of two neighbours add up to one
        pieces = weights * (drawn - common) + weights**2 * common
        series = np.zeros((len(starts) * hop + fade, *drawn.shape[2:]))
        for number, piece in enumerate(pieces):
            series[number * hop : number * hop + window] += piece
        return series[lead : lead + num_samples].astype(np.float32)

    def _nearest(self, signal: np.ndarray | None, number: int) -> np.ndarray:
        if self.signals is None:
            return np.zeros(number, np.int64)
        signal = _checked_signal(signal, (number, *self.windows.shape[1:]))
        with threadpool_limits(1):  # several threads take longer for products of this size
            return self._neighbours.nearest(signal.reshape(*signal.shape[:2], -1))

    def _draw(self, near: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws one of the neighbours of each landmark."""
        sizes = np.array([len(group) for group in self._groups])
        begins = np.cumsum(sizes) - sizes
        places = (rng.random(len(near)) * sizes[near]).astype(np.int64)
        return np.concatenate(self._groups)[begins[near] + places]

    @property
    def _groups(self) -> list[np.ndarray]:
        """The numbers of the windows among which is drawn at each landmark."""
        return [np.arange(len(self.windows))] if self.signals is None else self._neighbours.of

    @functools.cached_property
    def _neighbours(self) -> "_Neighbours":
        return _Neighbours(self.signals, self.windows.shape[1], math.prod(self.windows.shape[2:]))


class UnmatchedBootstrap(WindowBootstrap):
    """Draws windows of real noise again, whatever the signal is."""

    @classmethod
    def fit(cls, windows: np.ndarray, signal: np.ndarray) -> "UnmatchedBootstrap":
        """Stores windows of noise."""
        return cls(windows)


class NoNoise(WindowBootstrap):
    """Noise that is zero."""

    @classmethod
    def fit(cls, windows: np.ndarray, signal: np.ndarray) -> "NoNoise":
        """Stores one window of zeros."""
        return cls(np.zeros_like(windows[:1]))


class _Neighbours:
    """Which stored signals are nearest to a given one.

    One of each group of stored signals that count as equal is a landmark; of very many, some are.
    `of` holds, for each landmark, the numbers of the stored signals nearest to it. A given signal
    is compared with the landmarks on the principal components that hold all but a share of
    `_EQUAL**2` of the variance, each channel in its own unit.
    """

    def __init__(self, signals: np.ndarray, window: int, channels: int):
        signals = signals.reshape(len(signals), -1, channels)
        lengths = np.diff(_edges(window))
        centre = signals.mean(axis=0, dtype=np.float64).astype(np.float32)
        known = signals - centre.astype(np.float64)
        spread = np.std(known, axis=(0, 1))
        unit = np.where(spread > 0, spread, 1.0)
        known = (known / unit).reshape(len(signals), -1)
        _, sizes, axes = np.linalg.svd(known, full_matrices=False)
        held = np.cumsum(sizes[::-1] ** 2)[::-1]
        axes = axes[: max(1, np.count_nonzero(held > _EQUAL**2 * held[0]))].T
        places = known @ axes
        equal = _EQUAL**2 * len(axes)
        _, first = np.unique(
            np.round(places / math.sqrt(equal / axes.shape[1])), axis=0, return_index=True
        )
        first = first[np.linspace(0, len(first) - 1, min(len(first), _MOST_LANDMARKS)).astype(int)]
        self.of = _nearest_of(known[first], known, equal)
        landmarks = places[first].astype(np.float32)
        # the square of a distance is that of the landmark minus twice a product, beside what is the
        # same for all landmarks
        self._landmarks = landmarks.T
        self._halves = 0.5 * np.sum(landmarks**2, axis=1)
        # subtracted first: smaller numbers, smaller rounding errors
        self._centre = np.repeat(centre, lengths, axis=0)
        # from means of segments to samples
        axes = axes.reshape(-1, channels, axes.shape[1]) / (lengths[:, None, None] * unit[:, None])
        self._axes = (
            np.repeat(axes, lengths, axis=0).reshape(window * channels, -1).astype(np.float32)
        )

    def nearest(self, signal: np.ndarray) -> np.ndarray:
        """Returns the nearest landmark of each signal of shape `(windows, samples, channels)`."""
        wanted = (signal - self._centre).astype(np.float32).reshape(len(signal), -1) @ self._axes
        landmarks = np.empty(len(wanted), np.int64)
        step = max(1, _BATCH // len(self._halves))
        for begin in range(0, len(wanted), step):
            rows = slice(begin, begin + step)
            landmarks[rows] = np.argmax(wanted[rows] @ self._landmarks - self._halves, axis=1)
        return landmarks


def _nearest_of(places: np.ndarray, known: np.ndarray, equal: float) -> list[np.ndarray]:
    """For each place, the nearest known ones: as many as the square root of their number, and all
    within the squared distance `equal`.
    """
    nearest = math.ceil(math.sqrt(len(known)))
    length = np.einsum("ij,ij->i", known, known)
    neighbours = []
    step = max(1, _BATCH // len(known))
    for piece in (places[begin : begin + step] for begin in range(0, len(places), step)):
        apart = np.maximum(
            length - 2 * piece @ known.T + np.einsum("ij,ij->i", piece, piece)[:, None], 0.0
        )
        near = np.argpartition(apart, nearest - 1, axis=1)[:, :nearest]
        reach = np.take_along_axis(apart, near, axis=1).max(axis=1)
        neighbours += [
            numbers if far > equal else np.flatnonzero(row <= equal)
            for numbers, far, row in zip(near, reach, apart, strict=True)
        ]
    return neighbours


def _checked_signal(signal: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    if signal is None or np.shape(signal) != shape:
        raise InputError(
            f"Expected the enhanced signal of shape {shape}, which this noise follows. Received: "
            f"{np.shape(signal)}."
        )
    return np.asarray(signal)


def _edges(window: int) -> np.ndarray:
    """Edges of segments of nearly equal length."""
    return np.linspace(0, window, min(_NUM_SEGMENTS, window) + 1).astype(int)
