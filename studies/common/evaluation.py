"""Evaluation of detectors on real telemetry, as a function of their training data (title and
abstract of the paper).

An arm of the experiment is a kind of training data, for example windows of the enhanced simulator.
Each detector is trained on one arm, and its threshold is set on held-out windows of the same arm.
If the arm and real telemetry were exchangeable, the false-alarm rate on real nominal windows would
be at most the nominal rate. The excess of the false-alarm rate over the nominal rate measures the
gap between simulation and reality.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.datasets.anomalies import INJECTIONS
from enhsim_tf.scoring.metrics import recall, threshold
from enhsim_tf.telemetry.windows import time_blocks
from studies.common.detectors import Detector
from studies.common.injections import SEVERITIES, inject_durations

if TYPE_CHECKING:
    import pandas as pd

_NUM_BLOCKS = 10  # consecutive blocks of time for which false alarms are counted separately


@dataclasses.dataclass(frozen=True)
class Trial:
    """Real telemetry on which all arms are evaluated.

    Args:
        nominal: Real nominal windows without overlaps, in the order of time, on which false alarms
            are counted.
        reference: Other real nominal windows. Recall at the real rate uses a threshold from their
            scores.
        anomalous: Maps a kind and a severity to anomalous windows, which `injections.inject` made
            from real nominal windows.
        rate: Nominal false-alarm rate of the thresholds.
    """

    nominal: np.ndarray
    reference: np.ndarray
    anomalous: Mapping[tuple[str, float], np.ndarray]
    rate: float = 0.01


def make_trial(
    nominal: np.ndarray,
    reference: np.ndarray,
    noise_sd: float,
    seed: int,
    num_anomalous: int = 150,
    rate: float = 0.01,
) -> Trial:
    """Creates a trial by injecting anomalies of every kind and severity into real nominal
    telemetry.

    The random numbers are independent of the arms. The three durations alternate between windows.
    All kinds and severities use the same windows and positions.

    Args:
        nominal: Real nominal windows, shape `(windows, samples)`, in the order of time.
        reference: Other real nominal windows.
        noise_sd: Standard deviation of the real noise, which is the unit of severity.
        seed: Seed for the positions.
        num_anomalous: Number of anomalous windows for each kind and severity, evenly spaced over
            the nominal windows.
        rate: Nominal false-alarm rate of the thresholds.
    """
    chosen = nominal[np.linspace(0, len(nominal) - 1, min(num_anomalous, len(nominal))).astype(int)]
    anomalous = {
        (kind, severity): inject_durations(chosen, kind, severity, noise_sd, [seed])
        for kind in INJECTIONS
        for severity in SEVERITIES
    }
    return Trial(nominal, reference, anomalous, rate)


def evaluate_arm(
    training: np.ndarray,
    held_out: np.ndarray,
    trial: Trial,
    detectors: Mapping[str, Callable[[int], Detector]],
    seed: int,
) -> dict[str, list[dict]]:
    """Trains every detector on one arm and evaluates it on real telemetry.

    Args:
        training: Training windows of the arm, shape `(windows, samples)`.
        held_out: Further windows of the arm, on which the threshold is set.
        trial: Real telemetry for the evaluation.
        detectors: Maps a name to a factory, which takes a seed and returns an unfitted detector.
        seed: Seed for the detectors.

    Returns:
        The rows of two tables: `alarms` (detector, block, alarms, windows) and `recall` (detector,
        kind, severity, recall, recall_at_real_rate).
    """
    tables: dict[str, list[dict]] = {"alarms": [], "recall": []}
    for name, make in detectors.items():
        detector = make(seed).fit(training)
        limit = threshold(detector.score(held_out), trial.rate)
        nominal = detector.score(trial.nominal)
        reference = detector.score(trial.reference)
        for block, scores in enumerate(np.array_split(nominal, _NUM_BLOCKS)):
            tables["alarms"].append(
                {
                    "detector": name,
                    "block": block,
                    "alarms": int(np.sum(scores > limit)),
                    "windows": len(scores),
                }
            )
        all_scores = detector.score(np.concatenate(list(trial.anomalous.values())))
        parts = np.split(
            all_scores, np.cumsum([len(windows) for windows in trial.anomalous.values()])[:-1]
        )
        for (kind, severity), scores in zip(trial.anomalous, parts, strict=True):
            tables["recall"].append(
                {
                    "detector": name,
                    "kind": kind,
                    "severity": severity,
                    "recall": recall(scores, limit),
                    "recall_at_real_rate": recall_at_real_rate(reference, scores, trial.rate),
                }
            )
    return tables


def recall_at_real_rate(
    real_scores: np.ndarray, anomalous_scores: np.ndarray, rate: float = 0.01
) -> float:
    """Computes the recall at the real rate, that is at a threshold that is set on real nominal
    windows.

    This recall measures how well a detector separates nominal from anomalous windows. It does not
    depend on the threshold from the detector's own training arm.

    Args:
        real_scores: Scores of real nominal windows, which are not those for which the false-alarm
            rate is reported.
        anomalous_scores: Scores of anomalous windows.
        rate: Nominal false-alarm rate of the threshold.
    """
    return recall(anomalous_scores, threshold(real_scores, rate))


def by_detector(tables: Mapping[str, list[dict]]) -> "pd.DataFrame":
    """A row for each detector from what `evaluate_arm` returns: alarms and windows over all blocks
    of time, and recall as the mean over kinds and severities.
    """
    import pandas as pd

    alarms, recall = (
        pd.DataFrame(tables[name]).groupby("detector", sort=False) for name in ("alarms", "recall")
    )
    counts = alarms[["alarms", "windows"]].sum()
    return counts.join(recall[["recall", "recall_at_real_rate"]].mean()).reset_index()


def cross_fitted_scores(
    make: Callable[[], Detector], windows: np.ndarray, starts: np.ndarray, num_folds: int
) -> np.ndarray:
    """Scores windows by detectors that were fitted to other blocks of time, which share no sample
    with them.

    Args:
        make: Returns an unfitted detector.
        windows: Windows of one series, shape `(windows, samples)`.
        starts: First sample of each window, shape `(windows,)`.
        num_folds: Number of blocks of time.

    Returns:
        A score for each window, shape `(windows,)`.
    """
    scores = np.full(len(windows), np.nan)
    for training, held_out in time_blocks(starts, num_folds, windows.shape[1]):
        scores[held_out] = make().fit(windows[training]).score(windows[held_out])
    return scores
