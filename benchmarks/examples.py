"""Example data for all compared implementations, and the timing of an epoch. This module imports neither TensorFlow nor enhsim_tf.

Each implementation must run as its users would run it. If enhsim_tf were imported in the same process, TensorFlow would
start with the settings of enhsim_tf.
"""

import resource
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import keras  # noqa: TID251  the package's own module would start TensorFlow

Work = tuple[Callable[[], object], int]
"""A function that is called repeatedly, and the number of units of work in each call."""


def example_windows(num_windows: int, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns coarse windows and noisy target windows like those of the paper, float32 of shape `(num_windows, window)`."""
    rng = np.random.default_rng(0)
    phase = 2 * np.pi * (rng.integers(0, 480, num_windows)[:, None] + np.arange(window)) / 480
    coarse = 0.5 * np.sign(np.sin(phase)) + 0.25 * np.sign(np.sin(4 * phase))
    truth = 0.5 * np.sin(phase) + 0.25 * np.sin(4 * phase)
    return coarse.astype(np.float32), (truth + rng.normal(0, 0.1, truth.shape)).astype(np.float32)


def seconds_of_epoch(model: "keras.Model", *data: object, **settings: object) -> tuple[float, int]:
    """Returns the seconds and the page faults of one epoch of `fit`, without the work of `fit` before and after the epochs."""
    clock, of_last = epoch_clock()
    model.fit(*data, epochs=1, verbose=0, callbacks=[clock], **settings)
    return of_last()


def epoch_clock() -> tuple["keras.callbacks.Callback", Callable[[], tuple[float, int]]]:
    """Returns a callback that records epochs, and a function that returns the seconds and the page faults of the last epoch."""
    from keras.callbacks import LambdaCallback  # noqa: TID251

    notes = []

    def note(epoch: int, logs: dict) -> None:
        notes.append((time.perf_counter(), minor_faults()))

    def of_last() -> tuple[float, int]:
        (began, before), (ended, after) = notes[-2:]
        return ended - began, after - before

    return LambdaCallback(on_epoch_begin=note, on_epoch_end=note), of_last


def minor_faults() -> int:
    """Returns the number of minor page faults of this process so far. At each of them, the system clears a page of memory."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
