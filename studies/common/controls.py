"""Controls beside the detectors: trivial scores that every useful detector should outperform."""

from collections.abc import Callable

import numpy as np

from studies.common.detectors import Control, Detector, LargestStep, MovingDeviation


class RandomScore(Control):
    """Random scores, independent of the windows. Each call continues the random sequence.

    Args:
        seed: Seed for the scores.
    """

    def __init__(self, seed: int = 0):
        self._rng = np.random.default_rng(seed)

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns random numbers that are uniformly distributed between 0 and 1."""
        return self._rng.random(len(windows))


CONTROLS: dict[str, Callable[[int], Detector]] = {
    "random score": RandomScore,
    "largest step": lambda seed: LargestStep(),
    "moving deviation": lambda seed: MovingDeviation(),
}
"""Maps each control's name to a factory, which takes a seed."""
