"""Detectors of the study, the same for every use of a simulator, and their thresholds.

A detector learns nominal windows of shape `(windows, samples, channels)`: of telemetry, or of its
difference from what was expected. Known windows are scored by detectors that have not learnt from
their flight, orbit or discharge, so that thresholds are set on scores like those of new windows.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from enhsim_tf.scoring import metrics
from enhsim_tf.scoring.views import VIEWS
from studies.common.detectors import JointMeans
from studies.reference_or_source.windows import by_fold

MAIN = "joint size"
"""The detector that answers."""
_QUANTILE = 0.99  # of the scores of a view on windows that it has not learnt, which is its unit
_LEAST_UNIT = 0.01


class SumOfViews:
    """The sum of the library's views, as `scoring.scorer.Scorer` adds them up, for windows."""

    def fit(self, windows: np.ndarray) -> "SumOfViews":
        """Learns nominal windows in the order of time; units come from the half that is not
        learnt.
        """
        values = np.asarray(windows, np.float64)
        self._centre = np.median(values, axis=(0, 1))
        self._scale = values.std(axis=(0, 1)) + 1e-9
        values = self._in_units(values)
        half = len(values) // 2
        self._views = []
        self._units = []
        for make in VIEWS.values():
            scores = np.concatenate(
                [
                    make().fit(values[:half]).score(values[half:]),
                    make().fit(values[half:]).score(values[:half]),
                ]
            )
            self._units.append(max(float(np.quantile(scores, _QUANTILE)), _LEAST_UNIT))
            self._views.append(make().fit(values))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the sum of the views of each window."""
        values = self._in_units(np.asarray(windows, np.float64))
        scores = [view.score(values) for view in self._views]
        return np.sum(np.array(scores) / np.array(self._units)[:, None], axis=0)

    def _in_units(self, values: np.ndarray) -> np.ndarray:
        return (values - self._centre) / self._scale


ONE_CLASS: dict[str, Callable[[int], Any]] = {
    MAIN: lambda seed: JointMeans(),
    "sum of views": lambda seed: SumOfViews(),
}
"""Maps a name to a factory, which takes a seed and returns an unfitted detector."""


def across_folds(
    learn: Callable[[np.ndarray | None], Any], windows: np.ndarray, folds: np.ndarray
) -> tuple[Any, np.ndarray]:
    """Scores each window by a detector that has not learnt from its fold.

    Args:
        learn: Returns a detector that has learnt from some windows, a mask; None: from all.
        windows: What is scored.
        folds: Fold of each window.

    Returns:
        The detector that has learnt from all windows, and the scores.
    """

    def score(learnt: np.ndarray, held_out: np.ndarray) -> np.ndarray:
        return np.asarray(learn(learnt).score(windows[held_out]), np.float64)

    return learn(None), by_fold(folds, score)


def conformal_threshold(scores: np.ndarray, rate: float) -> float:
    """The conformal threshold, or the largest score where there are too few."""
    return metrics.finite_threshold(scores, rate)[0]
