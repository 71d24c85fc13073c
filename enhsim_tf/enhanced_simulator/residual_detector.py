"""A detector that uses the fitted simulator itself: what telemetry does that the aligned simulator does not.

The simulator is aligned with each window in time, offset and gain, as in its training, and the root-mean-square size of the rest is the
score. Three bounds limit what the alignment and the threshold may absorb:

- the gain may leave the range of the training by at most a factor of 2, so a channel that stands still does not become a gain of 0;
- the level may leave the range of nominal windows by at most its width; what lies beyond counts as residual;
- the scale of nominal residuals may grow by at most `bound` times (`detection.residual_size`).
"""

from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.residual_size import BOUND, ResidualSize, root_mean_square
from enhsim_tf.enhancer.training_pairs import apply_shift_and_gain
from enhsim_tf.telemetry.series import Telemetry

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_GAIN_BOUND = 2.0  # largest factor by which the gain of a window may leave the range of the training
_LEVEL_BOUND = 1.0  # widths of the nominal range by which a level may leave that range
_CHUNK = 1_024  # windows that are aligned at a time


class AlignedResidual:
    """Scores windows by their difference from the simulator, aligned with each of them.

    It has the interface of `detection.interface.Detector`. `fit` takes nominal windows, which may be generated.

    Args:
        simulator: The fitted simulator of square waves or of a constant level.
        bound: Largest factor by which the scale of residuals may grow, at least 1. With 1, the scale is not followed.

    Raises:
        InputError: If the bound is out of range, or if the simulator is a run model, which is not aligned.
    """

    def __init__(self, simulator: "EnhancedSimulator", bound: float = BOUND):
        if not hasattr(simulator, "pairs"):
            raise InputError(
                "Expected a simulator that can be aligned with telemetry. Received: a model of recorded runs. "
                "Give the coarse run of the same time with --coarse."
            )
        self.simulator, self.size = simulator, ResidualSize(bound)
        self._range = (-np.inf, np.inf)

    def fit(self, windows: np.ndarray) -> "AlignedResidual":
        """Measures the typical size of residuals and the range of levels.

        Args:
            windows: Nominal windows, shape `(windows, samples)`, in any order.
        """
        means = np.mean(windows, axis=1, dtype=np.float64)
        low, high = float(means.min()), float(means.max())
        width = _LEVEL_BOUND * max(high - low, self.simulator.noise_sd)
        self._range = (low - width, high + width)
        self.size.fit_sizes(self.sizes(windows))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Scores windows that are evenly spaced in time, in the order of time; higher is more anomalous.

        Args:
            windows: Telemetry, shape `(windows, samples)`, an eighth of a window apart.

        Returns:
            float64 array of shape `(windows,)`, in the unit of the telemetry.
        """
        return self.size.score_sizes(self.sizes(windows))

    def sizes(self, windows: np.ndarray) -> np.ndarray:
        """Returns the root-mean-square residual of each window, without the factor that follows drift."""
        found = [np.zeros(0)]
        for first in range(0, len(windows), _CHUNK):
            some = windows[first : first + _CHUNK]
            beyond = np.mean(some, axis=1, dtype=np.float64)
            beyond = beyond - np.clip(beyond, *self._range)
            found.append(np.hypot(root_mean_square(self.residuals(some)), beyond))
        return np.concatenate(found)

    def residuals(self, windows: np.ndarray) -> np.ndarray:
        """Returns windows minus the simulator that is aligned with them, float32 of the same shape.

        Args:
            windows: Telemetry, shape `(windows, samples)`.
        """
        simulator, number = self.simulator, len(windows)
        joined = Telemetry(np.ascontiguousarray(windows, np.float32).ravel(), simulator.interval_s)
        pairs = simulator.pairs(joined, simulator.window * np.arange(number))
        if simulator.levels is None:
            return pairs.target - simulator.follow(pairs)
        enhanced = simulator.enhance(pairs.coarse)
        least, most = simulator.levels[:, 1].min() / _GAIN_BOUND, simulator.levels[:, 1].max() * _GAIN_BOUND
        gain = np.clip(pairs.gain, least, most)
        shift = np.mean(pairs.target - gain[:, None] * enhanced, axis=1, dtype=np.float64)
        return pairs.target - apply_shift_and_gain(enhanced, shift, gain)
