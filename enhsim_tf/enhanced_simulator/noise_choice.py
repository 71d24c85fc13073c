"""Chooses among noise models by held-out noise (an extension of section 2.3).

A noise model is useful if windows with its noise cannot be told from real windows by what is trained on them. Each candidate
is therefore judged on held-out noise in three ways: how well a classifier separates generated from real windows of noise and
the signal below them, how many false alarms two cheap detectors raise on real windows after training on generated ones, and how many
injected anomalies they find: few false alarms are no success where thresholds are so high that anomalies are missed. The simplest candidate
that passes all three is chosen. Rule and tolerances were fixed before the experiment that judges them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.two_sample import boosted_trees
from enhsim_tf.common.window_features import DECIMALS, signal_features, window_features
from enhsim_tf.detection import evaluation, metrics
from enhsim_tf.detection.registry import DETECTORS

MAX_AUC_EXCESS = 0.05  # by which the AUC of a candidate may exceed that of real windows against other real windows
MAX_ALARM_EXCESS = 0.01  # by which its mean false-alarm rate may exceed that of detectors trained on real windows
MAX_RECALL_LOSS = 0.03  # by which its mean recall may be below that of detectors trained on real windows, at their own thresholds
TOLD_APART = 0.8  # AUC above which generated noise must not be used without a warning
_CHEAP = ("PCA residual", "isolation forest")
_LEAST_WINDOWS = 20
_NUM_ANOMALOUS = 60  # windows with anomalies, for each kind and severity


@dataclasses.dataclass(frozen=True)
class CandidateJudgement:
    """How a candidate does on held-out noise.

    Args:
        name: Name of the noise model.
        auc: AUC of a classifier that separates generated from held-out real windows.
        real_auc: The same for real against other real windows: the floor.
        alarms: False-alarm rate on held-out real windows, mean over the cheap detectors, trained on generated windows.
        real_alarms: The same for detectors trained on real windows.
        recall: Share of injected anomalies that the same detectors find, mean over kinds, severities and detectors.
        real_recall: The same for detectors trained on real windows.
    """

    name: str
    auc: float
    real_auc: float
    alarms: float
    real_alarms: float
    recall: float
    real_recall: float

    @property
    def _excesses(self) -> tuple[float, float, float]:
        """By how much the AUC and the false alarms are above those of real windows, and the recall is below."""
        return self.auc - max(self.real_auc, 0.5), self.alarms - self.real_alarms, self.real_recall - self.recall

    @property
    def passes(self) -> bool:
        """Whether neither the classifier nor the detectors tell generated from real windows, within the tolerances."""
        limits = (MAX_AUC_EXCESS, MAX_ALARM_EXCESS, MAX_RECALL_LOSS)
        return all(excess <= limit for excess, limit in zip(self._excesses, limits, strict=True))

    @property
    def departure(self) -> float:
        """Sum of the three excesses, by which candidates are compared if none passes."""
        return sum(max(excess, 0) for excess in self._excesses)


class NoiseJudge:
    """Judges generated noise on held-out noise. What concerns real noise alone is computed once, for all candidates.

    Args:
        learnt: Real noise windows from which the models were fitted, shape `(windows, samples)`.
        held_out: Real noise windows that they were not fitted to, as many.
        signals: Three arrays of clean signal windows, to which generated, learnt and held-out noise are added.
        compared: What the classifier sees of learnt and held-out noise (see `features_of`). It must not come from windows that
            overlap: the classifier recognises single windows of real noise, whatever the noise is like.
        rate: False-alarm rate for which thresholds are set.
        seed: Seed of the classifier, the detectors and the positions of the anomalies.

    Raises:
        InputError: If there are fewer than 20 windows of a kind.
    """

    def __init__(
        self,
        learnt: np.ndarray,
        held_out: np.ndarray,
        signals: Sequence[np.ndarray],
        compared: Sequence[np.ndarray],
        rate: float = 0.01,
        seed: int = 0,
    ):
        _check_number(min(len(learnt), len(held_out)))
        self.rate, self.seed, self._signals = rate, seed, signals
        nominal = signals[2][: len(held_out)] + held_out
        self._trial = evaluation.make_trial(nominal, nominal, None, unit_of(learnt), seed, _NUM_ANOMALOUS)
        learnt_features, self._held_out_features = compared
        self.real_auc = boosted_trees(learnt_features, self._held_out_features, seed).auc
        self.real_alarms, self.real_recall = self._detected(signals[1][: len(learnt)] + learnt)

    def _detected(self, training: np.ndarray) -> tuple[float, float]:
        """False-alarm rate and recall on held-out real windows, means over the cheap detectors; half of the windows set the thresholds."""
        half, rates, recalls = len(training) // 2, [], []
        for name in _CHEAP:
            detector = DETECTORS[name](self.seed).fit(training[:half])
            threshold, _ = metrics.finite_threshold(
                detector.score(training[half:]), self.rate
            )  # an infinite one would silence all candidates
            rates.append(metrics.false_alarm_rate(detector.score(self._trial.nominal), threshold))
            recalls += [metrics.recall(detector.score(windows), threshold) for windows in self._trial.anomalous.values()]
        return float(np.mean(rates)), float(np.mean(recalls))

    def judge(self, name: str, generated: np.ndarray, compared: np.ndarray) -> CandidateJudgement:
        """Judges the noise of a candidate.

        Args:
            name: Name of the noise model.
            generated: Generated noise windows, as many as real ones; half train the detectors, and half set their thresholds.
            compared: What the classifier sees of generated noise.
        """
        _check_number(len(generated))
        auc = boosted_trees(compared, self._held_out_features, self.seed).auc
        alarms, recall = self._detected(self._signals[0][: len(generated)] + generated)
        return CandidateJudgement(name, auc, self.real_auc, alarms, self.real_alarms, recall, self.real_recall)


def unit_of(noise: np.ndarray) -> float:
    """The standard deviation of real noise, or 1 if it is 0."""
    return float(np.std(noise, dtype=np.float64)) or 1.0


def features_of(noise: np.ndarray, signal: np.ndarray, edges: np.ndarray, unit: float) -> np.ndarray:
    """What the classifier sees: features of the noise, and of the noise where the signal has different levels and slopes.

    Args:
        noise: Windows of noise, shape `(windows, samples)`.
        signal: The signal below them, of the same shape.
        edges: As returned by `window_features.signal_edges`.
        unit: The unit in which the noise is described, as returned by `unit_of`, so that the unit of the channel has no effect.

    Returns:
        float64 array of shape `(windows, 26)`; short windows have fewer frequency bands and therefore fewer columns.
    """
    noise = np.round(np.asarray(noise, np.float64) / unit, DECIMALS)
    return np.concatenate([window_features(noise), signal_features(noise, signal, edges)], axis=1)


def _check_number(number: int) -> None:
    if number < _LEAST_WINDOWS:
        raise InputError(
            f"Expected at least {_LEAST_WINDOWS} windows of each kind. Received: {number}. Use more telemetry or shorter windows."
        )


def choose(judgements: Sequence[CandidateJudgement]) -> str:
    """Returns the name of the first candidate that passes, or of that with the smallest departure if none does."""
    passing = [each.name for each in judgements if each.passes]
    return passing[0] if passing else min(judgements, key=lambda each: each.departure).name
