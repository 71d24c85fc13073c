"""Measures of detectors that the studies report: recall at the real rate, and the volume under a surface.

Higher scores are more anomalous. Scores are never adjusted by the labels ("point adjustment"), because that makes even random scores look
good.
"""

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.metrics import recall, threshold


def recall_at_real_rate(
    real_scores: np.ndarray, anomalous_scores: np.ndarray, rate: float = 0.01
) -> float:
    """Computes the recall at the real rate, that is at a threshold that is set on real nominal windows.

    This recall measures how well a detector separates nominal from anomalous windows. It does not depend on the threshold
    from the detector's own training arm.

    Args:
        real_scores: Scores of real nominal windows, which are not those for which the false-alarm rate is reported.
        anomalous_scores: Scores of anomalous windows.
        rate: Nominal false-alarm rate of the threshold.
    """
    return recall(anomalous_scores, threshold(real_scores, rate))


def vus_pr(labels: np.ndarray, scores: np.ndarray, max_buffer: int) -> float:
    """Volume under the surface of precision, recall and buffer length (VUS-PR, Paparrizos et al. 2022), over all thresholds.

    A buffer of length `l` around each anomalous range tolerates scores that rise slightly early or late. A sample at a
    distance `d <= l / 2` from the nearest range has the soft label `sqrt(1 - d / l)`; an anomalous sample has the soft label
    1. The alarms are the samples whose scores are at or above a threshold. Then

        precision  = soft labels in alarms / alarms
        recall     = min(1, soft labels in alarms / P) * share of the ranges with an alarm inside or in their buffers
        P          = anomalous samples + half the soft labels in the alarms within buffers

    The area for one buffer length is the sum of precision times the increase of recall, as in average precision. The volume is
    the mean of the areas over the buffer lengths. The definition of `P` is that of the authors' benchmark TSB-AD. Their paper of
    2022 adds half of the soft labels of all buffers instead, with or without alarms. Under that definition, even alarms at
    exactly the labelled samples do not reach a recall of 1.

    Args:
        labels: Boolean array that marks the anomalous samples, shape `(samples,)`.
        scores: Score of each sample, of the same shape.
        max_buffer: Largest buffer length in samples, for example the dominant period. Use the same value for all detectors that
            are compared.

    Returns:
        The volume, from 0 to 1. Its expected value for random scores is about the mean soft label.

    Raises:
        InputError: If no sample is anomalous, if a score is NaN, if the shapes differ, or if `max_buffer` is negative.
    """
    labels, scores = np.asarray(labels, bool), np.asarray(scores, np.float64)
    if (
        labels.shape != scores.shape
        or labels.ndim != 1
        or not labels.any()
        or np.isnan(scores).any()
        or max_buffer < 0
    ):
        raise InputError(
            "Expected labels and scores of one shape (samples,), an anomalous sample, no nan and a buffer of 0 or more. "
            f"Received: shapes {labels.shape} and {scores.shape}, {labels.sum()} anomalous, {np.isnan(scores).sum()} nan, "
            f"max_buffer={max_buffer}."
        )
    order, last = _thresholds(scores)
    alarms = last + 1
    group = np.empty(
        len(scores), int
    )  # for each sample, the index of the first threshold at which it raises an alarm
    group[order] = np.searchsorted(last, np.arange(len(scores)))
    core = np.cumsum(labels[order])[last]
    distance, edges = (
        _distance(labels),
        np.flatnonzero(np.diff(labels, prepend=False, append=False)).reshape(-1, 2),
    )
    areas = []
    for length in range(max_buffer + 1):
        half = length // 2
        near = np.flatnonzero((distance > 0) & (distance <= half))
        weight = np.zeros(len(scores))
        weight[near] = np.sqrt(1 - distance[near] / max(length, 1))
        buffered = np.cumsum(np.bincount(group[near], weight[near], len(last)))
        first_alarms = [group[max(begin - half, 0) : end + half].min() for begin, end in edges]
        existence = np.cumsum(np.bincount(first_alarms, minlength=len(last))) / len(edges)
        found = core + buffered
        reached = np.minimum(1, found / (labels.sum() + buffered / 2)) * existence
        areas.append(np.sum(np.diff(reached, prepend=0) * found / alarms))
    return float(np.mean(areas))


def _distance(labels: np.ndarray) -> np.ndarray:
    """Returns the distance of each sample from the nearest anomalous sample, in samples."""
    places, far = np.arange(len(labels)), 2 * len(labels)
    before = np.maximum.accumulate(np.where(labels, places, -far))
    after = np.minimum.accumulate(np.where(labels, places, far)[::-1])[::-1]
    return np.minimum(places - before, after - places)


def _thresholds(scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the order of falling scores, and in it the last place of each group of equal scores, where a threshold may lie."""
    order = np.argsort(-scores, kind="stable")
    return order, np.flatnonzero(np.diff(scores[order], append=np.nan) != 0)
