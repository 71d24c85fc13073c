"""The interface that all anomaly detectors share (title and abstract of the paper)."""

from typing import Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class Detector(Protocol):
    """An anomaly detector for windows of telemetry.

    A detector does not choose its own threshold. The caller chooses it with `metrics.threshold`, from the scores of
    held-out windows of the same kind as the training windows.
    """

    def fit(self, windows: np.ndarray) -> "Detector":
        """Learns what is nominal from windows of shape `(windows, samples)`, and returns the detector."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns one anomaly score for each window, shape `(windows,)`; higher is more anomalous."""
