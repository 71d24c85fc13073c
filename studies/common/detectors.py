"""Detectors of the studies: simple scores of windows, neighbours, a forest, a support vector
machine, and two autoencoders.

Windows have the shape `(windows, samples, channels)`; several channels are given in units of their
standard deviations. Where windows are seen channel by channel, a single channel may do without its
axis. Keras is imported only when an autoencoder is trained.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.two_sample import window_features

_WIDTH = 25  # samples of a moving deviation


class Detector(Protocol):
    """An anomaly detector for windows of telemetry. Its threshold is chosen by the caller."""

    def fit(self, windows: np.ndarray) -> "Detector":
        """Learns what is nominal from windows of shape `(windows, samples)`, and returns the
        detector.
        """

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns one anomaly score for each window, shape `(windows,)`; higher is more
        anomalous.
        """


def flat(windows: np.ndarray) -> np.ndarray:
    """Windows with the channels one after the other, shape `(windows, channels * samples)`."""
    return windows.swapaxes(1, -1).reshape(len(windows), -1)


class LimitCheck:
    """Limit check, as it is common in ground stations: the distance by which a window leaves the
    range of the training samples.
    """

    def fit(self, windows: np.ndarray) -> "LimitCheck":
        """Computes the limits, the quantiles of 0.1 % and 99.9 % of nominal samples."""
        self._limits = np.quantile(windows, [0.001, 0.999], axis=(0, 1))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the largest distance outside the limits, in the unit of the telemetry; within
        them, minus the remaining margin.
        """
        beyond = np.maximum(
            self._limits[0] - windows.min(axis=1), windows.max(axis=1) - self._limits[1]
        )
        return beyond.reshape(len(windows), -1).max(axis=1)


@dataclasses.dataclass
class PCAResidual:
    """Residual of a window outside so many principal components of the training windows, also known
    as Sub-PCA.
    """

    num_components: int = 20
    seed: int = 0

    def fit(self, windows: np.ndarray) -> "PCAResidual":
        """Computes the principal components of nominal windows."""
        from sklearn.decomposition import PCA

        windows = flat(windows)
        # the shares of variance of equal windows are not used
        with threadpool_limits(1), np.errstate(invalid="ignore"):
            self._pca = PCA(
                min(self.num_components, *windows.shape),
                svd_solver="randomized",
                random_state=self.seed,
            ).fit(windows)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squared residual of each window."""
        windows = flat(windows)
        with threadpool_limits(1):
            return np.mean(
                (windows - self._pca.inverse_transform(self._pca.transform(windows))) ** 2, axis=1
            )


class JointMeans:
    """Mahalanobis distance of the means of all channels of a window.

    A small change of one channel against the others is large where they hardly move apart
    otherwise; shrinkage of the covariance would hide it.
    """

    def fit(self, windows: np.ndarray) -> "JointMeans":
        """Estimates mean and covariance from nominal windows."""
        from sklearn.covariance import EmpiricalCovariance

        self._covariance = EmpiricalCovariance().fit(np.mean(windows, axis=1, dtype=np.float64))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the squared distance of each window, divided by the number of means: about 1 for
        nominal windows.
        """
        means = np.mean(windows, axis=1, dtype=np.float64)
        return self._covariance.mahalanobis(means) / means.shape[1]


class Control:
    """A trivial detector without anything to learn. Anomalies that it finds are trivial to detect
    (Wu and Keogh 2021).
    """

    def fit(self, windows: np.ndarray) -> "Control":
        """Does nothing."""
        return self


class LargestStep(Control):
    """Control: the largest absolute first difference."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the largest absolute first difference of each window, in the unit of the
        telemetry.
        """
        return np.abs(np.diff(windows, axis=1)).reshape(len(windows), -1).max(axis=1)


class MovingDeviation(Control):
    """Control: the largest standard deviation of 25 neighbouring samples."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the largest moving standard deviation of each window, in the unit of the
        telemetry.
        """
        centred = np.asarray(windows, np.float64) - np.mean(
            windows, axis=1, keepdims=True, dtype=np.float64
        )
        centred = centred.reshape(*windows.shape[:2], -1)
        width = min(_WIDTH, windows.shape[1])
        sums = np.cumsum(np.pad([centred, centred**2], ((0, 0), (0, 0), (1, 0), (0, 0))), axis=2)
        mean, square = (sums[:, :, width:] - sums[:, :, :-width]) / width
        return np.sqrt(np.maximum(square - mean**2, 0).max(axis=(1, 2)))


class RandomScore(Control):
    """Random scores, independent of the windows. Each call continues the random sequence.

    Args:
        seed: Seed for the scores.
    """

    def __init__(self, seed: int = 0):
        self._rng = np.random.default_rng(seed)

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns random numbers that are uniformly distributed between 0 and 1."""
        return self._rng.random(len(windows))


def features(windows: np.ndarray) -> np.ndarray:
    """The features of `window_features` of each channel."""
    return window_features(windows.swapaxes(1, -1).reshape(-1, windows.shape[1])).reshape(
        len(windows), -1
    )


@dataclasses.dataclass
class IsolationForestOnFeatures:
    """Isolation forest (Liu, Ting and Zhou 2008) on the fourteen features of `window_features`."""

    seed: int = 0

    def fit(self, windows: np.ndarray) -> "IsolationForestOnFeatures":
        """Fits the forest to nominal windows."""
        from sklearn.ensemble import IsolationForest

        self._forest = IsolationForest(n_estimators=200, random_state=self.seed).fit(
            features(windows)
        )
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the anomaly score of the forest."""
        return -self._forest.score_samples(features(windows))


@dataclasses.dataclass
class NearestNeighbours:
    """Mean Euclidean distance of a window to so many nearest training windows."""

    num_neighbours: int = 5

    def fit(self, windows: np.ndarray) -> "NearestNeighbours":
        """Stores the nominal windows."""
        from sklearn.neighbors import NearestNeighbors

        self._index = NearestNeighbors(
            n_neighbors=min(self.num_neighbours, len(windows)), algorithm="brute"
        )
        # subtracted, because a large offset would reduce the precision of the distances
        self._mean = np.mean(windows, dtype=np.float64)
        self._index.fit(flat(windows) - self._mean)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean distance, in the unit of the telemetry times the square root of the
        number of samples.
        """
        with threadpool_limits(1):
            return self._index.kneighbors(flat(windows) - self._mean)[0].mean(axis=1)


class OneClassSVMOnFeatures:
    """One-class support vector machine (Schölkopf 2001) on the standardised features of
    `window_features`.
    """

    def fit(self, windows: np.ndarray) -> "OneClassSVMOnFeatures":
        """Fits the decision boundary, which leaves at most 1 % of the nominal windows outside."""
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
        from sklearn.svm import OneClassSVM

        with threadpool_limits(1):
            self._machine = make_pipeline(StandardScaler(), OneClassSVM(nu=0.01)).fit(
                features(windows)
            )
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the signed distance from the decision boundary, which is negative inside."""
        with threadpool_limits(1):
            return -self._machine.decision_function(features(windows))


class _Autoencoder:
    """Scores windows by the mean squared reconstruction error of a network that `_build` makes,
    trained for so many epochs.
    """

    default_epochs = 30
    learning_rate = 0.001

    def __init__(self, epochs: int | None = None, seed: int = 0):
        self.epochs = epochs or self.default_epochs
        self.seed = seed

    def fit(self, windows: np.ndarray) -> "_Autoencoder":
        """Trains the autoencoder to reconstruct nominal windows of shape `(windows, samples)`."""
        from studies.common.training import fit_windows

        windows = flat(windows)
        self._mean = np.mean(windows)
        self._scale = np.std(windows)
        self._network = self._build(windows.shape[1])
        scaled = self._scaled(windows)
        fit_windows(
            self._network,
            scaled,
            scaled,
            self.epochs,
            batch_size=32,
            seed=self.seed,
            learning_rate=self.learning_rate,
        )
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squared reconstruction error of each window, in units of the variance of
        the training windows.
        """
        scaled = self._scaled(flat(windows))
        return np.mean((self._reconstruct(scaled) - scaled) ** 2, axis=1)

    def _scaled(self, windows: np.ndarray) -> np.ndarray:
        return ((windows - self._mean) / self._scale).astype(np.float32)


class DenseAutoencoder(_Autoencoder):
    """Dense autoencoder with hidden layers of 128 units and a bottleneck of 16."""

    def _build(self, samples: int) -> "keras.Sequential":  # noqa: F821 - Keras is not imported for a type hint
        from studies.common.training import dense_stack

        return dense_stack(samples, (128, 16, 128, samples), seed=self.seed, name="autoencoder")

    def _reconstruct(self, scaled: np.ndarray) -> np.ndarray:
        return np.asarray(self._network(scaled))


class ConvolutionalAutoencoder(_Autoencoder):
    """Convolutional autoencoder, which is local and translation-invariant.

    Two convolutions of stride 4 compress every sixteen samples to four numbers, and two transposed
    convolutions decode them.
    """

    default_epochs = 15
    learning_rate = 0.003

    def _build(self, samples: int) -> "keras.Sequential":  # noqa: F821 - Keras is not imported for a type hint
        from enhsim_tf.common.backend import keras

        # number of zeros that are appended to a window and removed from the output
        missing = -samples % 16
        layers = keras.layers
        kernels = [keras.initializers.HeUniform(self.seed * 1000 + number) for number in range(4)]
        options = {"kernel_size": 9, "strides": 4, "padding": "same"}
        return keras.Sequential(
            [
                keras.Input((samples,)),
                layers.Reshape((samples, 1)),
                layers.ZeroPadding1D((0, missing)),
                layers.Conv1D(16, activation="relu", kernel_initializer=kernels[0], **options),
                layers.Conv1D(4, kernel_initializer=kernels[1], **options),
                layers.Conv1DTranspose(
                    16, activation="relu", kernel_initializer=kernels[2], **options
                ),
                layers.Conv1DTranspose(1, kernel_initializer=kernels[3], **options),
                layers.Cropping1D((0, missing)),
                layers.Reshape((samples,)),
            ],
            name="convolutional_autoencoder",
        )

    def _reconstruct(self, scaled: np.ndarray) -> np.ndarray:
        from enhsim_tf.paper.enhancer import predict

        return predict(self._network, scaled)


DETECTORS: dict[str, Callable[[int], Any]] = {
    "limit check": lambda seed: LimitCheck(),
    "PCA residual": lambda seed: PCAResidual(seed=seed),
    "nearest neighbours": lambda seed: NearestNeighbours(),
    "isolation forest": lambda seed: IsolationForestOnFeatures(seed),
    "one-class SVM": lambda seed: OneClassSVMOnFeatures(),
    "dense autoencoder": lambda seed: DenseAutoencoder(seed=seed),
    "convolutional autoencoder": lambda seed: ConvolutionalAutoencoder(seed=seed),
}
"""Maps a name to a factory, which takes a seed and returns an unfitted detector; the simplest
first, and the networks last.
"""
CONTROLS: dict[str, Callable[[int], Detector]] = {
    "random score": RandomScore,
    "largest step": lambda seed: LargestStep(),
    "moving deviation": lambda seed: MovingDeviation(),
}
"""Maps each control's name to a factory, as `DETECTORS`. Every useful detector should outperform
these trivial scores.
"""
