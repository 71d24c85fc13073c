"""The three detectors with which claims C3 and C8 are measured: small, standard, and different in
kind.
"""

from collections.abc import Callable

import numpy as np
from sklearn.decomposition import PCA
from sklearn.ensemble import IsolationForest
from threadpoolctl import threadpool_limits

from enhsim_tf.common.backend import keras
from enhsim_tf.common.two_sample import window_features
from enhsim_tf.paper.enhancer import Pairs
from enhsim_tf.paper.settings import Settings

Score = Callable[[np.ndarray], np.ndarray]
"""From windows of shape `(windows, samples)` to one number for each; a higher number is more
anomalous.
"""


def pca_residual(training: np.ndarray, settings: Settings) -> Score:
    """The mean squared residual outside the principal components of the training windows."""
    with threadpool_limits(1):
        pca = PCA(
            min(settings.num_components, *training.shape),
            svd_solver="randomized",
            random_state=settings.seed,
        ).fit(training)
    return lambda windows: np.mean(
        (windows - pca.inverse_transform(pca.transform(windows))) ** 2, axis=1
    )


def isolation_forest(training: np.ndarray, settings: Settings) -> Score:
    """The anomaly score of an isolation forest (Liu, Ting and Zhou 2008) on fourteen features of
    each window.
    """
    forest = IsolationForest(n_estimators=settings.num_trees, random_state=settings.seed).fit(
        window_features(training)
    )
    return lambda windows: -forest.score_samples(window_features(windows))


def dense_autoencoder(training: np.ndarray, settings: Settings) -> Score:
    """The mean squared reconstruction error of a dense autoencoder with 128, 16 and 128 hidden
    units.
    """
    mean = np.mean(training)
    scale = np.std(training)
    standardised = ((training - mean) / scale).astype(np.float32)
    network = keras.Sequential([keras.Input(training.shape[1:])], name="autoencoder")
    for number, (units, activation) in enumerate(
        ((128, "relu"), (16, "relu"), (128, "relu"), (training.shape[1], "linear"))
    ):
        kernel = keras.initializers.HeUniform(seed=1_000 * settings.seed + number)
        network.add(keras.layers.Dense(units, activation, kernel_initializer=kernel))
    network.compile("adam", "mean_squared_error", jit_compile=False)
    pairs = Pairs(standardised, standardised, 32, np.random.default_rng(settings.seed))
    network.fit(pairs, epochs=settings.autoencoder_epochs, shuffle=False, verbose=0)

    def score(windows: np.ndarray) -> np.ndarray:
        scaled = ((windows - mean) / scale).astype(np.float32)
        return np.mean((network.predict_on_batch(scaled) - scaled) ** 2, axis=1)

    return score


DETECTORS = {
    "PCA residual": pca_residual,
    "isolation forest": isolation_forest,
    "dense autoencoder": dense_autoencoder,
}


def threshold(scores: np.ndarray, rate: float) -> float:
    """The split conformal threshold for a rate of false alarms: the score of rank `ceil((n + 1) (1
    - rate))` among `n` held-out ones, or the highest one.
    """
    rank = int(np.ceil((len(scores) + 1) * (1 - rate) - 1e-9))
    return float(np.sort(scores)[min(rank, len(scores)) - 1])
