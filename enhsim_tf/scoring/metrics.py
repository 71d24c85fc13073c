"""Thresholds and performance measures of anomaly detectors, as functions of their scores (title and
abstract of the paper).

A score raises an alarm if it is strictly above the threshold. Scores are never adjusted by the
labels ("point adjustment"), because that makes even random scores look good.
"""

import numpy as np

from enhsim_tf.common.errors import InputError


def threshold(scores: np.ndarray, rate: float) -> float:
    """Computes the split conformal threshold for a false-alarm rate, with the finite-sample
    conformal correction.

    The threshold is the score of rank `ceil((n + 1) (1 - rate))` among `n` scores. If a new score
    is exchangeable with these, it exceeds the threshold with a probability of at most `rate`, and,
    without ties, of at least `rate - 1 / (n + 1)`.

    Args:
        scores: Scores of held-out nominal windows.
        rate: Largest acceptable false-alarm rate, between 0 and 1.

    Returns:
        The threshold; infinite if there are fewer than `1 / rate - 1` scores, because no finite one
        then guarantees the rate.

    Raises:
        InputError: If the rate is not between 0 and 1, or if there are no scores.
    """
    if not 0 < rate < 1 or len(scores) == 0:
        raise InputError(
            f"Expected a rate between 0 and 1, and at least one score. Received: rate={rate} and "
            f"{len(scores)} scores."
        )
    # the rounding of 1 - rate must not increase the rank
    rank = int(np.ceil((len(scores) + 1) * (1 - rate) - 1e-9))
    return float(np.sort(scores)[rank - 1]) if rank <= len(scores) else np.inf


def finite_threshold(
    scores: np.ndarray, rate: float, num_independent: int | None = None
) -> tuple[float, float]:
    """Computes the conformal threshold, or the largest score if there are too few scores for the
    rate.

    With the largest of `n` scores as threshold, the expected false-alarm rate is at most `1 / (n +
    1)`, which is returned.

    Args:
        scores: Scores of held-out nominal windows.
        rate: Largest acceptable false-alarm rate, as for `threshold`.
        num_independent: Number of independent scores, if the scores of overlapping windows are
            correlated. None: all of them.

    Returns:
        The threshold and the false-alarm rate that it is set for, which is `rate` or larger.
    """
    conformal = threshold(scores, rate)
    # the least rate with a finite conformal threshold
    smallest = 1 / ((num_independent or len(scores)) + 1)
    return (float(np.max(scores)), smallest) if rate < smallest * (1 - 1e-9) else (conformal, rate)


def recall(anomalous_scores: np.ndarray, threshold: float) -> float:
    """Returns the share of anomalous scores above the threshold."""
    return float(np.mean(np.asarray(anomalous_scores) > threshold))
