"""What every method has in common: it learns nominal telemetry and scores the samples of a series,
and its threshold is set on nominal blocks that it has not learnt.
"""

import dataclasses
import itertools
import time
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from enhsim_tf.scoring.metrics import finite_threshold
from enhsim_tf.telemetry.windows import mean_over_windows, run_starts
from studies.common.detectors import Detector
from studies.public_benchmarks.judging import Judge
from studies.public_benchmarks.series import Series

NUM_BLOCKS = 4
"""Blocks of nominal time, of which each is scored by a method that has learnt the others."""
_OVERLAP = 8  # scored windows that begin within one window length


class SampleScores(NamedTuple):
    """Scores of the samples of a series, each of shape `(samples,)`; higher is more anomalous."""

    whole: np.ndarray
    """From the whole series."""
    past: np.ndarray
    """From the past alone: of the last window that has ended."""


class Method(Protocol):
    """A method with its settings."""

    def fit(self, nominal: np.ndarray) -> "Method":
        """Learns nominal telemetry of shape `(samples, channels)`, NaN in a block that is left out,
        and returns the method.
        """

    def score(self, series: np.ndarray) -> SampleScores:
        """Scores the samples of a series without gaps, shape `(samples, channels)`."""


def begins_of(num_samples: int, window: int) -> np.ndarray:
    """First samples of the scored windows of a series, of which the last ends with it."""
    return run_starts(num_samples, window, max(1, window // _OVERLAP))


def sample_scores(scores: np.ndarray, num_samples: int, window: int) -> SampleScores:
    """Scores of samples from those of the windows that begin at `begins_of`, as in `score`.

    A sample has the mean score of all windows that hold it; the first and last ones, which few
    windows hold, have that of the nearest with all. From the past, it has the score of the last
    window that has ended, minus infinity before the first.
    """
    begins = begins_of(num_samples, window)
    whole = mean_over_windows(scores, begins, window, num_samples)
    first = min(window - 1, num_samples // 2)
    last = max(num_samples - window, num_samples // 2)
    whole[:first], whole[last + 1 :] = whole[first], whole[last]
    ended = np.searchsorted(begins + window, np.arange(1, num_samples + 1), "right")
    return SampleScores(whole, np.append(-np.inf, scores)[ended])


@dataclasses.dataclass
class OnWindows:
    """A detector of windows, in units of the nominal standard deviation of each channel.

    Args:
        detector: The unfitted detector.
        window: Length of a window in samples.
        is_centred: Whether the mean of each window and channel is removed.
    """

    detector: Detector
    window: int
    is_centred: bool = False

    def fit(self, nominal: np.ndarray) -> "OnWindows":
        """Learns all windows without NaN."""
        deviation = np.nanstd(nominal, axis=0, dtype=np.float64)
        self._unit = np.where(deviation > 0, deviation, 1)
        windows = self._windows(nominal)
        self.detector.fit(windows[np.isfinite(windows).all(axis=(1, 2))])
        return self

    def score(self, series: np.ndarray) -> SampleScores:
        """Scores the samples of a series."""
        return sample_scores(self.detector.score(self._windows(series)), len(series), self.window)

    def _windows(self, series: np.ndarray) -> np.ndarray:
        every = np.lib.stride_tricks.sliding_window_view(series / self._unit, self.window, axis=0)
        windows = every[begins_of(len(series), self.window)].swapaxes(1, 2)
        return windows - windows.mean(axis=1, keepdims=True) if self.is_centred else windows


def blocks_of(num_samples: int) -> list[tuple[int, int]]:
    """First samples and ends of the blocks of time."""
    edges = np.linspace(0, num_samples, NUM_BLOCKS + 1).astype(int).tolist()
    return list(itertools.pairwise(edges))


def without(nominal: np.ndarray, begin: int, end: int) -> np.ndarray:
    """Nominal telemetry with NaN from one sample until another."""
    left = np.array(nominal, np.float32)
    left[begin:end] = np.nan
    return left


def conformal_threshold(
    make: Callable[[], Method], nominal: np.ndarray, window: int, rate: float
) -> float:
    """The threshold of a method for a false-alarm rate, by the rule of `score`.

    Each block of nominal time is scored by a method that has learnt the others. The threshold is
    the conformal one of all these samples, or of the last block where that is larger. Windows that
    share samples count as one; where there are too few for the rate, it is the largest score.
    """
    found = []
    for begin, end in blocks_of(len(nominal)):
        scorer = make().fit(without(nominal, begin, end))
        found.append(scorer.score(nominal[begin:end]).whole)
    return max(
        finite_threshold(scores, rate, len(scores) // window)[0]
        for scores in (np.concatenate(found), found[-1])
    )


def judge_method(
    make: Callable[[], Method], series: Series, window: int, rate: float
) -> dict[str, Any]:
    """Fits a method to a series and judges it.

    Args:
        make: Returns the unfitted method.
        series: The series.
        window: Length of a window of the series, which margins of labels and thresholds use.
        rate: False-alarm rate that the threshold is set for.

    Returns:
        What `Judge.judge` returns, and the CPU seconds of all fits and scores (`cpu_s`).
    """
    began = time.process_time()
    threshold = conformal_threshold(make, series.nominal, window, rate)
    scores = make().fit(series.nominal).score(series.judged)
    seconds = time.process_time() - began
    judge = Judge(series.events, len(series.judged), window)
    return judge.judge(scores.whole, scores.past, scores.whole > threshold) | {"cpu_s": seconds}
