"""A measure of detectors that several studies report: recall at the real rate.

Higher scores are more anomalous.
"""

import numpy as np

from enhsim_tf.scoring.metrics import recall, threshold


def recall_at_real_rate(
    real_scores: np.ndarray, anomalous_scores: np.ndarray, rate: float = 0.01
) -> float:
    """Computes the recall at the real rate, that is at a threshold that is set on real nominal
    windows.

    This recall measures how well a detector separates nominal from anomalous windows. It does not
    depend on the threshold from the detector's own training arm.

    Args:
        real_scores: Scores of real nominal windows, which are not those for which the false-alarm
            rate is reported.
        anomalous_scores: Scores of anomalous windows.
        rate: Nominal false-alarm rate of the threshold.
    """
    return recall(anomalous_scores, threshold(real_scores, rate))
