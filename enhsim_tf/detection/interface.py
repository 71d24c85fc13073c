"""The interface that all anomaly detectors share, and the adapter for those of other libraries (title and abstract of the paper)."""

from typing import Any, Protocol, runtime_checkable

import numpy as np

from enhsim_tf.common.errors import InputError


@runtime_checkable
class Detector(Protocol):
    """An anomaly detector for windows of telemetry. Its threshold is chosen by the caller, with `metrics.threshold`."""

    def fit(self, windows: np.ndarray) -> "Detector":
        """Learns what is nominal from windows of shape `(windows, samples)`, and returns the detector."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns one anomaly score for each window, shape `(windows,)`; higher is more anomalous."""


class EstimatorDetector:
    """A detector that wraps an unfitted outlier estimator of scikit-learn or PyOD.

    It has `fit(X)`, and `score_samples(X)` (scikit-learn: higher is more normal) or else `decision_function(X)` (PyOD: higher is more
    anomalous). Raises InputError if it lacks these methods.
    """

    def __init__(self, estimator: Any):
        if not (hasattr(estimator, "fit") and _is_estimator(estimator)):
            raise InputError(
                "Expected an estimator with `fit`, and with `score_samples` or `decision_function`. "
                f"Received: {type(estimator).__name__}. LocalOutlierFactor needs novelty=True."
            )
        self.estimator = estimator

    def fit(self, windows: np.ndarray) -> "EstimatorDetector":
        """Fits the estimator to windows of shape `(windows, samples)`."""
        self.estimator.fit(windows)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the estimator's score of each window, shape `(windows,)`; higher is more anomalous."""
        if hasattr(self.estimator, "score_samples"):
            scores = -np.asarray(self.estimator.score_samples(windows))
        else:
            scores = np.asarray(self.estimator.decision_function(windows))
        if scores.shape != (len(windows),):
            name = type(self.estimator).__name__
            raise InputError(f"Expected one score for each of {len(windows)} windows. Received: shape {scores.shape} from {name}.")
        return scores


def _is_estimator(candidate: Any) -> bool:
    return hasattr(candidate, "score_samples") or hasattr(candidate, "decision_function")


def as_detector(estimator: Any) -> Detector:
    """Wraps an estimator by `EstimatorDetector`; a detector with `fit` and `score` is returned unchanged."""
    return estimator if isinstance(estimator, Detector) and not _is_estimator(estimator) else EstimatorDetector(estimator)
