"""Anomaly detectors that use the reconstruction error of an autoencoder (title and abstract of the paper).

Keras is imported only when a detector is trained.
"""

import numpy as np

from enhsim_tf.detection.detectors import flat


class DenseAutoencoder:
    """Anomaly detector that uses the mean squared reconstruction error of a dense autoencoder.

    Args:
        num_hidden: Number of units in each hidden layer.
        num_code: Number of units in the bottleneck layer.
        epochs: Number of training epochs.
        seed: Seed for the initial weights and for the shuffling of the windows.
    """

    def __init__(self, num_hidden: int = 128, num_code: int = 16, epochs: int = 30, seed: int = 0):
        self.num_hidden, self.num_code, self.epochs, self.seed = num_hidden, num_code, epochs, seed

    def fit(self, windows: np.ndarray) -> "DenseAutoencoder":
        """Trains the autoencoder to reconstruct nominal windows of shape `(windows, samples)`."""
        from enhsim_tf.common.training import dense_stack, fit_windows

        windows = flat(windows)
        self._mean, self._scale = np.mean(windows), np.std(windows)
        units, samples = (self.num_hidden, self.num_code, self.num_hidden), windows.shape[1]
        self._network = dense_stack(samples, (*units, samples), seed=self.seed, name="autoencoder")
        scaled = self._scaled(windows)
        fit_windows(self._network, scaled, scaled, self.epochs, batch_size=32, seed=self.seed)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squared reconstruction error of each window, in units of the variance of the training windows."""
        scaled = self._scaled(flat(windows))
        return np.mean((np.asarray(self._network(scaled)) - scaled) ** 2, axis=1)

    def _scaled(self, windows: np.ndarray) -> np.ndarray:
        return ((windows - self._mean) / self._scale).astype(np.float32)


class ConvolutionalAutoencoder:
    """Anomaly detector that uses the mean squared reconstruction error of a convolutional autoencoder.

    The encoder has two convolutions of stride 4, which compress every sixteen samples to `num_code` numbers. The decoder has
    the corresponding transposed convolutions. The network is local and translation-invariant.

    Args:
        filters: Number of filters of the outer convolutions.
        width: Width of each filter in samples.
        num_code: Number of channels of the bottleneck layer.
        epochs: Number of training epochs.
        seed: Seed for the initial weights and for the shuffling of the windows.
    """

    stride = 4

    def __init__(self, filters: int = 16, width: int = 9, num_code: int = 4, epochs: int = 15, seed: int = 0):
        self.filters, self.width, self.num_code, self.epochs, self.seed = filters, width, num_code, epochs, seed

    def fit(self, windows: np.ndarray) -> "ConvolutionalAutoencoder":
        """Trains the autoencoder to reconstruct nominal windows of shape `(windows, samples)`."""
        from enhsim_tf.common.training import fit_windows

        windows = flat(windows)
        self._mean, self._scale = np.mean(windows), np.std(windows)
        self._network = self._build(windows.shape[1])
        scaled = self._scaled(windows)
        fit_windows(self._network, scaled, scaled, self.epochs, batch_size=32, seed=self.seed, learning_rate=0.003)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squared reconstruction error of each window, in units of the variance of the training windows."""
        from enhsim_tf.common.training import predict_windows

        scaled = self._scaled(flat(windows))
        return np.mean((predict_windows(self._network, scaled, 1_024) - scaled) ** 2, axis=1)

    def _build(self, samples: int) -> "keras.Sequential":  # noqa: F821 - Keras is not imported for a type hint
        from enhsim_tf.common.backend import keras
        from enhsim_tf.common.training import seeded_initialiser

        missing = -samples % self.stride**2  # number of zeros that are appended to a window and removed from the output
        layers, kernels = keras.layers, [seeded_initialiser("he_uniform", self.seed * 1000 + number) for number in range(4)]
        options = {"strides": self.stride, "padding": "same"}
        return keras.Sequential(
            [
                keras.Input((samples,)),
                layers.Reshape((samples, 1)),
                layers.ZeroPadding1D((0, missing)),
                layers.Conv1D(self.filters, self.width, activation="relu", kernel_initializer=kernels[0], **options),
                layers.Conv1D(self.num_code, self.width, kernel_initializer=kernels[1], **options),
                layers.Conv1DTranspose(self.filters, self.width, activation="relu", kernel_initializer=kernels[2], **options),
                layers.Conv1DTranspose(1, self.width, kernel_initializer=kernels[3], **options),
                layers.Cropping1D((0, missing)),
                layers.Reshape((samples,)),
            ],
            name="convolutional_autoencoder",
        )

    def _scaled(self, windows: np.ndarray) -> np.ndarray:
        return ((windows - self._mean) / self._scale).astype(np.float32)
