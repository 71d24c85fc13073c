"""Says where an enhanced simulator cannot be trusted: how far a coarse window is from those its enhancer was trained on.

It looks at coarse windows alone, so it costs no network and needs no truth. What it cannot know is whether the coarse
simulator itself is right.
"""

import os

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import load_npz

_CHUNK = 2_048  # windows scored at a time
_MOST_REMEMBERED = 10_000  # training windows whose coordinates are kept
_MOST_BYTES = 2**28  # of a saved score; they are a thousand times smaller
_FITTED = ("mean", "unit", "components", "coordinates")


class OutOfRange:
    """Distance of a coarse window to the training windows, in which directions that training never took count in full.

    The principal components of the training windows that explain most of their variance split a window in two: what
    they leave, about which the enhancer learned nothing, and its coordinates, within which the enhancer interpolates from
    the nearest training window. The score is

        sqrt(mean square of what is left + weight * mean square to the nearest training window's coordinates) / unit

    with the standard deviation of the training windows as unit. Its zero is not reached: nominal windows have a small
    score of their own. For a limit, take `detection.threshold` of the scores of held-out nominal windows.

    Why this one, judged by the rank correlation with the true error of the paper's enhancer, over degraded modes of all
    severities and over waves in other proportions and phases: what the components leave is as good in the degraded
    modes, but alone it does not see nominal waves in proportions and phases that training never had. The distance to the
    nearest training window sees those, and ranks the degraded modes worse: it counts in full a shift along directions
    that the enhancer follows well. The Mahalanobis distance among the components falls where most modes get worse.

    Args:
        explained: Share of the training windows' variance that the components explain, between 0 and 1.
        weight: Of the distance within the components, from 0 to 1; 1 makes it about the nearest-neighbour distance.

    Example:
    >>> out_of_range = OutOfRange().fit(coarse_training_windows)
    >>> limit = detection.threshold(out_of_range.score(coarse_held_out_windows), rate=0.01)
    >>> trusted = out_of_range.score(coarse_degraded_windows) <= limit
    """

    def __init__(self, explained: float = 0.95, weight: float = 0.25):
        if not (0 < explained < 1 and 0 <= weight <= 1):
            raise InputError(f"Expected 0 < explained < 1 and 0 <= weight <= 1. Received: explained={explained}, weight={weight}.")
        self.explained, self.weight = explained, weight

    def fit(self, coarse_windows: np.ndarray) -> "OutOfRange":
        """Learns the range.

        Args:
            coarse_windows: The enhancer's training windows, shape `(windows, samples)`; those that repeat count once.

        Returns:
            The fitted score.

        Raises:
            InputError: If there are fewer than two different windows or a value is not finite.
        """
        windows = _checked(coarse_windows)
        distinct = np.unique(windows, axis=0)
        if len(distinct) < 2:
            raise InputError(f"Expected at least two different coarse windows. Received: {len(distinct)} of {len(windows)}.")
        self._mean = distinct.mean(axis=0)
        centred = distinct - self._mean
        self._unit = np.sqrt(np.mean(centred**2))
        with threadpool_limits(1):
            _, values, directions = np.linalg.svd(centred, full_matrices=False)
            share = np.cumsum(values**2) / np.sum(values**2)
            self._components = directions[: np.searchsorted(share, self.explained) + 1].copy()
            coordinates = centred[:: -(-len(centred) // _MOST_REMEMBERED)] @ self._components.T
        self._coordinates = coordinates.astype(np.float32)
        return self

    def score(self, coarse_windows: np.ndarray) -> np.ndarray:
        """One score a window, float64 of shape `(windows,)`: 0 or little in range, around 1 as far as training is wide.

        Args:
            coarse_windows: Coarse windows, shape `(windows, samples)`.

        Raises:
            InputError: If it was not fitted, the windows have another length or a value is not finite.
        """
        self._check_fitted()
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

    def save(self, path: str | os.PathLike) -> None:
        """Saves to one `.npz` file, well below a megabyte for an enhancer's usual number of training windows.

        Raises:
            InputError: If it was not fitted.
        """
        self._check_fitted()
        with replace_file(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, explained=self.explained, weight=self.weight, **{name: getattr(self, f"_{name}") for name in _FITTED})

    @classmethod
    def load(cls, path: str | os.PathLike) -> "OutOfRange":
        """Loads what `save` wrote; nothing in the file is executed.

        Raises:
            InputError: If `save` did not write the file.
        """
        try:
            kept = load_npz(path, _MOST_BYTES)
            loaded = cls(float(kept["explained"]), float(kept["weight"]))
            for name in _FITTED:
                setattr(loaded, f"_{name}", kept[name])
            loaded._score(np.zeros((1, len(loaded._mean))))  # whether they fit together
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise InputError(f"Expected a file written by OutOfRange.save. Received: {path} ({type(error).__name__}).") from None
        return loaded

    def _check_fitted(self) -> None:
        if not hasattr(self, "_mean"):
            raise InputError("Expected a fitted score. Received: OutOfRange before fit. Call fit with the training windows.")


def _checked(windows: np.ndarray, num_samples: int | None = None) -> np.ndarray:
    windows = np.asarray(windows, np.float64)
    if windows.ndim != 2 or num_samples not in (None, windows.shape[-1]) or not np.isfinite(windows).all():
        wanted = "samples" if num_samples is None else num_samples
        raise InputError(f"Expected finite coarse windows of shape (windows, {wanted}). Received: shape {windows.shape}.")
    return windows
