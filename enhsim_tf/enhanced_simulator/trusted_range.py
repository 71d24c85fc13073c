"""Where the windows of an enhanced simulator can be trusted: what its enhancer was taught, and what it makes up."""

from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.detection import metrics as detection
from enhsim_tf.enhancer.out_of_range import OutOfRange

if TYPE_CHECKING:
    from enhsim_tf.coarse_simulator.degraded import Degraded
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_NUM_NOMINAL = 1_500  # coarse windows of each: those that the range is learnt from, and those that set its limit
_LEAST_LIMIT = 1e-3  # of coarse windows that repeat exactly; below it nothing is to be seen
_START_RANGE = 1_000_000  # samples; windows begin at a random one of these, so at every phase of the waves


class TrustedRange:
    """The range of a simulator's nominal coarse windows, which are all that its enhancer learnt from.

    Args:
        simulator: The simulator, fitted to nominal telemetry.
        rate: Share of nominal windows that count as out of range.

    Example:
    >>> trusted = TrustedRange(simulator)
    >>> trusted.share_outside(Degraded("stuck", severity=0.5))
    """

    def __init__(self, simulator: "EnhancedSimulator", rate: float = 0.01):
        self.simulator = simulator
        learnt, held_out = (self._coarse(None, _NUM_NOMINAL, seed) for seed in range(2))
        self._range = OutOfRange().fit(learnt)
        self._limit = max(detection.threshold(self._range.score(held_out), rate), _LEAST_LIMIT)

    def score(self, coarse: np.ndarray) -> np.ndarray:
        """How far coarse windows are out of range: above 1 lie no more nominal ones than were asked for.

        Over degraded modes it rises with the error of the enhanced window: docs/REPORT.md has the rank correlation. What it
        cannot know is whether the coarse simulator itself is right.

        Args:
            coarse: Coarse windows of shape `(windows, samples)`, at the coarse simulator's own level.

        Returns:
            A score for each, float64 of shape `(windows,)`.

        Raises:
            InputError: If they have another length or are not finite.
        """
        return self._range.score(coarse) / self._limit

    def share_outside(self, scenario: "Degraded | None", num_windows: int = 200, seed: int = 0) -> float:
        """Share of a scenario's windows that are out of range.

        Args:
            scenario: A degraded mode, or None for nominal windows.
            num_windows: How many are drawn.
            seed: Seed of the draws.
        """
        return float(np.mean(self.score(self._coarse(scenario, num_windows, 2 + seed)) > 1))

    def _coarse(self, scenario: "Degraded | None", num_windows: int, seed: int) -> np.ndarray:
        rng, simulator = np.random.default_rng([seed, 3]), self.simulator
        begins = rng.integers(0, _START_RANGE, num_windows)
        return simulator.coarse.simulate(simulator.interval_s * (begins[:, None] + np.arange(simulator.window)), scenario, rng)
