"""Detector of residuals, telemetry minus what a fitted simulator says that it should be: their size, which may grow slowly within a bound.

The size of nominal residuals may change as a channel ages. The score is therefore divided by a factor that follows the sizes of past windows,
from 1 to `bound`, so that a residual that is more than `bound` times the threshold is an alarm for as long as it lasts.
"""

import numpy as np

from enhsim_tf.common.errors import InputError

_BOUND = 1.5  # largest factor by which the scale of nominal residuals may grow
_MEMORY = 64  # past windows whose median size is followed: eight windows that share no sample, at eight windows a length
_OVERLAP = 8  # the last windows, which share samples with the present one, do not count
_LEAST_MEMORY = 16  # with fewer past windows, the scale is that of the nominal residuals


class ResidualSize:
    """Root-mean-square size of residual windows, divided by a scale that follows drift.

    Args:
        bound: Largest factor by which the scale may grow, at least 1. 1 does not follow.

    Raises:
        InputError: If the bound is out of range.
    """

    def __init__(self, bound: float = _BOUND):
        if not 1 <= bound < np.inf:
            raise InputError(f"Expected bound >= 1. Received: {bound}.")
        self.bound, self.typical = float(bound), np.nan

    def fit_sizes(self, sizes: np.ndarray) -> "ResidualSize":
        """Learns the typical size from those of nominal residuals, shape `(windows,)`."""
        self.typical = float(np.median(sizes))
        return self

    def score_sizes(self, sizes: np.ndarray) -> np.ndarray:
        """Divides sizes of windows, evenly spaced in the order of time, by the median of past sizes in units of the typical one."""
        import pandas as pd

        factors, first = np.ones(len(sizes)), _OVERLAP + _LEAST_MEMORY
        if self.typical > 0 and len(sizes) > first:
            past = pd.Series(sizes[: -_OVERLAP - 1]).rolling(_MEMORY, min_periods=1).median()
            factors[first:] = past[_LEAST_MEMORY - 1 :] / self.typical
        return sizes / np.clip(factors, 1.0, self.bound)


def root_mean_square(windows: np.ndarray) -> np.ndarray:
    """Returns the root-mean-square of each window, float64 of shape `(windows,)`."""
    return np.sqrt(np.mean(np.asarray(windows, np.float64) ** 2, axis=1))
