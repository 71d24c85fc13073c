"""Out-of-range score: how far a coarse window lies from the enhancer's training windows (an
addition to section 2.2 of the paper).
"""

import numpy as np
from threadpoolctl import threadpool_limits

_CHUNK = 2_048  # number of windows scored at a time
_EXPLAINED = 0.95  # share of the training windows' variance that the components explain
# of the distance within the subspace; with 1, the score is about the distance to the nearest
# training window
_WEIGHT = 0.25


class OutOfRange:
    """Distance of a coarse window from the training windows.

    A principal component analysis of the training windows splits each window into its coordinates
    in the subspace of the leading components, between which the enhancer interpolates, and the
    residual, about which it has learned nothing. The score is

        sqrt(mean squared residual + 0.25 * mean squared distance to the nearest training window's
        coordinates) / unit

    where `unit` is the standard deviation of the training windows. Of four candidates, this form
    ranks degraded modes and waves in unseen phases best by the true error of the paper's enhancer:
    the residual alone is blind to unseen phases, and the distance alone gives full weight to shifts
    that the enhancer follows well. A limit is `scoring.metrics.threshold` of held-out nominal
    windows.
    """

    def fit(self, coarse_windows: np.ndarray) -> "OutOfRange":
        """Fits to the enhancer's training windows, shape `(windows, samples)`. Duplicates are
        counted once. If all are the same, the score is the distance from them.
        """
        distinct = np.unique(np.asarray(coarse_windows, np.float64), axis=0)
        self._mean = distinct.mean(axis=0)
        centred = distinct - self._mean
        self._unit = np.sqrt(np.mean(centred**2)) or 1.0  # of windows that are all the same
        with threadpool_limits(1):
            _, values, directions = np.linalg.svd(centred, full_matrices=False)
            share = np.cumsum(values**2) / (np.sum(values**2) or 1.0)
            number = np.searchsorted(share, _EXPLAINED) + 1
            self._components = directions[:number][values[:number] > 0]
            self._coordinates = (centred @ self._components.T).astype(np.float32)
        return self

    def score(self, coarse_windows: np.ndarray) -> np.ndarray:
        """Scores coarse windows of shape `(windows, samples)`, float64 of shape `(windows,)`: close
        to 0 within the training range.
        """
        from scipy.spatial.distance import cdist

        scores = np.empty(len(coarse_windows))
        for begin in range(0, len(scores), _CHUNK):
            centred = np.asarray(coarse_windows[begin : begin + _CHUNK], np.float64) - self._mean
            with threadpool_limits(1):
                coordinates = centred @ self._components.T
                left = np.sum((centred - coordinates @ self._components) ** 2, axis=1)
            nearest = cdist(coordinates, self._coordinates, "sqeuclidean").min(axis=1)
            scores[begin : begin + _CHUNK] = (
                np.sqrt((left + _WEIGHT * nearest) / centred.shape[1]) / self._unit
            )
        return scores
