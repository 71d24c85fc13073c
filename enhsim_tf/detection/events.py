"""Alarms as events: runs of flagged samples, event-wise precision and recall, alarm timing, and expected false alarms per day.

An operator counts alarms, not samples. The event-wise measures follow the European Space Agency's Anomaly Detection Benchmark
(ESA-ADB; Kotowski et al. 2024, arXiv 2406.17826), whose correction of precision is that of Sehili and Zhang (2023, arXiv
2308.13068). Events are half-open ranges of samples `(begin, end)`.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.common.errors import InputError

DAY_S = 86_400


class Event(NamedTuple):
    """An alarm: a range of samples.

    `begin` is the first flagged sample, `end` the first sample after the last flagged one, and `peak` the sample with the highest
    score, or the first sample if there are no scores.
    """

    begin: int
    end: int
    peak: int


@dataclasses.dataclass(frozen=True)
class EventScores:
    """Event-wise measures of detected events against labelled events.

    Args:
        num_found: Labelled events that a detected event overlaps.
        num_missed: Labelled events that none overlaps.
        num_false: Detected events that overlap no labelled event.
        num_redundant: Detected events that overlap a labelled event which an earlier one has already found, summed over the
            labelled events.
        nominal_rate: Share of nominal samples that no detected event covers (true negative rate).
        timing: Mean quality of the alarm times over the events found, from 0 to 1 (see `timing_quality`). NaN if none is found.
        after_rate: Share of the events found whose first alarm does not begin before the event. NaN if none is found.
    """

    num_found: int
    num_missed: int
    num_false: int
    num_redundant: int
    nominal_rate: float
    timing: float
    after_rate: float

    @property
    def precision(self) -> float:
        """Share of alarms that are true: found events among found events and false alarms. 0 if there are neither."""
        return _ratio(self.num_found, self.num_found + self.num_false)

    @property
    def corrected_precision(self) -> float:
        """The precision times the true negative rate, so that one alarm that covers everything is worth nothing."""
        return self.precision * self.nominal_rate

    @property
    def recall(self) -> float:
        """Share of labelled events that are found."""
        return _ratio(self.num_found, self.num_found + self.num_missed)

    @property
    def alarming_precision(self) -> float:
        """Found events among found events and redundant alarms: 1 if each event found raises one alarm. 0 if none is found."""
        return _ratio(self.num_found, self.num_found + self.num_redundant)

    def f_score(self, beta: float = 0.5) -> float:
        """Corrected event-wise F score.

        Args:
            beta: Weight of recall. ESA-ADB uses 0.5, which counts precision more than recall.
        """
        precision, recall = self.corrected_precision, self.recall
        return _ratio((1 + beta**2) * precision * recall, beta**2 * precision + recall)


def runs_of(mask: np.ndarray) -> list[tuple[int, int]]:
    """Returns the runs of true samples as `(begin, end)`.

    Args:
        mask: Boolean array of shape `(samples,)`.
    """
    edges = np.flatnonzero(np.diff(np.asarray(mask, bool), prepend=False, append=False))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def events_of(flags: np.ndarray, scores: np.ndarray | None = None, gap: int = 0) -> list[Event]:
    """Joins flagged samples to events.

    Args:
        flags: Boolean array that marks the flagged samples, shape `(samples,)`.
        scores: Score of each sample, of the same shape, or None.
        gap: Runs of flagged samples with at most this many samples between them are one event.

    Returns:
        The events in the order of time.

    Raises:
        InputError: If the shapes differ or the gap is negative.
    """
    flags = np.asarray(flags, bool)
    if flags.ndim != 1 or gap < 0 or (scores is not None and np.shape(scores) != flags.shape):
        raise InputError(
            f"Expected flags and scores of one shape (samples,), and a gap of 0 or more. Received: flags of shape {flags.shape}, "
            f"scores of shape {np.shape(scores)}, gap={gap}."
        )
    joined: list[tuple[int, int]] = []
    for begin, end in runs_of(flags):
        if joined and begin - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return [Event(begin, end, begin if scores is None else begin + int(np.argmax(scores[begin:end]))) for begin, end in joined]


def event_scores(
    labelled: np.ndarray | Sequence[tuple[int, int]], detected: Sequence[tuple[int, ...]], num_samples: int | None = None
) -> EventScores:
    """Compares detected events with labelled events.

    Args:
        labelled: Boolean array that marks the anomalous samples, whose runs are the events; or the events as `(begin, end)`, for
            events with nominal samples inside. All samples of an event count as anomalous.
        detected: Detected events, as returned by `events_of`; of each, `begin` and `end` are used.
        num_samples: Length of the series. Required if `labelled` is not an array.

    Returns:
        The measures.

    Raises:
        InputError: If there is no labelled event, or if an event lies outside the series.
    """
    if isinstance(labelled, np.ndarray) and labelled.dtype == bool:
        labelled, num_samples = runs_of(labelled), len(labelled)
    truth = sorted((int(begin), int(end)) for begin, end in labelled)
    alarms = sorted((int(event[0]), int(event[1])) for event in detected)
    if not truth or num_samples is None or any(not 0 <= begin < end <= num_samples for begin, end in [*truth, *alarms]):
        raise InputError(
            f"Expected a labelled event, and events within the series. Received: {len(truth)} labelled and {len(alarms)} detected events "
            f"in {num_samples} samples."
        )
    overlaps = np.array([[begin < last and first < end for first, last in alarms] for begin, end in truth], bool).reshape(len(truth), -1)
    counts = overlaps.sum(axis=1)
    anomalous, covered = np.zeros((2, num_samples), bool)
    for marks, ranges in ((anomalous, truth), (covered, alarms)):
        for begin, end in ranges:
            marks[begin:end] = True
    latencies, qualities = [], []
    for number in np.flatnonzero(counts):
        begin, end = truth[number]
        previous = truth[number - 1][0] if number else 2 * begin - end
        latencies.append(alarms[int(np.argmax(overlaps[number]))][0] - begin)
        qualities.append(timing_quality(latencies[-1], min(end - begin, begin - previous), end - begin))
    nominal = np.count_nonzero(~anomalous)
    return EventScores(
        num_found=int(np.count_nonzero(counts)),
        num_missed=int(np.count_nonzero(counts == 0)),
        num_false=int(np.count_nonzero(~overlaps.any(axis=0))),
        num_redundant=int(np.maximum(counts - 1, 0).sum()),
        nominal_rate=1 - np.count_nonzero(covered & ~anomalous) / nominal if nominal else 1.0,
        timing=float(np.mean(qualities)) if qualities else math.nan,
        after_rate=float(np.mean(np.array(latencies) >= 0)) if latencies else math.nan,
    )


def timing_quality(latency: float, earliest: float, latest: float) -> float:
    """Quality of the time of an alarm: the anomaly detection timing quality curve of ESA-ADB.

    The quality is 1 at the begin of the anomaly. It falls to 0 for an alarm that is `earliest` too early, and for one at the end of
    the anomaly.

    Args:
        latency: Begin of the first alarm minus begin of the anomaly.
        earliest: The length of the anomaly, or the distance from the begin of the anomaly before it, if that is less.
        latest: The length of the anomaly.
    """
    if latency == 0:
        return 1.0
    if latency <= -earliest or latency >= latest:
        return 0.0
    if latency < 0:
        return ((latency + earliest) / earliest) ** math.e
    return 1 / (1 + (latency / (latest - latency)) ** math.e)


def confidences(peaks: Sequence[float], nominal_scores: np.ndarray, block: int) -> np.ndarray:
    """Confidence that an event is no false alarm: 1 minus the conformal p-value of its highest score.

    The p-value is the share of blocks of nominal scores whose highest score reaches that of the event, and the event itself is
    counted among the blocks. The confidence is therefore below 1, however high the score.

    Args:
        peaks: Highest score of each event.
        nominal_scores: Score of each sample of nominal telemetry, shape `(samples,)`.
        block: Length of a block in samples, for example a window.

    Returns:
        The confidence of each event, float64 of shape `(events,)`.
    """
    highest = np.sort([part.max() for part in np.split(nominal_scores, range(block, len(nominal_scores), block))])
    reached = len(highest) - np.searchsorted(highest, np.asarray(peaks, np.float64), side="left")
    return 1 - (1 + reached) / (1 + len(highest))


def false_alarms_per_day(num_events: int, duration_s: float, level: float = 0.95) -> tuple[float, float, float]:
    """Expected number of false alarms per day, with its exact Poisson interval (Garwood 1936).

    Args:
        num_events: Number of events in nominal telemetry. Count events that are joined as in operation, so that they are about
            independent of each other.
        duration_s: Duration of that telemetry in seconds.
        level: Confidence level of the interval.

    Returns:
        The expected number per day, and the lower and upper limit of its interval.

    Raises:
        InputError: If the duration is not above 0 or the number is negative.
    """
    from scipy.special import gammaincinv  # half of the quantiles of chi-squared; scipy.stats takes a second to import

    if not duration_s > 0 or num_events < 0:
        raise InputError(f"Expected a number of events and a duration above 0 s. Received: {num_events} events in {duration_s} s.")
    tail, days = (1 - level) / 2, duration_s / DAY_S
    low = gammaincinv(num_events, tail) if num_events else 0.0
    high = gammaincinv(num_events + 1, 1 - tail)
    return num_events / days, float(low / days), float(high / days)


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole else 0.0
