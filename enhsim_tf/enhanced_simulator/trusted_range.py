"""Detects coarse windows outside the enhancer's training range, for which enhanced windows are extrapolations."""

from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.detection import metrics
from enhsim_tf.enhancer.out_of_range import OutOfRange

if TYPE_CHECKING:
    from enhsim_tf.coarse_simulator.degraded import Degraded
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_NUM_NOMINAL = 1_500  # coarse windows for fitting the range, and as many others for its limit
_LEAST_LIMIT = 1e-3  # lower bound of the limit, for periodic coarse windows whose scores are all close to 0
_START_RANGE = 1_000_000  # windows begin at a random sample below this one, so that every phase of the waves occurs


class TrustedRange:
    """The range of a simulator's nominal coarse windows, the only ones on which its enhancer was trained.

    Args:
        simulator: A simulator fitted to nominal telemetry.
        rate: Share of nominal windows that count as outside the range.

    Example:
    >>> trusted = TrustedRange(simulator)
    >>> trusted.share_outside(Degraded("stuck", severity=0.5))
    """

    def __init__(self, simulator: "EnhancedSimulator", rate: float = 0.01):
        self.simulator = simulator
        learnt, held_out = (self._coarse(None, _NUM_NOMINAL, seed) for seed in range(2))
        self._range = OutOfRange().fit(learnt)
        self._limit = max(metrics.threshold(self._range.score(held_out), rate), _LEAST_LIMIT)

    def score(self, coarse: np.ndarray) -> np.ndarray:
        """Scores how far coarse windows are outside the training range. A share `rate` of nominal windows scores above 1.

        Across degraded modes, the score is correlated with the error of the enhanced window; studies/robustness/README.md gives the rank
        correlation. The score does not measure whether the coarse simulator itself is accurate.

        Args:
            coarse: Coarse windows of shape `(windows, samples)`, at the coarse simulator's own level.

        Returns:
            One score per window, float64 of shape `(windows,)`.

        Raises:
            InputError: If the windows have the wrong length or are not finite.
        """
        return self._range.score(coarse) / self._limit

    def share_outside(self, scenario: "Degraded | None", num_windows: int = 200, seed: int = 0) -> float:
        """Returns the share of a scenario's windows that are outside the training range.

        Args:
            scenario: A degraded mode, or None for nominal windows.
            num_windows: Number of windows to simulate.
            seed: Random seed.
        """
        return float(np.mean(self.score(self._coarse(scenario, num_windows, 2 + seed)) > 1))

    def _coarse(self, scenario: "Degraded | None", num_windows: int, seed: int) -> np.ndarray:
        rng, simulator = np.random.default_rng([seed, 3]), self.simulator
        begins = rng.integers(0, _START_RANGE, num_windows)
        return simulator.coarse.simulate(simulator.interval_s * (begins[:, None] + np.arange(simulator.window)), scenario, rng)
