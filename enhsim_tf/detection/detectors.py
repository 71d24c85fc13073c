"""Anomaly detectors behind one interface: `fit(windows)` on nominal telemetry, `score(windows)`, higher is stranger.

What the paper's title is about and its text never trains. A detector never sets its own threshold: whoever uses it
does, on held-out windows of the kind it was trained on. `DETECTORS` names them all, `CONTROLS` what they must beat.
"""

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.realism.window_features import window_features


class LimitCheck:
    """How far a window leaves the range that telemetry was seen in: the check that every ground station runs.

    Args:
        low: Quantile of all training samples that is the lower limit.
        high: Quantile that is the upper one.
    """

    def __init__(self, low: float = 0.001, high: float = 0.999):
        self.low, self.high = low, high

    def fit(self, windows: np.ndarray) -> "LimitCheck":
        """Sets the limits."""
        self._limits = np.quantile(windows, [self.low, self.high])
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """The largest distance outside the limits, in the telemetry's unit; below zero the margin that was left."""
        return np.maximum(self._limits[0] - windows.min(axis=1), windows.max(axis=1) - self._limits[1])


class PCAResidual:
    """Energy of a window outside the principal components of the training windows, also known as Sub-PCA.

    Args:
        num_components: Components that count as nominal.
        seed: Seed of the randomised solver.
    """

    def __init__(self, num_components: int = 20, seed: int = 0):
        self.num_components, self.seed = num_components, seed

    def fit(self, windows: np.ndarray) -> "PCAResidual":
        """Learns the components."""
        from sklearn.decomposition import PCA

        with threadpool_limits(1):
            self._pca = PCA(min(self.num_components, *windows.shape), svd_solver="randomized", random_state=self.seed).fit(windows)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Mean square of what the components leave."""
        with threadpool_limits(1):
            return np.mean((windows - self._pca.inverse_transform(self._pca.transform(windows))) ** 2, axis=1)


class NearestNeighbours:
    """Mean Euclidean distance of a window to the training windows nearest to it.

    Args:
        num_neighbours: How many of them.
    """

    def __init__(self, num_neighbours: int = 5):
        self.num_neighbours = num_neighbours

    def fit(self, windows: np.ndarray) -> "NearestNeighbours":
        """Remembers the windows."""
        from sklearn.neighbors import NearestNeighbors

        self._index = NearestNeighbors(n_neighbors=min(self.num_neighbours, len(windows)), algorithm="brute")
        self._mean = np.mean(windows, dtype=np.float64)  # a large offset would cost the distances their last digits
        self._index.fit(windows - self._mean)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """The mean distance, in the telemetry's unit times the root of the samples."""
        with threadpool_limits(1):
            return self._index.kneighbors(windows - self._mean)[0].mean(axis=1)


class IsolationForestOnFeatures:
    """An isolation forest (Liu, Ting and Zhou 2008) on fourteen features of each window.

    Args:
        num_trees: Trees of the forest.
        seed: Seed of the forest.
    """

    def __init__(self, num_trees: int = 200, seed: int = 0):
        self.num_trees, self.seed = num_trees, seed

    def fit(self, windows: np.ndarray) -> "IsolationForestOnFeatures":
        """Grows the forest."""
        from sklearn.ensemble import IsolationForest

        self._forest = IsolationForest(n_estimators=self.num_trees, random_state=self.seed).fit(window_features(windows))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """The forest's anomaly score."""
        return -self._forest.score_samples(window_features(windows))


class OneClassSVMOnFeatures:
    """A one-class support vector machine (Schölkopf 2001) on fourteen standardised features of each window.

    Args:
        nu: Largest share of the training windows that may lie outside.
    """

    def __init__(self, nu: float = 0.01):
        self.nu = nu

    def fit(self, windows: np.ndarray) -> "OneClassSVMOnFeatures":
        """Draws the border around the features."""
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
        from sklearn.svm import OneClassSVM

        with threadpool_limits(1):
            self._machine = make_pipeline(StandardScaler(), OneClassSVM(nu=self.nu)).fit(window_features(windows))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Distance outside the border, below zero inside."""
        with threadpool_limits(1):
            return -self._machine.decision_function(window_features(windows))


class RandomScore:
    """Control: a score that knows nothing. Each call draws on.

    Args:
        seed: Seed of the draws.
    """

    def __init__(self, seed: int = 0):
        self._rng = np.random.default_rng(seed)

    def fit(self, windows: np.ndarray) -> "RandomScore":
        """Learns nothing."""
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Uniform draws from 0 to 1."""
        return self._rng.random(len(windows))


class LargestStep:
    """Control of one line: the largest absolute first difference. What it finds was no hard anomaly (Wu and Keogh 2021)."""

    def fit(self, windows: np.ndarray) -> "LargestStep":
        """Learns nothing."""
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """The largest step, in the telemetry's unit."""
        return np.abs(np.diff(windows, axis=1)).max(axis=1)


class MovingDeviation:
    """Control of one line: the largest standard deviation in a short stretch.

    Args:
        width: Samples of the stretch.
    """

    def __init__(self, width: int = 25):
        self.width = width

    def fit(self, windows: np.ndarray) -> "MovingDeviation":
        """Learns nothing."""
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """The largest deviation over the places of the stretch, in the telemetry's unit."""
        centred = np.asarray(windows, np.float64) - np.mean(windows, axis=1, keepdims=True, dtype=np.float64)
        sums = np.cumsum(np.pad([centred, centred**2], ((0, 0), (0, 0), (1, 0))), axis=2)
        mean, square = (sums[:, :, self.width :] - sums[:, :, : -self.width]) / self.width
        return np.sqrt(np.maximum(square - mean**2, 0).max(axis=1))
