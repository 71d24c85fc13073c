"""Out-of-range score: how far a coarse window lies from the enhancer's training windows (an addition to section 2.2 of the paper).

The score is computed from coarse windows only. It needs neither a network nor the true telemetry. It cannot detect an
error of the coarse simulator itself.
"""

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.errors import InputError

_CHUNK = 2_048  # number of windows scored at a time
_MAX_KEPT = 10_000  # maximum number of training windows whose coordinates are kept


class OutOfRange:
    """Distance of a coarse window from the training windows, weighting the residual outside their PCA subspace by 1.

    A principal component analysis (PCA) of the training windows splits each window into two parts: its coordinates in the
    subspace of the leading components, and the residual outside that subspace. The enhancer has learned nothing about
    residual directions. Within the subspace, it interpolates between training windows. The score is

        sqrt(mean squared residual + weight * mean squared distance to the nearest training window's coordinates) / unit

    where `unit` is the standard deviation of the training windows. Nominal windows have a small positive score rather than zero.
    Of four candidates, this form ranks degraded modes and nominal waves in other proportions and phases best by the true error of the
    paper's enhancer: the residual alone does not see such waves, the distance alone overrates shifts that the enhancer follows well, and the
    Mahalanobis distance decreases when most of the modes become more severe.

    Args:
        explained: Share of the training windows' variance that the components explain, between 0 and 1.
        weight: Weight of the distance within the subspace, from 0 to 1. With 1, the score is approximately the distance to the
            nearest training window.

    Example:
    >>> out_of_range = OutOfRange().fit(coarse_training_windows)
    >>> limit = metrics.threshold(out_of_range.score(coarse_held_out_windows), rate=0.01)
    >>> trusted = out_of_range.score(coarse_degraded_windows) <= limit
    """

    def __init__(self, explained: float = 0.95, weight: float = 0.25):
        if not (0 < explained < 1 and 0 <= weight <= 1):
            raise InputError(f"Expected 0 < explained < 1 and 0 <= weight <= 1. Received: explained={explained}, weight={weight}.")
        self.explained, self.weight = explained, weight

    def fit(self, coarse_windows: np.ndarray) -> "OutOfRange":
        """Fits the principal components to training windows of shape `(windows, samples)`; duplicates are counted once.

        Raises:
            InputError: If there are fewer than two distinct windows, or if a value is not finite.
        """
        windows = _checked(coarse_windows)
        distinct = np.unique(windows, axis=0)
        if len(distinct) < 2:
            raise InputError(f"Expected at least two distinct coarse windows. Received: {len(distinct)} of {len(windows)}.")
        self._mean = distinct.mean(axis=0)
        centred = distinct - self._mean
        self._unit = np.sqrt(np.mean(centred**2))
        with threadpool_limits(1):
            _, values, directions = np.linalg.svd(centred, full_matrices=False)
            share = np.cumsum(values**2) / np.sum(values**2)
            self._components = directions[: np.searchsorted(share, self.explained) + 1].copy()
            coordinates = centred[:: -(-len(centred) // _MAX_KEPT)] @ self._components.T
        self._coordinates = coordinates.astype(np.float32)
        return self

    def score(self, coarse_windows: np.ndarray) -> np.ndarray:
        """Computes the score of each window of shape `(windows, samples)`, float64 of shape `(windows,)`.

        Windows within the training range score close to 0, one that is a standard deviation of the training windows away about 1.

        Raises:
            InputError: If the windows differ in length from the training windows, or if a value is not finite.
        """
        windows = _checked(coarse_windows, len(self._mean))
        with threadpool_limits(1):
            chunks = [self._score(windows[begin : begin + _CHUNK]) for begin in range(0, len(windows), _CHUNK)]
        return np.concatenate([np.zeros(0), *chunks])

    def _score(self, windows: np.ndarray) -> np.ndarray:
        from scipy.spatial.distance import cdist

        centred = windows - self._mean
        coordinates = centred @ self._components.T
        left = np.sum((centred - coordinates @ self._components) ** 2, axis=1)
        nearest = cdist(coordinates, self._coordinates, "sqeuclidean").min(axis=1)
        return np.sqrt((left + self.weight * nearest) / windows.shape[1]) / self._unit


def _checked(windows: np.ndarray, num_samples: int | None = None) -> np.ndarray:
    windows = np.asarray(windows, np.float64)
    if windows.ndim != 2 or num_samples not in (None, windows.shape[-1]) or not np.isfinite(windows).all():
        wanted = "samples" if num_samples is None else num_samples
        raise InputError(f"Expected finite coarse windows of shape (windows, {wanted}). Received: shape {windows.shape}.")
    return windows
