"""What every way of doing a work is given, and how an epoch is timed. It imports neither TensorFlow nor the package.

A comparison must run as its user would run it: were the package imported beside it, TensorFlow would start with the
package's settings.
"""

import resource
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import keras  # noqa: TID251  the package's own module would start TensorFlow

Work = tuple[Callable[[], object], int]
"""What is repeated, and its units of work."""


def example_windows(num_windows: int, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Coarse and noisy target windows like the paper's: float32 arrays of shape `(num_windows, window)`."""
    rng = np.random.default_rng(0)
    phase = 2 * np.pi * (rng.integers(0, 480, num_windows)[:, None] + np.arange(window)) / 480
    coarse = 0.5 * np.sign(np.sin(phase)) + 0.25 * np.sign(np.sin(4 * phase))
    truth = 0.5 * np.sin(phase) + 0.25 * np.sin(4 * phase)
    return coarse.astype(np.float32), (truth + rng.normal(0, 0.1, truth.shape)).astype(np.float32)


def seconds_of_epoch(model: "keras.Model", *data: object, **settings: object) -> tuple[float, int]:
    """Seconds and page faults of one epoch of `fit`, from its begin to its end: what `fit` does before and after is paid once a training."""
    clock, of_last = epoch_clock()
    model.fit(*data, epochs=1, verbose=0, callbacks=[clock], **settings)
    return of_last()


def epoch_clock() -> tuple["keras.callbacks.Callback", Callable[[], tuple[float, int]]]:
    """A callback that notes when epochs begin and end, and what tells the seconds and the page faults of the last one."""
    from keras.callbacks import LambdaCallback  # noqa: TID251

    notes = []

    def note(epoch: int, logs: dict) -> None:
        notes.append((time.perf_counter(), minor_faults()))

    def of_last() -> tuple[float, int]:
        (began, before), (ended, after) = notes[-2:]
        return ended - began, after - before

    return LambdaCallback(on_epoch_begin=note, on_epoch_end=note), of_last


def minor_faults() -> int:
    """Pages that the system has given this process so far, each of which it had to clear."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
