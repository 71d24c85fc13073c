"""A detector with the interface of scikit-learn's outlier detectors, which runs in a `Pipeline`,
and with PyOD's attributes after a fit.
"""

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, OutlierMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from enhsim_tf.common.errors import InputError
from enhsim_tf.scoring.scorer import Scorer


class TelemetryDetector(OutlierMixin, BaseEstimator):
    """Detects anomalous samples of telemetry by the views of nominal telemetry with which `score`
    judges it.

    Rows are samples in the order of time, at a regular interval; columns are channels.

    Args:
        false_alarm_rate: Share of nominal samples to flag; `contamination` in other libraries.

    Example:
    >>> detector = TelemetryDetector().fit(nominal)
    >>> is_anomalous = detector.predict(new) == -1
    """

    def __init__(self, false_alarm_rate: float = 0.01):
        self.false_alarm_rate = false_alarm_rate

    # scikit-learn names it X
    def fit(self, X: np.ndarray, y: Any = None) -> "TelemetryDetector":  # noqa: N803
        """Learns nominal telemetry of shape `(samples, channels)`; `y` is not used.

        As in PyOD, `decision_scores_` then has the scores of the samples, higher for anomalous
        ones, from views that have not learnt them, and `labels_` is 1 above `threshold_`.

        Raises:
            InputError: If the telemetry is too short, or the rate not between 0 and 1.
        """
        X = validate_data(self, X, dtype=np.float64)  # noqa: N806
        self.scorer_ = Scorer([X], self.false_alarm_rate)
        self.offset_ = -1.0
        self.threshold_ = 1.0
        self.decision_scores_ = self.scorer_.nominal_scores
        self.labels_ = (self.decision_scores_ > self.threshold_).astype(int)
        return self

    def score_samples(self, X: np.ndarray) -> np.ndarray:  # noqa: N803
        """Returns the score of each sample of telemetry; lower is more anomalous, and below -1 is
        above the threshold.

        Raises:
            InputError: If there are fewer samples than in a window.
        """
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)  # noqa: N806
        window = self.scorer_.window
        if len(X) < window:
            raise InputError(
                f"Expected at least a window of {window} samples. Received: {len(X)}. Give more "
                "telemetry."
            )
        return -self.scorer_.score(X).samples

    def decision_function(self, X: np.ndarray) -> np.ndarray:  # noqa: N803
        """Returns `score_samples` minus the threshold: negative for anomalous samples."""
        return self.score_samples(X) - self.offset_

    def predict(self, X: np.ndarray) -> np.ndarray:  # noqa: N803
        """Returns -1 for anomalous samples and 1 for the others."""
        return np.where(self.decision_function(X) < 0, -1, 1)
