"""Detectors and classifiers of the study, the same for every use of a simulator, and their thresholds.

A detector learns nominal windows of shape `(windows, samples, channels)`: of telemetry, or of its difference from a simulator. Known windows
are scored by detectors that have not learnt from their flight or orbit, so that thresholds are set on scores that are like those of new windows.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.detection import detectors, metrics
from studies.common.detectors import NearestNeighbours, features
from studies.reference_or_source.windows import by_fold

RATE = 0.01
"""Share of false alarms that thresholds are set for."""
_LEAST_TAIL = 10  # scores beyond the 90 % quantile to which a tail is fitted


class Size:
    """The root mean square of the channel that is largest in units of its nominal one."""

    def fit(self, windows: np.ndarray) -> "Size":
        """Measures nominal windows."""
        self._mean = windows.mean(axis=(0, 1))
        self._scale = np.sqrt(np.mean((windows - self._mean) ** 2, axis=(0, 1))) + 1e-9
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the size of each window."""
        return np.sqrt(np.mean(((windows - self._mean) / self._scale) ** 2, axis=1)).max(axis=1)


class Discord:
    """Distance of a window, each channel at mean 0 and deviation 1, to the nearest known one: the matrix-profile discord."""

    def fit(self, windows: np.ndarray) -> "Discord":
        """Keeps the known windows."""
        self._nearest = NearestNeighbours(1).fit(self._normal(windows))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the distance of each window."""
        return self._nearest.score(self._normal(windows))

    @staticmethod
    def _normal(windows: np.ndarray) -> np.ndarray:
        spread = windows.std(axis=1, keepdims=True)
        return (windows - windows.mean(axis=1, keepdims=True)) / np.maximum(spread, 1e-3)


ONE_CLASS: Mapping[str, Callable[[int], Any]] = {
    "size": lambda seed: Size(),
    "joint size": lambda seed: detectors.JointMeans(),
    "PCA residual": lambda seed: detectors.PCAResidual(seed=seed),
    "nearest neighbours": lambda seed: NearestNeighbours(),
    "vector autoregression": lambda seed: detectors.Innovation(),
}
ONE_LINERS: Mapping[str, Callable[[int], Any]] = {
    "largest step": lambda seed: detectors.LargestStep(),
    "moving deviation": lambda seed: detectors.MovingDeviation(),
    "discord": lambda seed: Discord(),
}
"""Scores for telemetry without a simulator, beside `ONE_CLASS`."""
CLASSIFIERS = ("logistic regression", "boosted trees")


def across_folds(
    make: Callable[[int], Any], windows: np.ndarray, folds: np.ndarray, seed: int
) -> tuple[Any, np.ndarray]:
    """Fits a detector to all windows, and scores each of them by one that has not learnt from its fold.

    Returns:
        The detector, and the scores.
    """

    def score(learnt: np.ndarray, held_out: np.ndarray) -> np.ndarray:
        return np.asarray(make(seed).fit(windows[learnt]).score(windows[held_out]), np.float64)

    return make(seed).fit(windows), by_fold(folds, score)


def classifier(
    name: str, nominal: np.ndarray, faulty: np.ndarray, seed: int
) -> Callable[[np.ndarray], np.ndarray]:
    """Trains a classifier of `CLASSIFIERS`, and returns a function that scores how likely windows are faulty."""
    labels = np.repeat([0, 1], [len(nominal), len(faulty)])
    learnt = np.concatenate([nominal, faulty])
    if name == "boosted trees":
        from sklearn.ensemble import HistGradientBoostingClassifier

        with threadpool_limits(1):
            trees = HistGradientBoostingClassifier(max_iter=60, random_state=seed).fit(
                features(learnt), labels
            )
        return lambda windows: trees.decision_function(features(windows))
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    with threadpool_limits(1):
        machine = make_pipeline(StandardScaler(), LogisticRegression(C=0.01, max_iter=200)).fit(
            detectors.flat(learnt), labels
        )
    return lambda windows: machine.decision_function(detectors.flat(windows))


def tail_threshold(scores: np.ndarray, rate: float = RATE) -> float:
    """The quantile of a generalised Pareto law that is fitted to the tenth of the scores that is largest.

    Args:
        scores: Scores of nominal windows.
        rate: Share of new scores that should exceed the threshold.

    Returns:
        The threshold; the conformal one where the tail has too few scores.

    References:
        Siffer et al., "Anomaly detection in streams with extreme value theory", 2017.
    """
    from scipy.stats import genpareto

    begin = float(np.quantile(scores, 0.9))
    beyond = scores[scores > begin] - begin
    if len(beyond) < _LEAST_TAIL or np.ptp(beyond) == 0:
        return conformal_threshold(scores, rate)
    shape, _, scale = genpareto.fit(beyond, floc=0)
    return begin + float(genpareto.isf(rate * len(scores) / len(beyond), shape, 0, scale))


def conformal_threshold(scores: np.ndarray, rate: float = RATE) -> float:
    """The conformal threshold, or the largest score where there are too few."""
    return metrics.finite_threshold(scores, rate)[0]


THRESHOLDS = {"conformal": conformal_threshold, "Pareto tail": tail_threshold}
