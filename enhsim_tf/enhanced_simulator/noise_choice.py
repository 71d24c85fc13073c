"""Chooses a noise model from the ladder by held-out noise (an extension of section 2.3).

A noise model is useful if windows with its noise cannot be told from real windows by what is trained on them. Each rung of the
ladder is therefore judged on held-out noise in two ways: how well a classifier separates generated from real windows of noise and
the signal below them, and how many false alarms two cheap detectors raise on real windows after training on generated ones. The
simplest rung that passes both is chosen. Rule and tolerances were fixed before the experiment that judges them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.realism.two_sample import boosted_trees
from enhsim_tf.realism.window_features import signal_edges, signal_features, window_features

MAX_AUC_EXCESS = 0.05  # by which the AUC of a rung may exceed that of real windows against other real windows
MAX_ALARM_EXCESS = 0.01  # by which its mean false-alarm rate may exceed that of detectors trained on real windows
TOLD_APART = 0.8  # AUC above which generated noise must not be used without a warning
_CHEAP = ("PCA residual", "isolation forest")
_LEAST_WINDOWS = 20


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


class NoiseJudge:
    """Judges the noise of rungs on held-out noise. What concerns real noise alone is computed once, for all rungs.

    Args:
        learnt: Real noise windows from which the rungs were fitted, shape `(windows, samples)`.
        held_out: Real noise windows that they were not fitted to, as many.
        signals: Three arrays of clean signal windows, to which generated, learnt and held-out noise are added.
        rate: False-alarm rate for which thresholds are set.
        seed: Seed of the classifier and the detectors.
        compared: What the classifier sees of learnt and held-out noise (see `features_of`), if it differs from the windows above: if
            windows overlap, the classifier recognises single windows of real noise, whatever the noise is like.

    Raises:
        InputError: If there are fewer than 20 windows of a kind.
    """

    def __init__(
        self,
        learnt: np.ndarray,
        held_out: np.ndarray,
        signals: Sequence[np.ndarray],
        rate: float = 0.01,
        seed: int = 0,
        compared: Sequence[np.ndarray] | None = None,
    ):
        number = min(len(learnt), len(held_out))
        _check_number(number)
        self.rate, self.seed, self._signals = rate, seed, signals
        self._judged = signals[2][: len(held_out)] + held_out
        self._edges = signal_edges(signals[1])
        self._unit = unit_of(learnt)
        if compared is None:
            compared = [
                features_of(noise[:number], signal[:number], self._edges, self._unit)
                for noise, signal in ((learnt, signals[1]), (held_out, signals[2]))
            ]
        learnt_features, self._held_out_features = compared
        self.real_auc = boosted_trees(learnt_features, self._held_out_features, seed).auc
        self.real_alarms = self._alarms(signals[1][: len(learnt)] + learnt)

    def _alarms(self, training: np.ndarray) -> float:
        """False-alarm rate on held-out real windows, mean over the cheap detectors; half of the windows set the thresholds."""
        half, rates = len(training) // 2, []
        for name in _CHEAP:
            detector = DETECTORS[name](self.seed).fit(training[:half])
            threshold, _ = metrics.finite_threshold(detector.score(training[half:]), self.rate)  # an infinite one would silence all rungs
            rates.append(metrics.false_alarm_rate(detector.score(self._judged), threshold))
        return float(np.mean(rates))

    def judge(self, rung: str, generated: np.ndarray, compared: np.ndarray | None = None) -> RungJudgement:
        """Judges the noise of a rung.

        Args:
            rung: Name of the rung.
            generated: Generated noise windows, as many as real ones; half train the detectors, and half set their thresholds.
            compared: What the classifier sees of generated noise, if that of real noise was given.
        """
        _check_number(len(generated))
        signal = self._signals[0][: len(generated)]
        if compared is None:
            compared = features_of(generated, signal, self._edges, self._unit)[: len(self._held_out_features)]
        auc = boosted_trees(compared, self._held_out_features, self.seed).auc
        return RungJudgement(rung, auc, self.real_auc, self._alarms(signal + generated), self.real_alarms)


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
    noise = np.asarray(noise, np.float64) / unit
    return np.concatenate([window_features(noise), signal_features(noise, signal, edges)], axis=1)


def _check_number(number: int) -> None:
    if number < _LEAST_WINDOWS:
        raise InputError(
            f"Expected at least {_LEAST_WINDOWS} windows of each kind. Received: {number}. Use more telemetry or shorter windows."
        )


def choose(judgements: Sequence[RungJudgement]) -> str:
    """Returns the first rung that passes, or the one with the smallest departure if none does."""
    passing = [each.rung for each in judgements if each.passes]
    return passing[0] if passing else min(judgements, key=lambda each: each.departure).rung
