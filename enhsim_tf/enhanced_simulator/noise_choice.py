"""Chooses a noise model from the ladder by held-out noise (an extension of section 2.3).

A noise model is useful if windows with its noise cannot be told from real windows by what is trained on them. Each rung of the
ladder is therefore judged on held-out noise in two ways: how much better than chance a classifier separates generated from real
windows, and how many false alarms two cheap detectors raise on real windows after training on generated ones. The simplest rung
that passes both is chosen. Rule and tolerances were fixed before the experiment that judges them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.realism.two_sample import two_sample_auc

MAX_AUC_EXCESS = 0.05  # by which the AUC of a rung may exceed that of real windows against other real windows
MAX_ALARM_EXCESS = 0.01  # by which its mean false-alarm rate may exceed that of detectors trained on real windows
TOLD_APART = 0.8  # AUC above which generated noise must not be used without a warning
_CHEAP = ("PCA residual", "isolation forest")


@dataclasses.dataclass(frozen=True)
class RungJudgement:
    """How a rung does on held-out noise.

    Args:
        rung: Name of the rung.
        auc: AUC of a classifier that separates generated from held-out real windows.
        real_auc: The same for real against other real windows: the floor.
        alarms: False-alarm rate on held-out real windows, mean over the cheap detectors, trained on generated windows.
        real_alarms: The same for detectors trained on real windows.
    """

    rung: str
    auc: float
    real_auc: float
    alarms: float
    real_alarms: float

    @property
    def passes(self) -> bool:
        """Whether neither the classifier nor the detectors tell generated from real windows, within the tolerances."""
        return self.auc - max(self.real_auc, 0.5) <= MAX_AUC_EXCESS and self.alarms - self.real_alarms <= MAX_ALARM_EXCESS

    @property
    def departure(self) -> float:
        """Sum of both excesses, by which rungs are compared if none passes."""
        return max(self.auc - max(self.real_auc, 0.5), 0) + max(self.alarms - self.real_alarms, 0)


def judge(
    rung: str,
    generated: np.ndarray,
    learnt: np.ndarray,
    held_out: np.ndarray,
    signals: Sequence[np.ndarray],
    rate: float = 0.01,
    seed: int = 0,
    compared: Sequence[np.ndarray] | None = None,
) -> RungJudgement:
    """Judges the noise of a rung on held-out noise.

    Args:
        rung: Name of the rung.
        generated: Generated noise windows, shape `(windows, samples)`; half train the detectors, and half set their thresholds.
        learnt: Real noise windows from which the rung was fitted, at least as many.
        held_out: Real noise windows that it was not fitted to.
        signals: Three arrays of clean signal windows, to which generated, learnt and held-out noise are added.
        rate: False-alarm rate for which thresholds are set.
        seed: Seed of the classifier and the detectors.
        compared: Generated, learnt and held-out noise for the classifier, if it differs from those above: if windows overlap, the
            classifier recognises single windows of real noise, whatever the noise is like.
    """
    number = min(len(generated), len(learnt), len(held_out))
    half = number // 2
    if half < 10:
        raise InputError(f"Expected at least 20 windows of each kind. Received: {number}. Use more telemetry or shorter windows.")
    windows, reference, judged = (
        (signal[: len(noise)] + noise) for signal, noise in zip(signals, (generated, learnt, held_out), strict=True)
    )
    alarms = {"generated": [], "real": []}
    for name in _CHEAP:
        for kind, training in (("generated", windows), ("real", reference)):
            detector = DETECTORS[name](seed).fit(training[:half])
            alarms[kind].append(metrics.false_alarm_rate(detector.score(judged), metrics.threshold(detector.score(training[half:]), rate)))
    tried = [each[:number] for each in (generated, learnt, held_out)] if compared is None else compared
    return RungJudgement(
        rung,
        two_sample_auc(tried[0], tried[2], seed),
        two_sample_auc(tried[1], tried[2], seed),
        float(np.mean(alarms["generated"])),
        float(np.mean(alarms["real"])),
    )


def choose(judgements: Sequence[RungJudgement]) -> str:
    """Returns the first rung that passes, or the one with the smallest departure if none does."""
    passing = [each.rung for each in judgements if each.passes]
    return passing[0] if passing else min(judgements, key=lambda each: each.departure).rung
