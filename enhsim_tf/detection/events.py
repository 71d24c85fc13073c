"""Alarms as events: runs of flagged samples, their confidence, and expected false alarms per day. An operator counts alarms, not samples."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.telemetry.windows import runs_of

DAY_S = 86_400
_LEVEL = 0.95  # of the interval of false alarms


class Event(NamedTuple):
    """An alarm, from its first flagged sample to the first sample after the last flagged one."""

    begin: int
    end: int
    peak: int  # the sample with the highest score; the first one if there are no scores


def events_of(flags: np.ndarray, scores: np.ndarray | None = None, gap: int = 0) -> list[Event]:
    """Joins flagged samples, with at most `gap` others between them, to events in the order of time; `scores` give their peaks."""
    joined: list[tuple[int, int]] = []
    for begin, end in runs_of(flags):
        if joined and begin - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return [
        Event(begin, end, begin if scores is None else begin + int(np.argmax(scores[begin:end])))
        for begin, end in joined
    ]


def confidences(peaks: Sequence[float], nominal_scores: np.ndarray, block: int) -> np.ndarray:
    """Confidence that an event is no false alarm: 1 minus the conformal p-value of its highest score.

    The p-value is the share of blocks of nominal scores, each of `block` samples, whose highest score reaches that of the event, which is itself
    counted among the blocks. The confidence is therefore below 1, however high the score.
    """
    highest = np.sort(
        [part.max() for part in np.split(nominal_scores, range(block, len(nominal_scores), block))]
    )
    reached = len(highest) - np.searchsorted(highest, np.asarray(peaks, np.float64), side="left")
    return 1 - (1 + reached) / (1 + len(highest))


def false_alarms_per_day(num_events: int, duration_s: float) -> tuple[float, float, float]:
    """Expected number of false alarms per day, and the limits of its exact Poisson interval of 95 % (Garwood 1936).

    The events in nominal telemetry are joined as in operation, so that they are about independent of each other.
    """
    from scipy.special import (
        gammaincinv,
    )  # half of the quantiles of chi-squared; scipy.stats takes a second to import

    tail, days = (1 - _LEVEL) / 2, duration_s / DAY_S
    low = gammaincinv(num_events, tail) if num_events else 0.0
    high = gammaincinv(num_events + 1, 1 - tail)
    return num_events / days, float(low / days), float(high / days)
