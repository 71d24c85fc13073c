"""Anomaly detectors behind one interface: `fit(windows)` on nominal telemetry, `score(windows)`, higher is stranger.

What the paper's title is about and its text never trains. A detector never sets its own threshold: whoever uses it
does, on held-out windows of the kind it was trained on.
"""

from typing import Protocol

import numpy as np

from enhsim_tf.two_sample import window_features


class Detector(Protocol):
    """What every detector does."""

    def fit(self, windows: np.ndarray) -> "Detector":
        """Learns what is nominal from windows of shape `(windows, samples)`."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """One anomaly score a window, shape `(windows,)`; higher is stranger."""


class PCAResidual:
    """Energy of a window outside the principal components of the training windows.

    Args:
        num_components: Components that count as nominal.
        seed: Seed of the randomised solver.
    """

    def __init__(self, num_components: int = 20, seed: int = 0):
        self.num_components, self.seed = num_components, seed

    def fit(self, windows: np.ndarray) -> "PCAResidual":
        """Learns the components."""
        from sklearn.decomposition import PCA

        self._pca = PCA(min(self.num_components, *windows.shape), svd_solver="randomized", random_state=self.seed).fit(windows)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Mean square of what the components leave."""
        return np.mean((windows - self._pca.inverse_transform(self._pca.transform(windows))) ** 2, axis=1)


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


class DenseAutoencoder:
    """A dense autoencoder; its score is the mean square of what it cannot reconstruct.

    Args:
        num_hidden: Units of the hidden layers.
        num_code: Units of the code.
        epochs: Passes over the windows.
        seed: Seed of the weights and of the order of the windows.
    """

    def __init__(self, num_hidden: int = 128, num_code: int = 16, epochs: int = 30, seed: int = 0):
        self.num_hidden, self.num_code, self.epochs, self.seed = num_hidden, num_code, epochs, seed

    def fit(self, windows: np.ndarray) -> "DenseAutoencoder":
        """Trains it to reconstruct the windows."""
        from enhsim_tf.enhancer import dense_stack, fit_windows

        self._mean, self._scale = np.mean(windows), np.std(windows)
        units, samples = (self.num_hidden, self.num_code, self.num_hidden), windows.shape[1]
        self._network = dense_stack(samples, (*units, samples), seed=self.seed, name="autoencoder")
        scaled = self._scaled(windows)
        fit_windows(self._network, scaled, scaled, self.epochs, batch_size=32, seed=self.seed, verbose=0, jit_compile=False)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Mean squared reconstruction error, in units of the training variance."""
        scaled = self._scaled(windows)
        return np.mean((np.asarray(self._network(scaled)) - scaled) ** 2, axis=1)

    def _scaled(self, windows: np.ndarray) -> np.ndarray:
        return ((windows - self._mean) / self._scale).astype(np.float32)
