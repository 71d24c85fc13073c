"""The enhanced simulator as a source of training data for detectors and as a reference, judged on
the fine simulator with noise.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enhsim_tf.enhancer.candidates import Training, block_edges, split_fold
from enhsim_tf.scoring import metrics
from studies.battery.faults import ALL, Fault, columns_of
from studies.battery.orbits import ORBIT_SAMPLES
from studies.battery.record import (
    WINDOW,
    PairWindows,
    Runs,
    coarse_windows,
    judged_windows,
    pair_windows,
    run_key,
)
from studies.common.detectors import DETECTORS

COARSE = "coarse"
WITH_RESIDUALS = "enhanced + residual windows"
REAL_15 = "real, 15 orbits"
REAL_120 = "real, 120 orbits"
SOURCES = (COARSE, WITH_RESIDUALS, REAL_15, REAL_120)
"""Training data of detectors. The simulator was fitted to 60 orbits; it generates as many orbits as
`real, 120 orbits` has. Half of the orbits are for training and half for the threshold; of the 15
orbits, two thirds and one third."""
ENHANCED_RUN = "reference: enhanced run"
COARSE_RUN = "reference: coarse run"
"""The simulator as a reference: the difference between the telemetry and the run of the planned
orbits, enhanced or not.
"""
QUICK = ("limit check", "PCA residual", "nearest neighbours", "isolation forest", "one-class SVM")
"""Detectors, whose training takes about a second."""
RATE = 0.01
"""False-alarm rate for which every threshold is set."""
NUM = 1_000  # windows for training, and as many for the threshold
_PART_ORBITS = 15  # of the smallest real training data
_NUM_FOLDS = 3

Rows = list[dict[str, Any]]


class Judge:
    """Trains detectors for a replicate and judges them.

    Args:
        runs: The runs, see `record.Runs`.
        pairs: The windows that the simulator is fitted to.
        candidate: The enhancer, one of `enhancer.names.CANDIDATES`.
        seed: Seed of everything drawn.
    """

    def __init__(self, runs: Runs, pairs: PairWindows, candidate: str, seed: int):
        self.runs = runs
        self.pairs = pairs
        self.candidate = candidate
        self.seed = seed
        self.enhance = self._fit(slice(None))
        self.test = {fault: judged_windows(runs, fault, seed).telemetry for fault in (None, *ALL)}
        """Telemetry on which detectors are judged: nominal (None) and under each fault."""

    def _fit(self, rows: Any) -> Callable[[np.ndarray], np.ndarray]:
        pairs = self.pairs
        training = Training(
            pairs.coarse[rows], pairs.telemetry[rows][:, :, None], pairs.starts[rows]
        )
        enhancer = training.fit(self.candidate, self.seed)
        return lambda coarse: enhancer.predict(coarse)[:, :, 0]

    @functools.cached_property
    def residuals(self) -> np.ndarray:
        """Telemetry minus enhanced windows, each window enhanced by a fit that has not learnt from
        its time, shape `(windows, WINDOW)`.

        Windows that lie across the edge of a block of time are left out.
        """
        starts = self.pairs.starts
        found = []
        edges = block_edges(int(starts.min()), int(starts.max()) + WINDOW, WINDOW)
        for fold in range(_NUM_FOLDS):
            learnt, rest = split_fold(starts, WINDOW, edges, fold)
            found.append(self.pairs.telemetry[rest] - self._fit(learnt)(self.pairs.coarse[rest]))
        return np.concatenate(found)

    def sources(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Training windows and threshold windows of each of `SOURCES`."""
        run = self.runs[run_key("coarse", "coarse")]
        coarse = coarse_windows(run, 2 * NUM)
        num_orbits = len(run) // ORBIT_SAMPLES - 1
        # whole residual windows, drawn again
        noise = self.residuals[
            np.random.default_rng([self.seed, 1]).integers(0, len(self.residuals), len(coarse))
        ]
        dense = pair_windows(self.runs, "fit", 2 * NUM, self.seed)
        is_early = dense.starts + WINDOW <= (_PART_ORBITS + 1) * ORBIT_SAMPLES
        fit, more = (
            pair_windows(self.runs, part, NUM, self.seed).telemetry for part in ("fit", "more")
        )
        return {
            COARSE: _apart(coarse[:, :, 0], 1 / 2, num_orbits),
            WITH_RESIDUALS: _apart(self.enhance(coarse) + noise, 1 / 2, num_orbits),
            REAL_15: _apart(dense.telemetry[is_early], 2 / 3, _PART_ORBITS),
            REAL_120: (fit, more),
        }

    def source_rows(self) -> Rows:
        """Trains detectors on each of `SOURCES` and judges them; see `alarm_rows`."""
        rows = []
        for training, (learnt, held_out) in self.sources().items():
            for name in QUICK:
                score = DETECTORS[name](self.seed).fit(learnt).score
                rows += alarm_rows(
                    training,
                    name,
                    score(held_out),
                    {fault: score(each) for fault, each in self.test.items()},
                )
        return rows

    def reference_rows(self) -> Rows:
        """Judges the root-mean-square residual of each window. Its threshold comes from the orbits
        that the simulator is fitted to.
        """
        enhanced: dict[Fault | None, np.ndarray] = {}
        coarse: dict[Fault | None, np.ndarray] = {}
        for fault, telemetry in self.test.items():
            planned = judged_windows(self.runs, fault, self.seed, is_planned=True).coarse
            enhanced[fault] = _rms(telemetry - self.enhance(planned))
            coarse[fault] = _rms(telemetry - planned[:, :, 0])
        fitted_enhanced = _rms(self.residuals)
        fitted_coarse = _rms(self.pairs.telemetry - self.pairs.coarse[:, :, 0])
        return [
            *alarm_rows(ENHANCED_RUN, "residual", fitted_enhanced, enhanced),
            *alarm_rows(COARSE_RUN, "residual", fitted_coarse, coarse),
        ]


def alarm_rows(
    training: str, detector: str, held_out: np.ndarray, scores: Mapping[Fault | None, np.ndarray]
) -> Rows:
    """Judges a detector at the conformal threshold of `RATE` on scores of held-out nominal windows
    of its training data.

    Returns:
        A row for nominal (None) and for each fault: `alarms` is the share of the fine simulator's
        windows with an alarm.
    """
    limit = metrics.threshold(held_out, RATE)
    return [
        columns_of(fault)
        | {"training": training, "detector": detector, "alarms": float(np.mean(each > limit))}
        for fault, each in scores.items()
    ]


def _apart(windows: np.ndarray, share: float, orbits: int) -> tuple[np.ndarray, np.ndarray]:
    """Splits windows of so many orbits, in the order of time, and leaves out an orbit between both
    parts, so that none overlap.
    """
    first = round(share * len(windows))
    return windows[:first], windows[first + -(-len(windows) // orbits) :]


def _rms(windows: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(windows, dtype=np.float64), axis=1))
