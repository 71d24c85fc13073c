"""Detectors that are trained on simulated or real telemetry and judged on the fine simulator with noise."""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.detection import metrics
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.enhancer.held_out_blocks import block_edges, split_fold
from enhsim_tf.enhancer.ladder import fit_rung
from enhsim_tf.noise.surrogates import GaussianAutoregression
from studies.battery.errors import about, fault_windows
from studies.battery.faults import ALL, Fault
from studies.battery.orbits import ORBIT_SAMPLES
from studies.battery.record import Recorded
from studies.battery.windows import WINDOW, PairWindows, coarse_windows, pair_windows

COARSE, CLEAN, ENHANCED = "coarse", "fine without noise", "enhanced"
RESAMPLED, AUTOREGRESSION, CONVOLUTIONAL = "enhanced + residuals drawn again", "enhanced + AR", "enhanced + convolutional GAN"
REAL_15, REAL_60, REAL_120 = "real, 15 orbits", "real, 60 orbits", "real, 120 orbits"
ARMS = (COARSE, CLEAN, ENHANCED, RESAMPLED, AUTOREGRESSION, CONVOLUTIONAL, REAL_15, REAL_60, REAL_120)
"""What detectors learn from. The simulator was fitted to the 60 orbits of `real, 60 orbits`; it generates as many orbits as
`real, 120 orbits` has. Half of the orbits of an arm are for training and half for the threshold; of the real ones that the
simulator was fitted to, two thirds and one third."""
RESIDUALS = {"residual of the enhanced run": True, "residual of the coarse run": False}
"""The simulator as a detector: the difference between the telemetry and the run of the planned orbits, enhanced or not."""
NETWORKS = ("dense autoencoder", "convolutional autoencoder")
RATE = 0.01
"""False-alarm rate for which every threshold is set."""
NUM = 1_000  # windows for training, and as many for the threshold
_ORDER = 60  # largest order of the autoregression
_PART_ORBITS = 15  # of the smallest real arm
_NUM_FOLDS = 3

Arms = dict[str, tuple[np.ndarray, np.ndarray]]


def cross_fitted_residuals(pairs: PairWindows, rung: str, seed: int) -> np.ndarray:
    """Returns telemetry minus enhanced windows, each window enhanced by a rung that has not learnt from its time.

    Windows that lie across the edge of a block of time are left out.

    Args:
        pairs: Nominal windows.
        rung: A rung of `enhancer.ladder`.
        seed: Seed of the networks.
    """
    edges = block_edges(int(pairs.starts.min()), int(pairs.starts.max()) + WINDOW, WINDOW)
    found = []
    for fold in range(_NUM_FOLDS):
        learnt, rest = split_fold(pairs.starts, WINDOW, edges, fold)
        fitted = fit_rung(rung, pairs.coarse[learnt], pairs.telemetry[learnt], pairs.starts[learnt], seed)
        found.append(pairs.telemetry[rest] - fitted.predict(pairs.coarse[rest]))
    return np.concatenate(found)


class Judge:
    """Trains detectors for a replicate and judges them.

    Args:
        recorded: The runs.
        pairs: The windows that the simulator is fitted to.
        rung: The enhancer, a rung of `enhancer.ladder`.
        seed: Seed of everything drawn.
    """

    def __init__(self, recorded: Recorded, pairs: PairWindows, rung: str, seed: int):
        self.recorded, self.pairs, self.seed = recorded, pairs, seed
        self.enhancer = fit_rung(rung, pairs.coarse, pairs.telemetry, pairs.starts, seed)
        self.num_fit, self.num_coarse = (len(recorded.get(part, "coarse")) // ORBIT_SAMPLES - 1 for part in ("fit", "coarse"))
        self.num_stretches = max(1, len(recorded.get("test", "coarse")) // len(recorded.get("fault", "coarse")))

    @functools.cached_property
    def residuals(self) -> np.ndarray:
        """Residual windows of the orbits that the simulator is fitted to, see `cross_fitted_residuals`."""
        return cross_fitted_residuals(self.pairs, self.enhancer.name, self.seed)

    @functools.cached_property
    def test(self) -> dict[Fault | None, PairWindows]:
        """Windows of the fine simulator on which detectors are judged: nominal (None) and under each fault."""
        return {fault: fault_windows(self.recorded, fault, self.seed) for fault in (None, *ALL)}

    def noise(self, number: int, stream: int) -> np.ndarray:
        """Draws whole residual windows again, shape `(number, WINDOW)`."""
        return self.residuals[np.random.default_rng([self.seed, stream]).integers(0, len(self.residuals), number)]

    def arms(self) -> Arms:
        """Training windows and threshold windows of each arm, except for the GAN's."""
        coarse, _ = coarse_windows(self.recorded, "coarse", 2 * NUM)
        enhanced = self.enhancer.predict(coarse)
        autoregression = GaussianAutoregression.fit(self.residuals, _ORDER)
        fit, more = (pair_windows(self.recorded, part, NUM, self.seed) for part in ("fit", "more"))
        part_samples = (_PART_ORBITS + 1) * ORBIT_SAMPLES
        halves = {
            COARSE: coarse[:, :, 0],
            ENHANCED: enhanced,
            RESAMPLED: enhanced + self.noise(len(enhanced), 1),
            AUTOREGRESSION: enhanced + autoregression.generate(len(enhanced), np.random.default_rng([self.seed, 2])),
        }
        arms = {name: apart(windows, 1 / 2, self.num_coarse) for name, windows in halves.items()}
        arms[CLEAN] = fit.fine, more.fine
        dense = pair_windows(self.recorded, "fit", 2 * NUM, self.seed)
        arms[REAL_15] = apart(dense.telemetry[dense.starts + WINDOW <= part_samples], 2 / 3, _PART_ORBITS)
        arms[REAL_60] = apart(dense.telemetry, 2 / 3, self.num_fit)
        arms[REAL_120] = fit.telemetry, more.telemetry
        return {name: arms[name] for name in ARMS if name in arms}

    def convolutional_arm(self, num_iterations: int, verbose: bool = False) -> Arms:
        """The arm of enhanced windows with noise of the convolutional GAN, which learns the residuals."""
        from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan

        gan = convolutional_noise_gan(self.residuals, num_iterations, self.seed)
        gan.fit(self.residuals, num_iterations, verbose=verbose)
        coarse, _ = coarse_windows(self.recorded, "coarse", 2 * NUM)
        return {CONVOLUTIONAL: apart(self.enhancer.predict(coarse) + gan.generate(2 * NUM, self.seed), 1 / 2, self.num_coarse)}

    def rows(self, arms: Mapping[str, tuple[np.ndarray, np.ndarray]], names: tuple[str, ...]) -> list[dict[str, Any]]:
        """Trains detectors on each arm and judges them; see `judge`."""
        found = []
        for arm, (training, held_out) in arms.items():
            for name in names:
                detector = DETECTORS[name](self.seed).fit(training)
                scores = {fault: detector.score(pairs.telemetry) for fault, pairs in self.test.items()}
                found += judge(arm, name, detector.score(held_out), scores, self.num_stretches)
        return found

    def residual_rows(self) -> list[dict[str, Any]]:
        """Judges the root-mean-square residual of each window. Its threshold comes from the orbits that the simulator is fitted to."""
        found = []
        for arm, is_enhanced in RESIDUALS.items():
            fitted = self.residuals if is_enhanced else self.pairs.telemetry - self.pairs.coarse[:, :, 0]
            scores = {}
            for fault in self.test:
                pairs = fault_windows(self.recorded, fault, self.seed, is_planned=True)
                run = self.enhancer.predict(pairs.coarse) if is_enhanced else pairs.coarse[:, :, 0]
                scores[fault] = _rms(pairs.telemetry - run)
            found += judge(arm, "residual", _rms(fitted), scores, self.num_stretches)
        return found


def judge(
    arm: str, detector: str, held_out: np.ndarray, scores: Mapping[Fault | None, np.ndarray], num_stretches: int
) -> list[dict[str, Any]]:
    """Judges a detector at the conformal threshold of `RATE` on held-out windows of its arm.

    Args:
        arm: What it learnt from.
        detector: Its name.
        held_out: Scores of nominal windows of the arm.
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
                "arm": arm,
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
