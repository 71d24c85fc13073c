"""Detector of residuals: the size of what a simulator does not explain, with a scale that may follow slow drift within a bound.

The input are windows of a residual: telemetry minus what a fitted simulator says that it should be. Their root-mean-square size needs no
training, so nothing of a fault can be learnt. The size of nominal residuals may change slowly as a channel ages; the score is therefore
divided by a factor that follows the sizes of past windows. The factor is at least 1 and at most `bound`, so that a residual that is more
than `bound` times the threshold is an alarm for as long as it lasts.
"""

import numpy as np

from enhsim_tf.common.errors import InputError

BOUND = 1.5  # largest factor by which the scale of nominal residuals may grow
MEMORY = 64  # past windows whose median size is followed: eight windows that share no sample, at eight windows a length
OVERLAP = 8  # the last windows, which share samples with the present one, do not count
_LEAST_MEMORY = 16  # with fewer past windows, the scale is that of the nominal residuals


class ResidualSize:
    """Root-mean-square size of residual windows, divided by a scale that follows drift.

    Args:
        bound: Largest factor by which the scale may grow, at least 1. 1 does not follow.
        overlap: Number of windows before each one that share samples with it.
        memory: Number of windows before those whose median size is followed.

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(self, bound: float = BOUND, overlap: int = OVERLAP, memory: int = MEMORY):
        if not 1 <= bound < np.inf or overlap < 0 or memory < 1:
            raise InputError(f"Expected bound >= 1, overlap >= 0 and memory >= 1. Received: {bound}, {overlap} and {memory}.")
        self.bound, self.overlap, self.memory = float(bound), int(overlap), int(memory)
        self.typical = np.nan

    def fit(self, windows: np.ndarray) -> "ResidualSize":
        """Measures the typical size of nominal residuals.

        Args:
            windows: Nominal residuals, shape `(windows, samples)`.
        """
        return self.fit_sizes(root_mean_square(windows))

    def fit_sizes(self, sizes: np.ndarray) -> "ResidualSize":
        """Like `fit`, from the sizes of the residuals, shape `(windows,)`."""
        self.typical = float(np.median(sizes))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Scores windows in the order of time.

        Args:
            windows: Residuals of shape `(windows, samples)`, evenly spaced in time.

        Returns:
            The size of each window in the unit of the telemetry, divided by the factor that is followed, shape `(windows,)`.
        """
        return self.score_sizes(root_mean_square(windows))

    def score_sizes(self, sizes: np.ndarray) -> np.ndarray:
        """Like `score`, from the sizes of the residuals, shape `(windows,)`."""
        return sizes / self.factors(sizes)

    def factors(self, sizes: np.ndarray) -> np.ndarray:
        """Returns the factor of each window: the median of past sizes in units of the typical one, from 1 to `bound`."""
        import pandas as pd

        found, first = np.ones(len(sizes)), self.overlap + _LEAST_MEMORY
        if self.bound == 1 or not self.typical > 0 or len(sizes) <= first:
            return found
        past = pd.Series(sizes[: -self.overlap - 1]).rolling(self.memory, min_periods=1).median()
        found[first:] = past[_LEAST_MEMORY - 1 :] / self.typical
        return np.clip(found, 1.0, self.bound)


def root_mean_square(windows: np.ndarray) -> np.ndarray:
    """Returns the root-mean-square of each window, float64 of shape `(windows,)`."""
    return np.sqrt(np.mean(np.asarray(windows, np.float64) ** 2, axis=1))
