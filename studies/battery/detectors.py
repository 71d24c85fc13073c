"""The enhanced simulator as a source of training data for detectors and as a reference, judged on the fine simulator with noise."""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enhsim_tf.detection import metrics
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.enhancer.candidates import block_edges, fit_enhancer, split_fold
from studies.battery.errors import about
from studies.battery.faults import ALL, Fault
from studies.battery.orbits import ORBIT_SAMPLES
from studies.battery.record import Recorded
from studies.battery.windows import WINDOW, PairWindows, coarse_windows, judged_windows, pair_windows

COARSE, ENHANCED, WITH_RESIDUALS = "coarse", "enhanced", "enhanced + residual windows"
REAL_15, REAL_60, REAL_120 = "real, 15 orbits", "real, 60 orbits", "real, 120 orbits"
SOURCES = (COARSE, ENHANCED, WITH_RESIDUALS, REAL_15, REAL_60, REAL_120)
"""Training data of detectors. The simulator was fitted to the 60 orbits of `real, 60 orbits`; it generates as many orbits as
`real, 120 orbits` has. Half of the orbits are for training and half for the threshold; of the real ones that the simulator was
fitted to, two thirds and one third."""
ENHANCED_RUN, COARSE_RUN = "reference: enhanced run", "reference: coarse run"
"""The simulator as a reference: the difference between the telemetry and the run of the planned orbits, enhanced or not."""
NETWORKS = ("dense autoencoder", "convolutional autoencoder")
"""Detectors that take long to train. They learn `OF_NETWORKS` only."""
OF_NETWORKS = (WITH_RESIDUALS, REAL_60, REAL_120)
RATE = 0.01
"""False-alarm rate for which every threshold is set."""
NUM = 1_000  # windows for training, and as many for the threshold
_PART_ORBITS = 15  # of the smallest real training data
_NUM_FOLDS = 3

Rows = list[dict[str, Any]]


class Judge:
    """Trains detectors for a replicate and judges them.

    Args:
        recorded: The runs.
        pairs: The windows that the simulator is fitted to.
        candidate: The enhancer, one of `enhancer.names.CANDIDATES`.
        seed: Seed of everything drawn.
    """

    def __init__(self, recorded: Recorded, pairs: PairWindows, candidate: str, seed: int):
        self.recorded, self.pairs, self.candidate, self.seed = recorded, pairs, candidate, seed
        self.enhance = self._fit(slice(None))
        self.num_fit, self.num_coarse = (len(recorded.get(part, "coarse")) // ORBIT_SAMPLES - 1 for part in ("fit", "coarse"))
        self.num_stretches = max(1, len(recorded.get("test", "coarse")) // len(recorded.get("fault", "coarse")))

    def _fit(self, rows: Any) -> Callable[[np.ndarray], np.ndarray]:
        pairs = self.pairs
        enhancer = fit_enhancer(self.candidate, pairs.coarse[rows], pairs.telemetry[rows], pairs.starts[rows], self.seed)
        return lambda coarse: enhancer.predict(coarse)[:, :, 0]

    @functools.cached_property
    def residuals(self) -> np.ndarray:
        """Telemetry minus enhanced windows, each window enhanced by a fit that has not learnt from its time, shape `(windows, WINDOW)`.

        Windows that lie across the edge of a block of time are left out.
        """
        starts, found = self.pairs.starts, []
        edges = block_edges(int(starts.min()), int(starts.max()) + WINDOW, WINDOW)
        for fold in range(_NUM_FOLDS):
            learnt, rest = split_fold(starts, WINDOW, edges, fold)
            found.append(self.pairs.telemetry[rest] - self._fit(learnt)(self.pairs.coarse[rest]))
        return np.concatenate(found)

    @functools.cached_property
    def test(self) -> dict[Fault | None, PairWindows]:
        """Windows of the fine simulator on which detectors are judged: nominal (None) and under each fault."""
        return {fault: judged_windows(self.recorded, fault, self.seed) for fault in (None, *ALL)}

    def differences(self, is_enhanced: bool = True) -> dict[Fault | None, np.ndarray]:
        """Telemetry of the windows of `test` minus the run of the planned orbits, enhanced or not, shape `(windows, WINDOW)`."""
        found = {}
        for fault in self.test:
            pairs = judged_windows(self.recorded, fault, self.seed, is_planned=True)
            found[fault] = pairs.telemetry - (self.enhance(pairs.coarse) if is_enhanced else pairs.coarse[:, :, 0])
        return found

    def noise(self, number: int, stream: int) -> np.ndarray:
        """Draws whole residual windows again, shape `(number, WINDOW)`."""
        return self.residuals[np.random.default_rng([self.seed, stream]).integers(0, len(self.residuals), number)]

    def sources(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Training windows and threshold windows of each of `SOURCES`."""
        coarse = coarse_windows(self.recorded, "coarse", 2 * NUM)
        enhanced = self.enhance(coarse)
        generated = {COARSE: coarse[:, :, 0], ENHANCED: enhanced, WITH_RESIDUALS: enhanced + self.noise(len(enhanced), 1)}
        fit, more = (pair_windows(self.recorded, part, NUM, self.seed).telemetry for part in ("fit", "more"))
        dense = pair_windows(self.recorded, "fit", 2 * NUM, self.seed)
        is_early = dense.starts + WINDOW <= (_PART_ORBITS + 1) * ORBIT_SAMPLES
        return {name: apart(windows, 1 / 2, self.num_coarse) for name, windows in generated.items()} | {
            REAL_15: apart(dense.telemetry[is_early], 2 / 3, _PART_ORBITS),
            REAL_60: apart(dense.telemetry, 2 / 3, self.num_fit),
            REAL_120: (fit, more),
        }

    def source_rows(self, with_networks: bool) -> Rows:
        """Trains detectors on each of `SOURCES` and judges them; see `alarm_rows`."""
        rows = []
        for training, (learnt, held_out) in self.sources().items():
            for name, make in DETECTORS.items():
                if name in NETWORKS and not (with_networks and training in OF_NETWORKS):
                    continue
                score = make(self.seed).fit(learnt).score
                scores = {fault: score(pairs.telemetry) for fault, pairs in self.test.items()}
                rows += alarm_rows(training, name, score(held_out), scores, self.num_stretches)
        return rows

    def reference_rows(self) -> Rows:
        """Judges the root-mean-square residual of each window. Its threshold comes from the orbits that the simulator is fitted to."""
        fitted = {ENHANCED_RUN: self.residuals, COARSE_RUN: self.pairs.telemetry - self.pairs.coarse[:, :, 0]}
        rows = []
        for reference, nominal in fitted.items():
            scores = {fault: _rms(each) for fault, each in self.differences(reference == ENHANCED_RUN).items()}
            rows += alarm_rows(reference, "residual", _rms(nominal), scores, self.num_stretches)
        return rows


def alarm_rows(training: str, detector: str, held_out: np.ndarray, scores: Mapping[Fault | None, np.ndarray], num_stretches: int) -> Rows:
    """Judges a detector at the conformal threshold of `RATE` on held-out nominal windows.

    Args:
        training: What it learnt from.
        detector: Its name.
        held_out: Scores of nominal windows of its training data.
        scores: Scores of the fine simulator's nominal windows (None) and of its windows under each fault, in the order of time.
        num_stretches: Number of stretches of the nominal run that are each as long as the run of a fault.

    Returns:
        A row for nominal and for each fault: `alarms`, the share of windows with an alarm; `alarms_at_real_rate`, the same at
        the threshold of the first half of the nominal windows, for the rest and for faults; `is_found`, whether a window of
        the run has an alarm, and for nominal the share of stretches as long as the run of a fault.
    """
    limit = metrics.threshold(held_out, RATE)
    half = len(scores[None]) // 2
    real_limit = metrics.threshold(scores[None][:half], RATE)
    rows = []
    for fault, each in scores.items():
        rest = each[half:] if fault is None else each
        stretches = np.array_split(each > limit, num_stretches if fault is None else 1)
        rows.append(
            about(fault)
            | {
                "training": training,
                "detector": detector,
                "alarms": float(np.mean(each > limit)),
                "alarms_at_real_rate": float(np.mean(rest > real_limit)),
                "is_found": float(np.mean([stretch.any() for stretch in stretches])),
            }
        )
    return rows


def apart(windows: np.ndarray, share: float, orbits: int) -> tuple[np.ndarray, np.ndarray]:
    """Splits windows of so many orbits, in the order of time, and leaves out an orbit between both parts, so that none overlap."""
    cut = round(share * len(windows))
    return windows[:cut], windows[cut + -(-len(windows) // orbits) :]


def _rms(windows: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(windows, dtype=np.float64), axis=1))
