"""Adapter for anomaly detectors of other libraries, such as scikit-learn and PyOD (title and abstract of the paper)."""

from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.interface import Detector


class EstimatorDetector:
    """A detector that wraps an outlier estimator of scikit-learn or PyOD.

    Args:
        estimator: An unfitted estimator with `fit(X)`, and with `score_samples(X)` (scikit-learn: higher is more normal) or
            `decision_function(X)` (PyOD: higher is more anomalous). `score_samples` takes precedence.

    Raises:
        InputError: If the estimator lacks these methods.
    """

    def __init__(self, estimator: Any):
        if not hasattr(estimator, "fit") or not (hasattr(estimator, "score_samples") or hasattr(estimator, "decision_function")):
            raise InputError(
                "Expected an estimator with `fit`, and with `score_samples` or `decision_function`. "
                f"Received: {type(estimator).__name__}. LocalOutlierFactor needs novelty=True."
            )
        self.estimator = estimator

    def fit(self, windows: np.ndarray) -> "EstimatorDetector":
        """Fits the estimator to windows of shape `(windows, samples)`, one row of its input each."""
        self.estimator.fit(windows)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the estimator's score of each window, shape `(windows,)`, with the sign that makes higher more anomalous.

        Raises:
            InputError: If the estimator does not return one score for each window.
        """
        if hasattr(self.estimator, "score_samples"):
            scores = -np.asarray(self.estimator.score_samples(windows))
        else:
            scores = np.asarray(self.estimator.decision_function(windows))
        if scores.shape != (len(windows),):
            name = type(self.estimator).__name__
            raise InputError(f"Expected one score for each of {len(windows)} windows. Received: shape {scores.shape} from {name}.")
        return scores


def as_detector(estimator: Any) -> Detector:
    """Wraps an estimator of scikit-learn or PyOD; a detector of this package's interface is returned unchanged.

    Args:
        estimator: A detector with `fit` and `score`, or an estimator that `EstimatorDetector` accepts.

    Returns:
        A detector whose `score` is higher for more anomalous windows.

    Raises:
        InputError: If it is neither.
    """
    is_estimator = hasattr(estimator, "score_samples") or hasattr(estimator, "decision_function")
    return estimator if isinstance(estimator, Detector) and not is_estimator else EstimatorDetector(estimator)
