"""What the compared implementations share: data, the GAN's networks, and the timing of an epoch. It
imports neither TensorFlow nor ours.

Each implementation must run as its users would run it. If enhsim_tf were imported in the same
process, TensorFlow would start with the settings of enhsim_tf.
"""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import keras  # noqa: TID251  the package's own module would start TensorFlow

Work = tuple[Callable[[], object], int]
"""A function that is called repeatedly, and the number of units of work in each call.

The function may return the seconds that it took, as a float, where not all of its time counts.
"""
WINDOW, HIDDEN_UNITS, FILTERS = 500, 3_200, 500  # of the paper's networks


def example_windows(num_windows: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns coarse windows and noisy target windows like those of the paper, float32 of shape
    `(num_windows, WINDOW)`.
    """
    rng = np.random.default_rng(0)
    phase = 2 * np.pi * (rng.integers(0, 480, num_windows)[:, None] + np.arange(WINDOW)) / 480
    coarse = 0.5 * np.sign(np.sin(phase)) + 0.25 * np.sign(np.sin(4 * phase))
    truth = 0.5 * np.sin(phase) + 0.25 * np.sin(4 * phase)
    return coarse.astype(np.float32), (truth + rng.normal(0, 0.1, truth.shape)).astype(np.float32)


def gan_networks(keras: Any, dropout: float = 0.0) -> tuple["keras.Model", "keras.Model"]:
    """Builds the paper's generator and discriminator with a Keras of any age."""
    layers, kernel = keras.layers, {"kernel_initializer": "he_uniform"}
    drop = (lambda: [layers.Dropout(dropout)]) if dropout else list
    generator = [
        keras.Input((16,)),
        layers.Dense(64, activation="relu", **kernel),
        layers.BatchNormalization(),
        layers.Dense(WINDOW, activation="tanh", **kernel),
        layers.Reshape((WINDOW, 1)),
    ]
    discriminator = [
        keras.Input((WINDOW, 1)),
        layers.Conv1D(FILTERS, 20, strides=4, activation="relu", **kernel),
        *drop(),
        layers.GlobalMaxPooling1D(),
        layers.Dense(25, activation="relu", **kernel),
        *drop(),
        layers.Dense(1, activation="sigmoid", **kernel),
    ]
    return keras.Sequential(generator), keras.Sequential(discriminator)


def epoch_clock() -> tuple["keras.callbacks.Callback", Callable[[], float]]:
    """Returns a callback that times epochs, without the work of `fit` around them, and a function
    that returns the last epoch's seconds.
    """
    from keras.callbacks import LambdaCallback  # noqa: TID251

    times = []

    def note(epoch: int, logs: dict) -> None:
        times.append(time.perf_counter())

    return LambdaCallback(on_epoch_begin=note, on_epoch_end=note), lambda: times[-1] - times[-2]


def copy(num_bytes: int) -> Work:
    """Prepares the limit of the machine for training: all cores copy `num_bytes` in total, without
    allocating memory.
    """
    num_cores = os.cpu_count() or 1
    source, target = (
        np.ones((num_cores, num_bytes // 8 // num_cores), np.float32) for _ in range(2)
    )
    pool = ThreadPoolExecutor(num_cores)
    return lambda: list(pool.map(np.copyto, target, source)), num_bytes
