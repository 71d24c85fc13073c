"""Alarms as events: when each began, when a scorer that has seen only the past would have raised
it, and what raised it. An operator counts alarms, not samples.
"""

import dataclasses

import numpy as np

from enhsim_tf.telemetry.windows import runs_of

DAY_S = 86_400
LEARNT = "learnt"
NEW = "new operating point"
"""What an event departs from."""
MEMORY = 8
"""Windows for which a score is remembered: one that is no higher is no new alarm."""
_FURTHER = 1.05  # multiple of the remembered scores that is flagged
_GAP = 2  # windows between alarms of one event
_LEVEL = 0.95  # of the interval of false alarms
# share of the scores that are above the threshold at a new operating point
_LASTING = 0.9
_RISE = 0.05  # of the rise of the score to an alarm, from which it is under way


@dataclasses.dataclass(frozen=True)
class Event:
    """An alarm.

    Args:
        begin: Estimated onset, the first sample that is anomalous.
        end: The first sample after the last score above the threshold; of a `NEW` operating point,
            after the last flag.
        detected: The sample with which a scorer that has seen only the past raises the alarm.
        peak: The sample with the highest score since `begin`.
        num_flagged: Number of flagged samples.
        score: The highest score; the threshold is 1.
        confidence: See `confidence_of`.
        against: What it departs from, `LEARNT` or, within a lasting departure, the `NEW` operating
            point.
        views: The views that raised it.
        channels: The channels that raised it.
    """

    begin: int
    end: int
    detected: int
    peak: int
    num_flagged: int
    score: float
    confidence: float
    against: str
    views: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()


def flags_of(scores: np.ndarray, window: int) -> np.ndarray:
    """Returns which samples of a series without gaps are flagged: those whose score is above the
    threshold, 1, and by a twentieth above all scores of the `MEMORY` windows that end before those
    with which it shares samples.

    So telemetry that leaves what was learnt and stays there is flagged when it leaves, and again
    when it goes further. Only the past is used. Scores have the shape `(samples,)`.
    """
    import pandas as pd

    past = pd.Series(scores).shift(window).rolling(MEMORY * window, min_periods=1).max()
    return scores > np.fmax(1.0, _FURTHER * past.to_numpy())


def spans_of(scores: np.ndarray, flags: np.ndarray, window: int) -> list[tuple[int, int, str]]:
    """Returns the first flagged sample of each event of a series without gaps, its end, and what it
    departs from, in the order of time.

    An alarm that returns within two windows is the same event, which lasts until its last score
    above 1. Where nearly all scores of the last `MEMORY` windows are above 1, the telemetry
    has a new operating point, and what is flagged is an event of its own.
    """
    spans = []
    memory = MEMORY * window
    above = scores > 1
    rises = _joined(flags, window)
    for begin, end in _joined(above, _GAP * window):
        inside = [rise for rise in rises if begin <= rise[0] < end]
        if inside:
            begin = inside[0][0]
            spans.append((begin, end, LEARNT))
        for low, high in inside:
            if low >= begin + memory and above[low - memory : low].mean() >= _LASTING:
                spans.append((low, high, NEW))
    return spans


def _joined(marks: np.ndarray, gap: int) -> list[tuple[int, int]]:
    """Runs of marks with at most `gap` samples between two of them."""
    joined: list[tuple[int, int]] = []
    for begin, end in runs_of(marks):
        if joined and begin - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined


def onset_of(past_scores: np.ndarray, flagged: int, window: int) -> int:
    """Estimates the first anomalous sample of an event.

    A window that ends before it is nominal, so it is the end of the first window after which the
    score keeps above the level before by more than a twentieth of the rise to its height.

    Args:
        past_scores: For each sample, the score of the window that ends with it.
        flagged: The first flagged sample. The mean of the windows that hold a sample rises up to a
            window before the first anomalous one.
        window: Length of a window in samples.
    """
    first = max(0, flagged - window)
    last = min(len(past_scores), flagged + window)
    level = np.median(past_scores[first : max(flagged, first + 1)])
    top = flagged + int(np.argmax(past_scores[flagged:last]))
    limit = level + _RISE * (past_scores[top] - level)
    below = np.flatnonzero(past_scores[first:top] <= limit)
    return first + int(below[-1]) + 1 if len(below) else first


def confidence_of(peak: float, nominal_scores: np.ndarray, block: int) -> float:
    """Confidence that an event with this highest score is no false alarm: 1 minus its conformal
    p-value.

    The p-value is the share of blocks of nominal scores, each of `block` samples, whose highest
    score reaches that of the event, which is itself counted among the blocks. The confidence is
    therefore below 1, however high the score.
    """
    highest = np.maximum.reduceat(nominal_scores, range(0, len(nominal_scores), block))
    return float(1 - (1 + np.sum(highest >= peak)) / (1 + len(highest)))


def false_alarms_per_day(num_events: int, duration_s: float) -> tuple[float, float, float]:
    """Expected number of false alarms per day, and the limits of its exact Poisson interval of 95 %
    (Garwood 1936).

    The events in nominal telemetry are joined as in operation, so that they are about independent
    of each other.
    """
    # half of the quantiles of chi-squared; scipy.stats takes a second to import
    from scipy.special import gammaincinv

    tail = (1 - _LEVEL) / 2
    days = duration_s / DAY_S
    low = gammaincinv(num_events, tail) if num_events else 0.0
    high = gammaincinv(num_events + 1, 1 - tail)
    return num_events / days, float(low / days), float(high / days)
