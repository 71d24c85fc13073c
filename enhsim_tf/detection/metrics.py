"""Thresholds and performance measures of anomaly detectors, as functions of their scores (title and abstract of the paper).

Higher scores are more anomalous. A score raises an alarm if it is strictly above the threshold. Every threshold of this project
comes from `threshold`, or from `finite_threshold` where a finite one is needed. Scores are never adjusted by the labels ("point
adjustment"), because that makes even random scores look good.
"""

import numpy as np

from enhsim_tf.common.errors import InputError


def threshold(scores: np.ndarray, rate: float) -> float:
    """Computes the split conformal threshold for a false-alarm rate, with the finite-sample conformal correction.

    The threshold is the score of rank `ceil((n + 1) (1 - rate))` among `n` scores. If a new score is exchangeable with these,
    the probability that it exceeds the threshold is at most `rate`. If there are no ties, the probability is also at least
    `rate - 1 / (n + 1)`.

    Args:
        scores: Scores of held-out nominal windows.
        rate: Largest acceptable false-alarm rate, between 0 and 1.

    Returns:
        The threshold. It is infinite if there are fewer than `1 / rate - 1` scores, because no finite threshold then
        guarantees the rate.

    Raises:
        InputError: If the rate is not between 0 and 1, or if there are no scores.
    """
    if not 0 < rate < 1 or len(scores) == 0:
        raise InputError(f"Expected a rate between 0 and 1, and at least one score. Received: rate={rate} and {len(scores)} scores.")
    rank = int(np.ceil((len(scores) + 1) * (1 - rate) - 1e-9))  # the rounding of 1 - rate must not increase the rank
    return float(np.sort(scores)[rank - 1]) if rank <= len(scores) else np.inf


def smallest_rate(num_scores: int) -> float:
    """Returns the smallest false-alarm rate for which the conformal threshold of so many scores is finite: `1 / (num_scores + 1)`."""
    return 1 / (num_scores + 1)


def finite_threshold(scores: np.ndarray, rate: float, num_independent: int | None = None) -> tuple[float, float]:
    """Computes the conformal threshold, or the largest score if there are too few scores for the rate.

    An infinite threshold would silence a detector without a word. With the largest of `n` scores as threshold, the expected
    false-alarm rate is at most `1 / (n + 1)`, which is returned so that it can be stated instead of the rate asked for.

    Args:
        scores: Scores of held-out nominal windows.
        rate: Largest acceptable false-alarm rate, between 0 and 1.
        num_independent: Number of independent scores, if the scores of overlapping windows are correlated. None: all of them.

    Returns:
        The threshold and the false-alarm rate that it is set for, which is `rate` or larger.

    Raises:
        InputError: As for `threshold`.
    """
    conformal = threshold(scores, rate)
    smallest = smallest_rate(num_independent or len(scores))
    return (float(np.max(scores)), smallest) if rate < smallest * (1 - 1e-9) else (conformal, rate)


def false_alarm_rate(nominal_scores: np.ndarray, threshold: float) -> float:
    """Returns the share of nominal scores above the threshold."""
    return float(np.mean(np.asarray(nominal_scores) > threshold))


def recall(anomalous_scores: np.ndarray, threshold: float) -> float:
    """Returns the share of anomalous scores above the threshold."""
    return float(np.mean(np.asarray(anomalous_scores) > threshold))


def recall_at_real_rate(real_scores: np.ndarray, anomalous_scores: np.ndarray, rate: float = 0.01) -> float:
    """Computes the recall at the real rate, that is at a threshold that is set on real nominal windows.

    This recall measures how well a detector separates nominal from anomalous windows. It does not depend on the threshold
    from the detector's own training arm.

    Args:
        real_scores: Scores of real nominal windows, which are not those for which the false-alarm rate is reported.
        anomalous_scores: Scores of anomalous windows.
        rate: Nominal false-alarm rate of the threshold.
    """
    return recall(anomalous_scores, threshold(real_scores, rate))


def auc_roc(nominal_scores: np.ndarray, anomalous_scores: np.ndarray) -> float:
    """Area under the ROC curve (AUC): the probability that an anomalous window scores higher than a nominal one.

    Ties count as one half. It is computed from ranks, as the statistic of Mann and Whitney (1947).

    Args:
        nominal_scores: Scores of nominal windows.
        anomalous_scores: Scores of anomalous windows.

    Returns:
        The area, from 0 to 1.

    Raises:
        InputError: If there are no scores of one kind, or if one is not finite.
    """
    from scipy.stats import rankdata

    labels, scores = _labelled(nominal_scores, anomalous_scores)
    num_anomalous = np.sum(labels)
    rank_sum = np.sum(rankdata(scores)[labels])
    return float((rank_sum - num_anomalous * (num_anomalous + 1) / 2) / (num_anomalous * (len(labels) - num_anomalous)))


def auc_pr_at_prevalence(nominal_scores: np.ndarray, anomalous_scores: np.ndarray, prevalence: float = 0.02) -> float:
    """Area under the precision-recall curve (average precision) for a given share of anomalous windows.

    With `p` for this share, the precision of a threshold is `p recall / (p recall + (1 - p) false-alarm rate)`. The area is the sum,
    over all thresholds from the highest score down, of the precision times the increase of recall.

    Args:
        nominal_scores: Scores of nominal windows.
        anomalous_scores: Scores of anomalous windows.
        prevalence: Share of anomalous windows. It is also the expected value of this measure for random scores.

    Returns:
        The area, from 0 to 1.

    Raises:
        InputError: If there are no scores of one kind, or if one is not finite.
    """
    labels, scores = _labelled(nominal_scores, anomalous_scores)
    order, last = _thresholds(scores)
    recalls, false_alarms = (np.cumsum(marks[order])[last] / np.sum(marks) for marks in (labels, ~labels))
    precisions = prevalence * recalls / (prevalence * recalls + (1 - prevalence) * false_alarms)
    return float(np.sum(precisions * np.diff(recalls, prepend=0.0)))


def gap_closed(rate: float, simulated_rate: float, real_rate: float) -> float:
    """Computes the share of the gap between simulation and reality that an arm closes.

    The share is 0 if the arm has the false-alarm rate of the coarse simulation, and 1 if it has that of real telemetry.

    Args:
        rate: False-alarm rate of detectors trained on the arm, on real nominal windows.
        simulated_rate: False-alarm rate of detectors trained on the coarse simulation.
        real_rate: False-alarm rate of detectors trained on real telemetry.

    Returns:
        The share. It is above 1 if the arm gives fewer false alarms than training on real telemetry, and NaN if there is no gap.
    """
    return float((simulated_rate - rate) / (simulated_rate - real_rate)) if simulated_rate != real_rate else float("nan")


def vus_pr(labels: np.ndarray, scores: np.ndarray, max_buffer: int, num_buffers: int | None = None) -> float:
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
        num_buffers: Number of evenly spaced buffer lengths from 0 to `max_buffer`. None uses all of them.

    Returns:
        The volume, from 0 to 1. Its expected value for random scores is about the mean soft label.

    Raises:
        InputError: If no sample is anomalous, if a score is NaN, if the shapes differ, or if `max_buffer` is negative.
    """
    labels, scores = np.asarray(labels, bool), np.asarray(scores, np.float64)
    if labels.shape != scores.shape or labels.ndim != 1 or not labels.any() or np.isnan(scores).any() or max_buffer < 0:
        raise InputError(
            "Expected labels and scores of one shape (samples,), an anomalous sample, no nan and a buffer of 0 or more. "
            f"Received: shapes {labels.shape} and {scores.shape}, {labels.sum()} anomalous, {np.isnan(scores).sum()} nan, "
            f"max_buffer={max_buffer}."
        )
    order, last = _thresholds(scores)
    alarms = last + 1
    group = np.empty(len(scores), int)  # for each sample, the index of the first threshold at which it raises an alarm
    group[order] = np.searchsorted(last, np.arange(len(scores)))
    core = np.cumsum(labels[order])[last]
    distance, edges = _distance(labels), np.flatnonzero(np.diff(labels, prepend=False, append=False)).reshape(-1, 2)
    lengths = np.arange(max_buffer + 1) if num_buffers is None else np.unique(np.rint(np.linspace(0, max_buffer, num_buffers)).astype(int))
    areas = []
    for length in lengths:
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


def _labelled(nominal_scores: np.ndarray, anomalous_scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Checks and concatenates the scores, and returns their labels, False for nominal and True for anomalous, and the scores."""
    numbers, scores = (len(nominal_scores), len(anomalous_scores)), np.concatenate([nominal_scores, anomalous_scores]).astype(np.float64)
    if min(numbers) == 0 or not np.isfinite(scores).all():
        raise InputError(
            "Expected finite scores of nominal and of anomalous windows. "
            f"Received: {numbers[0]} and {numbers[1]} scores, {np.sum(~np.isfinite(scores))} not finite."
        )
    return np.repeat([False, True], numbers), scores
