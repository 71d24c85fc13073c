"""Detects coarse windows outside the enhancer's training range, for which enhanced windows are
extrapolations.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse.alignment import START_RANGE
from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.common.measures import spread_of
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.scoring.metrics import finite_threshold
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import average_windows, cut, run_starts

_RATE = 0.01  # share of nominal windows that count as outside the range
_NUM_NOMINAL = 900  # coarse windows for fitting the range, and as many others for its limit
# lower bound of the limit, for periodic coarse windows whose scores are all close to 0
_LEAST_LIMIT = 1e-3


class TrustedRange:
    """The range of a simulator's nominal coarse windows, the only ones on which its enhancer was
    trained.

    It cannot detect an error of the coarse simulator itself.

    Args:
        simulator: A simulator fitted to nominal telemetry.

    Example:
    >>> trusted = TrustedRange(simulator)
    >>> trusted.share_outside(Degraded("stuck", severity=0.5))
    """

    def __init__(self, simulator: EnhancedSimulator):
        self.simulator = simulator
        learnt = self._drawn([None], _NUM_NOMINAL, seed=0)
        held_out = self._drawn([None], _NUM_NOMINAL, seed=1)
        self._centre = learnt.mean(axis=(0, 1), dtype=np.float64)
        self._scale = spread_of(learnt)
        self._range = OutOfRange().fit(self._rows(learnt))
        limit, _ = finite_threshold(self._range.score(self._rows(held_out)), _RATE)
        self._limit = max(limit, _LEAST_LIMIT)

    def _rows(self, windows: np.ndarray) -> np.ndarray:
        return ((windows - self._centre) / self._scale).reshape(len(windows), -1).astype(np.float32)

    def score(self, coarse: np.ndarray) -> np.ndarray:
        """Scores coarse windows of shape `(windows, samples, columns)`, float64 of shape
        `(windows,)`; 1 % of nominal windows are above 1.
        """
        return self._range.score(self._rows(coarse)) / self._limit

    def score_run(self, coarse: np.ndarray) -> np.ndarray:
        """Scores a run of shape `(samples, columns)`: the mean score of the windows that contain
        each sample, float32 of shape `(samples,)`.
        """
        window = self.simulator.window
        starts = run_starts(len(coarse), window)
        scores = self.score(cut([np.asarray(coarse, np.float32)], starts, window))
        return average_windows(
            lambda rows: np.repeat(scores[rows, None, None], window, axis=1),
            starts,
            window,
            len(coarse),
        )[:, 0]

    def score_parts(self, run: Telemetry) -> np.ndarray:
        """Scores all parts of a run, one after another, see `score_run`."""
        return np.concatenate([self.score_run(part.values) for part in run.parts])

    def share_outside(self, *scenarios: Degraded | None) -> float:
        """Returns the share of 200 windows of the scenarios, used in turn, that are outside the
        training range; None is nominal.
        """
        return float(np.mean(self.score(self._drawn(scenarios, 200, seed=2)) > 1))

    def _drawn(
        self, scenarios: Sequence[Degraded | None], num_windows: int, seed: int
    ) -> np.ndarray:
        rng = np.random.default_rng([seed, 3])
        in_turn = list(itertools.islice(itertools.cycle(scenarios), num_windows))
        return self.simulator.alignment.draw(
            rng.integers(0, START_RANGE, num_windows), in_turn, rng
        ).coarse
