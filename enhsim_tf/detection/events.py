"""Alarms as events: runs of flagged samples, their confidence, and expected false alarms per day.

An operator counts alarms, not samples. Events are half-open ranges of samples `(begin, end)`.
"""

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
