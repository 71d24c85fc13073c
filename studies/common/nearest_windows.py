"""The mean of the nearest training windows: an enhancer without a fit, which the studies compare with."""

from collections.abc import Callable

import numpy as np
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KNeighborsRegressor

from enhsim_tf.telemetry.windows import time_blocks

NUM_NEIGHBOURS = (1, 3, 10, 30, 100, 300)


def fit_nearest_windows(inputs: np.ndarray, targets: np.ndarray, starts: np.ndarray | None = None) -> Callable[[np.ndarray], np.ndarray]:
    """Chooses the number of neighbours by cross-validation over blocks of time.

    The distance is the Euclidean one, with each column divided by its standard deviation in training.

    Args:
        inputs: Training windows of shape `(windows, samples)` or `(windows, samples, columns)`.
        targets: Their targets, shape `(windows, outputs)`.
        starts: Position of each window in time, in samples; None if they are in the order of time and share no sample.

    Returns:
        A function from windows to the mean targets of their nearest training windows, float32 of shape `(windows, outputs)`.
    """
    starts = np.arange(len(inputs)) * inputs.shape[1] if starts is None else starts
    deviation = np.std(inputs - inputs.mean(axis=0), axis=(0, 1))
    scale = np.where(deviation > 0, deviation, 1)

    def flat(windows: np.ndarray) -> np.ndarray:
        return (windows / scale).reshape(len(windows), -1)

    blocks = time_blocks(starts, 5, inputs.shape[1])
    numbers = [number for number in NUM_NEIGHBOURS if number <= min(len(learnt) for learnt, _ in blocks)]
    machine = KNeighborsRegressor(algorithm="brute")
    search = GridSearchCV(machine, {"n_neighbors": numbers}, cv=blocks, scoring="neg_mean_squared_error").fit(flat(inputs), targets)
    return lambda windows: search.predict(flat(windows)).astype(np.float32)
