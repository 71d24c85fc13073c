"""Judges fitted detectors on the test part of a channel: ranks of their scores, thresholds of two kinds, and rankings of samples."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.stats import rankdata

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import evaluation, metrics
from enhsim_tf.enhancer.training_pairs import cut_windows_from_parts
from enhsim_tf.telemetry.telemanom import LabelledChannel
from enhsim_tf.telemetry.windows import time_blocks
from studies.spacecraft.matched import windows_that_meet

RULES = {
    "own": "held-out windows of the arm itself",
    "past": "windows of the train part",
}
"""Windows whose scores set a threshold. For the arm `real` the two are the same: windows of the train part, cross-fitted."""
_STRIDES = 8  # scored windows a window's length


class Judge:
    """The test part of a channel, on which every detector is judged.

    Args:
        channel: The channel with its labels.
        window: Length of a window in samples.
        period: Period of the channel in samples, the largest buffer of VUS-PR.
        rate: False-alarm rate that thresholds are set for.

    Raises:
        InputError: If every window of the test part holds a labelled sample.
    """

    def __init__(self, channel: LabelledChannel, window: int, period: float, rate: float):
        self.channel, self.window, self.period, self.rate = channel, window, period, rate
        self.labels = np.array(channel.is_anomalous)
        self.rows: dict[str, list[dict[str, Any]]] = {"scores": [], "thresholds": [], "ranking": []}
        if not self.is_nominal.any():
            raise InputError(
                f"Expected a test part with windows of {window} samples that hold no labelled sample. "
                f"Received: none of {len(self.begins)} in {channel.labels.channel}. Use another channel."
            )

    @functools.cached_property
    def begins(self) -> np.ndarray:
        """First samples of the scored windows of the test part."""
        return np.arange(0, len(self.channel.test) - self.window + 1, max(1, self.window // _STRIDES))

    @functools.cached_property
    def windows(self) -> np.ndarray:
        """The scored windows of the test part, shape `(windows, samples)`."""
        return cut_windows_from_parts([self.channel.test], self.begins, self.window)[0]

    @functools.cached_property
    def is_nominal(self) -> np.ndarray:
        """Which of them hold no labelled sample."""
        return ~windows_that_meet(self.begins, self.window, len(self.channel.test), self.channel.labels.sequences).any(axis=0)

    def add(self, arm: str, detector: str, scores: np.ndarray, own: np.ndarray, past: np.ndarray) -> None:
        """Adds the results of one detector that was trained on one arm.

        Args:
            arm: Name of the arm.
            detector: Name of the detector.
            scores: Scores of the windows of the test part, in their order.
            own: Scores of held-out windows of the arm.
            past: Scores of windows of the train part.
        """
        about = {"arm": arm, "detector": detector}
        ranks = rankdata(scores, method="max").astype(np.int16)
        self.rows["scores"] += [about | {"place": place, "rank": rank} for place, rank in enumerate(ranks)]
        for rule, held_out in (("own", own), ("past", past)):
            threshold, rate = metrics.finite_threshold(held_out, self.rate)
            self.rows["thresholds"].append(about | {"rule": rule, "rank": int(np.sum(scores <= threshold)), "rate": rate})
        self.rank(arm, detector, evaluation.mean_over_windows(scores, self.begins, self.window, len(self.labels)))

    def rank(self, arm: str, detector: str, scores: np.ndarray) -> None:
        """Adds how well scores of samples rank the labelled samples of the test part."""
        from sklearn.metrics import average_precision_score

        areas = {
            "vus_pr": metrics.vus_pr(self.labels, scores, round(self.period)),
            "auc_pr": float(average_precision_score(self.labels, scores)),
        }
        self.rows["ranking"].append({"arm": arm, "detector": detector} | areas)

    def share_of_alarms(self, arm: str) -> dict[str, float]:
        """Share of nominal test windows above the arm's own threshold, for each detector."""
        limits = {row["detector"]: row["rank"] for row in self.rows["thresholds"] if row["arm"] == arm and row["rule"] == "own"}
        ranks: dict[str, list[int]] = {}
        for row in self.rows["scores"]:
            if row["arm"] == arm:
                ranks.setdefault(row["detector"], []).append(row["rank"])
        return {name: float(np.mean(np.array(ranks[name])[self.is_nominal] > limit)) for name, limit in limits.items()}


def cross_fitted_scores(
    make: Callable[[], Any], windows: np.ndarray, starts: np.ndarray, num_folds: int, on_fold: Callable[[int], None] | None = None
) -> np.ndarray:
    """Scores windows by detectors that were fitted to other blocks of time, which share no sample with them.

    Args:
        make: Returns an unfitted detector.
        windows: Windows of one series, shape `(windows, samples)`.
        starts: First sample of each window, shape `(windows,)`.
        num_folds: Number of blocks of time.
        on_fold: Called after each block with the number of completed blocks.

    Returns:
        A score for each window, shape `(windows,)`.
    """
    scores = np.full(len(windows), np.nan)
    for done, (training, held_out) in enumerate(time_blocks(starts, num_folds, windows.shape[1]), 1):
        scores[held_out] = make().fit(windows[training]).score(windows[held_out])
        if on_fold is not None:
            on_fold(done)
    return scores
