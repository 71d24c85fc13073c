"""Maps from coarse windows to telemetry windows: the package's, and two that a sceptic asks for."""

from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.enhancer.candidates import Training

Map = Callable[[np.ndarray], np.ndarray]
_COMPONENTS, _FEATURES = 200, 3_000
_PENALTIES = np.geomspace(1e-1, 1e5, 7)
_FILTERS, _WIDTH, _EPOCHS = 32, 9, 15


def fit_map(
    name: str,
    coarse: np.ndarray,
    telemetry: np.ndarray,
    starts: np.ndarray,
    folds: np.ndarray,
    seed: int,
) -> Map:
    """Fits an enhancer.

    Args:
        name: `ridge` or another candidate of the package, `random features` or `convolution`.
        coarse: Coarse windows, shape `(windows, samples, columns)`.
        telemetry: Telemetry windows, shape `(windows, samples, channels)`.
        starts: First sample of each window.
        folds: Fold of each window, by which penalties are chosen.
        seed: Seed of random features and networks.

    Returns:
        A function from coarse windows to enhanced windows.
    """
    if name == "random features":
        return _random_features(coarse, telemetry, folds, seed)
    if name == "convolution":
        return _convolution(coarse, telemetry, starts, seed)
    return Training(coarse, telemetry, starts).fit(name, seed).predict


def _random_features(
    coarse: np.ndarray, telemetry: np.ndarray, folds: np.ndarray, seed: int
) -> Map:
    """Ridge regression on rectified random combinations of principal components, beside the components themselves."""
    from sklearn.decomposition import PCA
    from sklearn.linear_model import Ridge
    from sklearn.preprocessing import StandardScaler

    rng, targets = np.random.default_rng([seed, 7]), telemetry.reshape(len(telemetry), -1)
    number = min(_COMPONENTS, len(coarse) - 1, coarse[0].size)
    with threadpool_limits(1):
        standard = StandardScaler().fit(coarse.reshape(len(coarse), -1))
        components = PCA(number, svd_solver="randomized", random_state=seed).fit(
            standard.transform(coarse.reshape(len(coarse), -1))
        )
    deviation = np.sqrt(components.explained_variance_[0])
    kernel, shift = (
        rng.standard_normal((number, _FEATURES)) / np.sqrt(number),
        rng.uniform(-1, 1, _FEATURES),
    )

    def features(windows: np.ndarray) -> np.ndarray:
        found = (
            components.transform(standard.transform(windows.reshape(len(windows), -1))) / deviation
        )
        return np.concatenate(
            [np.maximum(found * np.sqrt(number) @ kernel + shift, 0), found * np.sqrt(number)],
            axis=1,
        ).astype(np.float32)

    with threadpool_limits(1):
        rows, errors = features(coarse), np.zeros(len(_PENALTIES))
        held_out = folds == folds.max()
        for place, penalty in enumerate(_PENALTIES):
            machine = Ridge(penalty).fit(rows[~held_out], targets[~held_out])
            errors[place] = np.mean((machine.predict(rows[held_out]) - targets[held_out]) ** 2)
        machine = Ridge(_PENALTIES[np.argmin(errors)]).fit(rows, targets)
    return lambda windows: (
        machine.predict(features(windows))
        .reshape(len(windows), *telemetry.shape[1:])
        .astype(np.float32)
    )


def _convolution(coarse: np.ndarray, telemetry: np.ndarray, starts: np.ndarray, seed: int) -> Map:
    """A small convolutional network on what ridge regression leaves."""
    from enhsim_tf.common.backend import keras
    from studies.common.training import seeded_initialiser

    ridge = Training(coarse, telemetry, starts).fit("ridge", seed)
    left = telemetry - ridge.predict(coarse)
    mean, deviation, unit = (
        coarse.mean(axis=(0, 1)),
        coarse.std(axis=(0, 1)) + 1e-6,
        float(left.std()) or 1.0,
    )
    keras.utils.set_random_seed(seed)
    layers: list[Any] = [keras.Input(coarse.shape[1:])]
    for number in range(2):
        layers.append(
            keras.layers.Conv1D(
                _FILTERS,
                _WIDTH,
                padding="same",
                activation="relu",
                kernel_initializer=seeded_initialiser("he_uniform", seed + number),
            )
        )
    layers.append(
        keras.layers.Conv1D(telemetry.shape[2], _WIDTH, padding="same", kernel_initializer="zeros")
    )
    network = keras.Sequential(layers)
    network.compile(keras.optimizers.Adam(1e-3), "mse")
    network.fit((coarse - mean) / deviation, left / unit, batch_size=32, epochs=_EPOCHS, verbose=0)
    return lambda windows: (
        ridge.predict(windows) + unit * network.predict_on_batch((windows - mean) / deviation)
    )
