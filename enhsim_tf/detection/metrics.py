"""How well scores find anomalies: thresholds, rates and areas, as functions of scores. Higher scores are stranger.

An alarm is a score above the threshold, never at it. No score is adjusted by the labels ("point adjustment"): after that
a random score looks good.
"""

import numpy as np

from enhsim_tf.common.errors import InputError


def threshold(scores: np.ndarray, rate: float) -> float:
    """The threshold that nominal scores exceed at no more than a rate, with the finite sample paid for (split conformal).

    Of `n` scores it is the one of rank `ceil((n + 1) (1 - rate))`. If a further score is exchangeable with these, it
    lies above with a probability of `rate` at most, and of `1 / (n + 1)` less at least.

    Args:
        scores: Scores of held-out nominal windows.
        rate: False-alarm rate to keep, between 0 and 1.

    Returns:
        The threshold; infinite if there are fewer scores than `1 / rate - 1`, which cannot keep the rate otherwise.

    Raises:
        InputError: If the rate is not between 0 and 1 or there is no score.
    """
    if not 0 < rate < 1 or len(scores) == 0:
        raise InputError(f"Expected a rate between 0 and 1, and scores. Received: rate={rate} and {len(scores)} scores.")
    rank = int(np.ceil((len(scores) + 1) * (1 - rate) - 1e-9))  # the rounding of 1 - rate must not cost a rank
    return float(np.sort(scores)[rank - 1]) if rank <= len(scores) else np.inf


def false_alarm_rate(nominal_scores: np.ndarray, threshold: float) -> float:
    """Share of nominal scores above the threshold."""
    return float(np.mean(np.asarray(nominal_scores) > threshold))


def recall(anomalous_scores: np.ndarray, threshold: float) -> float:
    """Share of anomalous scores above the threshold."""
    return float(np.mean(np.asarray(anomalous_scores) > threshold))


def recall_at_real_rate(real_scores: np.ndarray, anomalous_scores: np.ndarray, rate: float = 0.01) -> float:
    """Recall at the threshold that real nominal scores set: how well the order is, whatever the training arm's threshold.

    Args:
        real_scores: Scores of real nominal windows, apart from those that the false-alarm rate is reported on.
        anomalous_scores: Scores of anomalous windows.
        rate: False-alarm rate of the threshold.
    """
    return recall(anomalous_scores, threshold(real_scores, rate))


def auc_roc(nominal_scores: np.ndarray, anomalous_scores: np.ndarray) -> float:
    """Area under the ROC curve: the share of pairs in the right order, ties for half."""
    from sklearn.metrics import roc_auc_score

    return float(roc_auc_score(*_labelled(nominal_scores, anomalous_scores)))


def auc_pr_at_prevalence(nominal_scores: np.ndarray, anomalous_scores: np.ndarray, prevalence: float = 0.02) -> float:
    """Area under the precision-recall curve (average precision), as if anomalies were a given share of all windows.

    Args:
        nominal_scores: Scores of nominal windows.
        anomalous_scores: Scores of anomalous windows.
        prevalence: Share of anomalous windows that the weights stand for; a random score reaches about this.
    """
    from sklearn.metrics import average_precision_score

    labels, scores = _labelled(nominal_scores, anomalous_scores)
    weights = np.where(labels, prevalence / len(anomalous_scores), (1 - prevalence) / len(nominal_scores))
    return float(average_precision_score(labels, scores, sample_weight=weights))


def gap_closed(rate: float, simulated_rate: float, real_rate: float) -> float:
    """Share of the gap between simulation and reality that an arm closes: 0 as the coarse simulation, 1 as real telemetry.

    Args:
        rate: False-alarm rate of the arm, on real nominal windows.
        simulated_rate: That of detectors trained on the coarse simulation.
        real_rate: That of detectors trained on real nominal windows.

    Returns:
        The share; above 1 if the arm has fewer false alarms than real training, nan if there is no gap.
    """
    return float((simulated_rate - rate) / (simulated_rate - real_rate)) if simulated_rate != real_rate else float("nan")


def vus_pr(labels: np.ndarray, scores: np.ndarray, max_buffer: int, num_buffers: int | None = None) -> float:
    """Volume under the surface of precision, recall and buffer length (Paparrizos et al. 2022), over all thresholds.

    A buffer of length `l` around each anomalous range forgives a score that comes a little early or late: a sample at a
    distance `d <= l / 2` of the nearest range counts as `sqrt(1 - d / l)` of an anomalous one. With these soft labels
    and the samples at or above a threshold (the alarms),

        precision  = soft labels in alarms / alarms
        recall     = min(1, soft labels in alarms / P) * share of the ranges that have an alarm, in their buffers or inside
        P          = anomalous samples + half the soft labels in the alarms within buffers

    The area for one buffer is the sum of precision times the step of recall, as in average precision; the volume is the
    mean of the areas. `P` is that of the authors' benchmark TSB-AD. Their paper of 2022 puts half of all buffers
    into it, alarms or none; then even alarms at exactly the labelled samples miss recall.

    Args:
        labels: Which samples are anomalous, shape `(samples,)`.
        scores: Score of each sample, of the same shape.
        max_buffer: Largest buffer length in samples, for example the dominant period; one for all that is compared.
        num_buffers: How many lengths from 0 to `max_buffer`, evenly spread; all of them if None.

    Returns:
        The volume, from 0 to 1. A random score reaches about the mean soft label.

    Raises:
        InputError: If no sample is anomalous, a score is not a number, the shapes differ or the buffer is negative.
    """
    labels, scores = np.asarray(labels, bool), np.asarray(scores, np.float64)
    if labels.shape != scores.shape or labels.ndim != 1 or not labels.any() or np.isnan(scores).any() or max_buffer < 0:
        raise InputError(
            "Expected labels and scores of one shape (samples,), an anomalous sample, no nan and a buffer of 0 or more. "
            f"Received: shapes {labels.shape} and {scores.shape}, {labels.sum()} anomalous, {np.isnan(scores).sum()} nan, max_buffer={max_buffer}."
        )
    order = np.argsort(-scores, kind="stable")
    last = np.flatnonzero(np.diff(scores[order], append=np.nan) != 0)  # of each group of equal scores: where a threshold may lie
    alarms = last + 1
    group = np.empty(len(scores), int)  # of each sample: the first threshold that alarms on it
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
    """Samples from each sample to the nearest anomalous one."""
    places, far = np.arange(len(labels)), 2 * len(labels)
    before = np.maximum.accumulate(np.where(labels, places, -far))
    after = np.minimum.accumulate(np.where(labels, places, far)[::-1])[::-1]
    return np.minimum(places - before, after - places)


def _labelled(nominal_scores: np.ndarray, anomalous_scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Labels and scores in one array each."""
    return np.repeat([0, 1], [len(nominal_scores), len(anomalous_scores)]), np.concatenate([nominal_scores, anomalous_scores])
