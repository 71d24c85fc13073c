"""What every way of doing a work is given, and how an epoch is timed. It imports neither TensorFlow nor the package.

A comparison must run as its user would run it: were the package imported beside it, TensorFlow would start with the
package's settings.
"""

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


def seconds_of_epoch(model: "keras.Model", *data: object, **settings: object) -> float:
    """Seconds of one epoch of `fit`, from its begin to its end: what `fit` does before and after is paid once a training."""
    from keras.callbacks import LambdaCallback  # noqa: TID251

    times = []
    clock = LambdaCallback(
        on_epoch_begin=lambda epoch, logs: times.append(time.perf_counter()),
        on_epoch_end=lambda epoch, logs: times.append(time.perf_counter()),
    )
    model.fit(*data, epochs=1, verbose=0, callbacks=[clock], **settings)
    return times[1] - times[0]
