"""Scores series by several views of their windows, with one threshold.

The score of a window is the sum of its views, each divided by a high quantile of its own nominal
scores. The score of a sample is the mean of those of all windows that hold it. Nominal
scores are those of views that have not learnt the block of time in which the window lies.

Constants were set on 29 channels of SMAP and MSL and sixteen experiments of SKAB's `valve1` on
2026-11-27, with leave-one-series-out; see `studies/public_benchmarks`.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.scoring.metrics import finite_threshold
from enhsim_tf.scoring.views import JOINT_VIEWS, VIEWS, View
from enhsim_tf.telemetry.windows import longest_window, mean_over_windows, run_starts

# length of the windows of views, in samples
LEAST_WINDOW = 16
MOST_WINDOW = 64
_OVERLAP = 8  # scored windows that begin within one window length
_LEARNT_OVERLAP = 16  # learnt ones
_MOST_LEARNT = 2_000  # most windows that views learn
_MOST_LEARNT_VALUES = 1_500_000  # most values of these
_LEAST_LEARNT = 200  # windows, however many channels
_LEAST_WINDOWS = 8  # of nominal telemetry
_LEAST_UNIT = 0.01  # of a view
_LEAST_THRESHOLD = 1.0  # one view at its quantile
_TIES = 1.001  # times the threshold: a repeated window has the same score, but for rounding
# relative to the level: a deviation that is rounding error, and the unit of a channel without more
_ROUNDING = 1e-12
_UNIT = 1e-6
_MOST_SIZE = 1e9  # largest value in units of the channel, whose squares float32 can hold
# values of windows that are scored at a time; of more, the kernel zeroes the pages again and again
_CHUNK_VALUES = 60_000
MOST_NOMINAL = 1_000_000
"""Most values of the nominal series that a model keeps."""
_STRETCH = 512  # samples of the stretches that are kept of longer ones


@dataclasses.dataclass(frozen=True)
class Constants:
    """What scorers of all data have in common. `studies/public_benchmarks` tries other values.

    Args:
        longest_window: Length of the longest windows in samples.
        windows_in_record: Windows in a nominal record that is too short for the longest ones.
        num_blocks: Blocks of time, each of which is scored by views that have learnt the others.
        quantile: Quantile of the nominal scores of a view that is its unit.
    """

    longest_window: int = MOST_WINDOW
    windows_in_record: int = 25
    num_blocks: int = 4
    quantile: float = 0.99


CONSTANTS = Constants()


@dataclasses.dataclass(frozen=True, eq=False)
class Scores:
    """The scores of one series.

    Args:
        samples: The score of each sample in units of the threshold, float64 of shape `(samples,)`.
        begins: The first samples of the windows that were scored, shape `(windows,)`.
        by_view: What each view adds to the score of each window, shape `(views, windows)`. Values
            above 1 are beyond the quantile of nominal windows.
    """

    samples: np.ndarray
    begins: np.ndarray
    by_view: np.ndarray


class Scorer:
    """Several views of nominal series, and the threshold of their sum.

    Args:
        nominal: Nominal series without gaps, each of shape `(samples, channels)`.
        false_alarm_rate: Share of nominal samples to flag.
        views: The views by name. None: those of `VIEWS`, and of several channels also those of
            `JOINT_VIEWS`.
        constants: What scorers of all data have in common.

    Attributes:
        window: Length of the windows in samples: 64, or a twenty-fifth of a record that is shorter
            than 1,600 samples, but at least 16; less where too few parts are that long.
        threshold: The conformal threshold of the sum, and a thousandth of it for rounding: the
            larger one of all nominal samples and of the last block of them. Where there are too few
            windows for the rate, that of the largest score.
        rate: The false-alarm rate that the threshold is set for.
        nominal_scores: Scores of the nominal samples in units of the threshold, from views that
            have not learnt them, in the order of time.
        nominal_edges: The first samples of the nominal series in them, and their number.

    Raises:
        InputError: If no series has a window, or the rate is not between 0 and 1.

    Example:
    >>> scorer = Scorer([nominal])
    >>> is_anomalous = scorer.score(new).samples > 1
    """

    def __init__(
        self,
        nominal: Sequence[np.ndarray],
        false_alarm_rate: float = 0.01,
        views: Mapping[str, Callable[[], View]] | None = None,
        constants: Constants = CONSTANTS,
    ):
        total = sum(map(len, nominal))
        share = total // constants.windows_in_record
        most = int(np.clip(share, LEAST_WINDOW, constants.longest_window))
        window = longest_window(nominal, most, LEAST_WINDOW, _LEAST_WINDOWS)
        if window is None:
            raise InputError(
                f"Expected nominal telemetry of at least {_LEAST_WINDOWS * LEAST_WINDOW} samples "
                f"in parts of {LEAST_WINDOW} or more. Received: {total} samples. Give more "
                "telemetry."
            )
        self.window = window
        nominal = [part for part in nominal if len(part) >= window]
        if views is None:
            views = VIEWS | (JOINT_VIEWS if nominal[0].shape[1] > 1 else {})
        self.names = tuple(views)
        self._make = tuple(views.values())
        values = np.concatenate(nominal).astype(np.float64)
        self._centre = np.median(values, axis=0)
        deviation = values.std(axis=0)
        level = np.maximum(np.abs(self._centre), _UNIT)
        self._scale = np.where(deviation > _ROUNDING * level, deviation, _UNIT * level)
        series = [self._in_units(part) for part in nominal]
        raw, begins, last_block = self._cross_fitted(series, constants.num_blocks)
        units = np.quantile(raw, constants.quantile, axis=1)
        self._unit = np.maximum(units, _LEAST_UNIT)[:, None]
        sums = np.split((raw / self._unit).sum(axis=0), np.cumsum([*map(len, begins)])[:-1])
        lengths = list(map(len, series))
        scores = np.concatenate(list(map(self._of_samples, sums, begins, lengths)))
        self.nominal_edges = np.cumsum([0, *lengths]).tolist()

        def limit_of(scores: np.ndarray, num_samples: int) -> tuple[float, float]:
            return finite_threshold(scores, false_alarm_rate, num_samples // window)

        whole, self.rate = limit_of(scores, len(scores))
        late, _ = limit_of(scores[last_block:], len(scores) - last_block)
        self.threshold = _TIES * max(_LEAST_THRESHOLD, whole, late)
        of_windows, _ = limit_of(np.concatenate(sums), len(scores))
        self._threshold_of_windows = max(self.threshold, of_windows)
        self.nominal_scores = scores / self.threshold

    def score(self, series: np.ndarray) -> Scores:
        """Scores a series without gaps, shape `(samples, channels)`, of at least a window."""
        begins = run_starts(len(series), self.window, self.window // _OVERLAP)
        by_view = self._judged(series, begins)
        samples = self._of_samples(by_view.sum(axis=0), begins, len(series))
        # means of fewer windows than those of the threshold scatter more
        is_short = len(series) < 2 * self.window - 1
        threshold = self._threshold_of_windows if is_short else self.threshold
        return Scores(samples / threshold, begins, by_view)

    def window_scores(self, series: np.ndarray) -> np.ndarray:
        """Returns the score of the window that ends with each sample of a series, in units of the
        threshold: what a scorer knows that has seen only the past. The first `window - 1` samples
        have that of the first window.
        """
        begins = np.arange(len(series) - self.window + 1)
        sums = self._judged(series, begins).sum(axis=0) / self.threshold
        return np.concatenate([np.full(self.window - 1, sums[0]), sums])

    def shares(self, window: np.ndarray) -> np.ndarray:
        """Returns how much of the score of one window, shape `(samples, channels)`, each channel
        raises: the mean of how far the score falls if the channel is that of the nearest learnt
        window, and of how far it rises if it alone is put into that.
        """
        given = self._in_units(window)
        number = given.shape[1]
        nearest = self._learnt[np.argmin(np.sum((self._learnt - given) ** 2, axis=(1, 2)))]
        windows = np.repeat([given, nearest], 1 + number, axis=0)
        for channel in range(number):
            windows[1 + channel, :, channel] = nearest[:, channel]
            windows[2 + number + channel, :, channel] = given[:, channel]
        by_view = [view.score(windows) for view in self._views] / self._unit
        without, alone = np.split(by_view.sum(axis=0), 2)
        return (without[0] - without[1:] + alone[1:] - alone[0]) / 2

    def _judged(self, series: np.ndarray, begins: np.ndarray) -> np.ndarray:
        """Scores windows of a series by each view in its unit, shape `(views, windows)`."""
        return self._by_view(self._views, self._in_units(series), begins) / self._unit

    def _of_samples(self, scores: np.ndarray, begins: np.ndarray, number: int) -> np.ndarray:
        """The mean score of the windows that hold a sample. Those of the first and last samples
        are too few for the threshold, so these have the score of the nearest one with all.
        """
        samples = mean_over_windows(scores, begins, self.window, number)
        first = min(self.window - 1, number // 2)
        last = max(number - self.window, number // 2)
        samples[:first] = samples[first]
        samples[last + 1 :] = samples[last]
        return samples

    def _in_units(self, series: np.ndarray) -> np.ndarray:
        values = (np.asarray(series, np.float64) - self._centre) / self._scale
        return np.clip(values, -_MOST_SIZE, _MOST_SIZE).astype(np.float32)

    def _cut(self, series: np.ndarray, begins: np.ndarray) -> np.ndarray:
        view = np.lib.stride_tricks.sliding_window_view(series, self.window, axis=0)
        return view[begins].transpose(0, 2, 1)

    def _by_view(self, views: Sequence[View], series: np.ndarray, begins: np.ndarray) -> np.ndarray:
        """Scores windows of a series in units, shape `(views, windows)`, some at a time."""
        scores = np.zeros((len(views), len(begins)))
        step = max(1, _CHUNK_VALUES // (self.window * series.shape[1]))
        for first in range(0, len(begins), step):
            windows = self._cut(series, begins[first : first + step])
            scores[:, first : first + step] = [view.score(windows) for view in views]
        return scores

    def _cross_fitted(
        self, series: Sequence[np.ndarray], num_blocks: int
    ) -> tuple[np.ndarray, list[np.ndarray], int]:
        """Fits the views, and scores all windows with views that have not learnt their block.

        Returns:
            The scores, shape `(views, windows)`, the first samples of the windows of each series,
            and the first sample of the last block, counted over all series.
        """
        firsts = np.cumsum([0, *map(len, series)])
        most = np.clip(
            _MOST_LEARNT_VALUES // (self.window * series[0].shape[1]), _LEAST_LEARNT, _MOST_LEARNT
        )
        step = max(self.window // _LEARNT_OVERLAP, -(-int(firsts[-1]) // int(most)))
        learnt = [np.arange(0, len(part) - self.window + 1, step) for part in series]
        self._learnt = np.ascontiguousarray(np.concatenate(list(map(self._cut, series, learnt))))
        places = np.concatenate(list(map(np.add, firsts[:-1], learnt)))
        self._views = [make().fit(self._learnt) for make in self._make]
        judged = [run_starts(len(part), self.window, self.window // _OVERLAP) for part in series]
        edges = np.linspace(0, firsts[-1], num_blocks + 1).astype(int)
        raw = []
        # blocks follow each other in time, and so do the series within a block
        for low, high in itertools.pairwise(edges):
            apart = (places + self.window <= low) | (places >= high + self.window)
            views = [make().fit(self._learnt[apart]) for make in self._make]
            for first, part, begins in zip(firsts[:-1], series, judged, strict=True):
                inside = (first + begins >= low) & (first + begins < high)
                raw.append(self._by_view(views, part, begins[inside]))
        return np.concatenate(raw, axis=1), judged, int(edges[-2])


def bounded(series: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Returns nominal series for a model to keep: of more than `MOST_NOMINAL` values, stretches
    that are spread evenly over them.
    """
    values = sum(part.size for part in series)
    if values <= MOST_NOMINAL:
        return tuple(series)
    pieces = [
        part[first : first + _STRETCH] for part in series for first in range(0, len(part), _STRETCH)
    ]
    number = max(1, MOST_NOMINAL // (_STRETCH * series[0].shape[1]))
    # the pieces with which one more share of all values has passed
    passed = np.cumsum([0, *(piece.size for piece in pieces)]) * number // values
    return tuple(pieces[place] for place in np.flatnonzero(np.diff(passed)))
