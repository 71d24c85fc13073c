"""A detector with the interface of scikit-learn's outlier detectors, which runs in a `Pipeline`, and with PyOD's attributes after a fit."""

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, OutlierMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.options import FitOptions, ScoreOptions
from enhsim_tf.simulator.scoring import Scorer


class TelemetryDetector(OutlierMixin, BaseEstimator):
    """Detects anomalous samples of telemetry with an enhanced simulator that is fitted to nominal telemetry.

    Rows are samples in the order of time, at a regular interval; columns are channels.

    Args:
        window: Length of a window in samples. None: chosen by the fit.
        detector: Name of the detector. None: chosen by the fit.
        false_alarm_rate: Share of nominal samples to flag; `contamination` in other libraries.
        seed: Random seed.

    Example:
    >>> detector = TelemetryDetector().fit(nominal)
    >>> is_anomalous = detector.predict(new) == -1
    """

    def __init__(
        self,
        window: int | None = None,
        detector: str | None = None,
        false_alarm_rate: float = 0.01,
        seed: int = 0,
    ):
        self.window, self.detector, self.false_alarm_rate, self.seed = (
            window,
            detector,
            false_alarm_rate,
            seed,
        )

    def fit(self, X: np.ndarray, y: Any = None) -> "TelemetryDetector":  # noqa: N803  as scikit-learn names it
        """Fits simulator and detector to nominal telemetry of shape `(samples, channels)`; `y` is not used.

        As in PyOD, `decision_scores_` then has the scores of the samples, higher for anomalous ones, and `labels_` is 1 above `threshold_`.

        Raises:
            InputError: If the telemetry is constant or too short.
        """
        X = validate_data(self, X, dtype=np.float32)  # noqa: N806
        names = tuple(f"channel {number}" for number in range(X.shape[1]))
        simulator, self.report_ = fit(
            Recording((Run(X),), names, name="telemetry"),
            None,
            FitOptions(window=self.window, seed=self.seed),
        )
        self.simulator_ = simulator
        self.scorer_ = Scorer(
            simulator,
            ScoreOptions(self.detector, false_alarm_rate=self.false_alarm_rate, seed=self.seed),
        )
        self.offset_, self.threshold_ = -1.0, 1.0
        self.decision_scores_ = self.scorer_.score_series(X)
        self.labels_ = (self.decision_scores_ > self.threshold_).astype(int)
        return self

    def score_samples(self, X: np.ndarray) -> np.ndarray:  # noqa: N803
        """Returns the score of each sample of telemetry; lower is more anomalous, and below -1 is flagged.

        Raises:
            InputError: If there are fewer samples than in a window.
        """
        check_is_fitted(self)
        X, window = validate_data(self, X, dtype=np.float32, reset=False), self.simulator_.window  # noqa: N806
        if len(X) < window:
            raise InputError(
                f"Expected at least a window of {window} samples. Received: {len(X)}. Give more telemetry."
            )
        return -self.scorer_.score_series(X)

    def decision_function(self, X: np.ndarray) -> np.ndarray:  # noqa: N803
        """Returns `score_samples` minus the threshold: negative for anomalous samples."""
        return self.score_samples(X) - self.offset_

    def predict(self, X: np.ndarray) -> np.ndarray:  # noqa: N803
        """Returns -1 for anomalous samples and 1 for the others."""
        return np.where(self.decision_function(X) < 0, -1, 1)
