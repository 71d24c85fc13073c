"""Chooses among noise models by held-out noise (an extension of section 2.3).

A noise model is useful if windows with its noise cannot be told from real windows by what is trained on them. Each candidate is therefore
judged on held-out noise in three ways: how well a classifier separates generated from real windows of noise and the signal below them, how
many false alarms two cheap detectors raise on real windows after training on generated ones, and how many injected anomalies they find:
few false alarms are no success where thresholds are so high that anomalies are missed. The simplest candidate that passes all three is
chosen. Candidates are tried from simple to complex, and those after the first that passes are not tried.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.two_sample import boosted_trees, window_features
from enhsim_tf.detection import metrics
from enhsim_tf.detection.anomalies import DURATIONS, INJECTIONS, SEVERITIES, inject
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.noise.candidates import NoiseModel, fit_candidate
from enhsim_tf.noise.names import CANDIDATES
from enhsim_tf.simulator.joint import rounded, spread_of
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.windows import disjoint_rows

MAX_AUC_EXCESS = 0.05  # by which the AUC of a candidate may exceed that of real windows against other real windows
MAX_ALARM_EXCESS = 0.01  # by which its mean false-alarm rate may exceed that of detectors trained on real windows
MAX_RECALL_LOSS = 0.03  # by which its mean recall may be below that of detectors trained on real windows, at their own thresholds
TOLD_APART = 0.8  # AUC above which generated noise must not be used without a warning
JUDGED_SHARE = 0.25  # of the time, at its end, on which candidates are judged
MOST_JUDGED = 1_000  # windows
_CHEAP, _RATE = ("PCA residual", "isolation forest"), 0.01  # detectors, and the false-alarm rate for which their thresholds are set
_LEAST_WINDOWS = 20
_NUM_ANOMALOUS = 60  # windows with anomalies, for each kind and severity
_ENOUGH_PIECES, _LEAST_PIECE = 200, 16  # disjoint pieces that the classifier should see, and their least length in samples
_DRAW = 73  # number of the random draw
DECIMALS = 4
"""Decimals, in standard deviations of the noise, at which noise is compared. Smaller differences are rounding errors of 32-bit telemetry, by
which a classifier tells quantised noise from itself."""


@dataclasses.dataclass(frozen=True)
class NoiseWindows:
    """Windows of noise, telemetry minus enhanced signal, of shape `(windows, samples, channels)`."""

    noise: np.ndarray
    clean: np.ndarray  # the enhanced windows below them
    starts: np.ndarray | None = None  # first sample of each window; None of generated noise

    @functools.cached_property
    def disjoint(self) -> "NoiseWindows":
        """Those windows that share no sample; all of generated noise."""
        return self if self.starts is None else self.at(disjoint_rows(self.starts, self.noise.shape[1]))

    def at(self, rows: np.ndarray) -> "NoiseWindows":
        """Some of the windows."""
        return NoiseWindows(self.noise[rows], self.clean[rows], None if self.starts is None else self.starts[rows])

    def evenly(self, number: int) -> "NoiseWindows":
        """So many of the windows, evenly spaced."""
        return self.at(np.linspace(0, len(self) - 1, number).astype(int))

    def fit(self, name: str) -> NoiseModel:
        """Fits the candidate of a name to these windows."""
        return fit_candidate(name, self.noise, self.clean, self.starts)

    def __len__(self) -> int:
        return len(self.noise)


@dataclasses.dataclass(frozen=True)
class CandidateJudgement:
    """How a candidate does on held-out noise."""

    name: str
    auc: float | None  # of a classifier that separates generated from held-out real windows; None if false alarms or recall had decided
    real_auc: float  # the same for real against other real windows: the floor
    alarms: float  # false-alarm rate on held-out real windows, mean over the cheap detectors, trained on generated windows
    real_alarms: float  # the same for detectors trained on real windows
    recall: float  # share of injected anomalies that these detectors find, mean over kinds, severities and detectors
    real_recall: float  # the same for detectors trained on real windows

    @property
    def _excesses(self) -> tuple[float, float, float]:
        """By how much the AUC and the false alarms are above those of real windows, and the recall is below."""
        auc = np.inf if self.auc is None else self.auc
        return auc - max(self.real_auc, 0.5), self.alarms - self.real_alarms, self.real_recall - self.recall

    @property
    def passes(self) -> bool:
        """Whether neither the classifier nor the detectors tell generated from real windows, within the tolerances."""
        limits = (MAX_AUC_EXCESS, MAX_ALARM_EXCESS, MAX_RECALL_LOSS)
        return all(excess <= limit for excess, limit in zip(self._excesses, limits, strict=True))

    @property
    def departure(self) -> float:
        """Sum of the three excesses, by which candidates are compared if none passes."""
        return sum(max(excess, 0) for excess in self._excesses)


def choose(judgements: Sequence[CandidateJudgement]) -> str:
    """Returns the name of the first candidate that passes, or of that with the smallest departure if none does."""
    passing = [each.name for each in judgements if each.passes]
    return passing[0] if passing else min(judgements, key=lambda each: each.departure).name


def choose_noise(
    learnt: NoiseWindows,
    judged: NoiseWindows,
    everything: NoiseWindows,
    seed: int,
    quantisation: Sequence[Levels | None] = (),
    with_signal: bool = True,
) -> tuple[NoiseModel, list[dict[str, Any]], list[str]]:
    """Judges candidates that are fitted to windows of the first part of the time on those of the last.

    Args:
        learnt: Windows of the first part of the time, in order.
        judged: Windows of the last part of the time, in order.
        everything: Windows of the whole time.
        seed: Seed of the draws and of the judges.
        quantisation: Levels of each channel, or None.
        with_signal: Whether the cheap detectors see the enhanced signal with the noise, or the noise alone.

    Returns:
        The chosen model, fitted to everything; for each candidate that was tried the fields of `CandidateJudgement`, `passes` and
        `is_chosen`, none if there is too little telemetry to judge; and what is to be said.
    """
    if min(len(judged), len(learnt)) < _LEAST_WINDOWS or len(pieces_of(learnt, judged)[0]) < _LEAST_WINDOWS:
        note = "there is too little telemetry to judge noise models; whole residual windows are drawn"
        return everything.fit("residual windows"), [], [note]
    judgements, notes, judge = [], [], HeldOutJudge(learnt, judged, seed, quantisation, with_signal)
    models: dict[str, NoiseModel] = {}
    for number, name in enumerate(CANDIDATES):
        try:
            models[name] = learnt.fit(name)
        except InputError as error:
            notes.append(f"noise model {name} left out: {error}")
            continue
        judgements.append(judge.judge(name, models[name], np.random.default_rng([seed, _DRAW, number]), in_full=False))
        if judgements[-1].passes:
            break
    if not judgements[-1].passes:  # all measures are needed to compare them
        for place, each in enumerate(judgements):
            if each.auc is None:
                auc = judge.classify(models[each.name], np.random.default_rng([seed, _DRAW, CANDIDATES.index(each.name), 1]))
                judgements[place] = dataclasses.replace(each, auc=auc)
    chosen = choose(judgements)
    rows = [dataclasses.asdict(each) | {"passes": bool(each.passes), "is_chosen": each.name == chosen} for each in judgements]
    return everything.fit(chosen), rows, notes


class HeldOutJudge:
    """Judges noise models on held-out telemetry; what concerns real noise alone is computed once. The arguments are those of `choose_noise`.

    The classifier sees disjoint windows only, cut into pieces if there are few of them: it recognises single windows that overlap, whatever
    their noise is like. Of each candidate as many are generated: of more, some would repeat real noise if it draws real windows again.
    """

    def __init__(
        self, learnt: NoiseWindows, judged: NoiseWindows, seed: int, quantisation: Sequence[Levels | None] = (), with_signal: bool = True
    ):
        number = min(len(judged), len(learnt), MOST_JUDGED)
        first, self._learnt, self._held_out = learnt.evenly(number), learnt, judged
        self.seed, self._with_signal, self._quantisation = seed, with_signal, tuple(quantisation)
        few = min(number, len(learnt.disjoint), len(judged.disjoint))
        self._clean, self._few = first.clean, first.evenly(few).clean
        real, held_out = pieces_of(learnt, judged)
        self._unit = spread_of(real.noise)
        self._edges = [signal_edges(each) for each in np.moveaxis(real.clean, 2, 0)]
        self._held_out_features = self._features(held_out)
        self.real_auc = boosted_trees(self._features(real), self._held_out_features, seed)
        self._noise_sd, self._nominal = spread_of(first.noise), self._seen(judged.evenly(number))
        some = self._seen(judged.evenly(number).evenly(min(_NUM_ANOMALOUS, number)))
        self._anomalous = np.concatenate(list(anomalous_windows(some, self._noise_sd, seed).values()))
        self.real_alarms, self.real_recall = self._detected(self._seen(first))

    def _features(self, windows: NoiseWindows) -> np.ndarray:
        """What the classifier sees: features of the noise, also where the signal has different levels and slopes, and between channels."""
        noise = np.round(np.asarray(windows.noise, np.float64) / self._unit, DECIMALS)
        columns = []
        for own, signal, edges in zip(np.moveaxis(noise, 2, 0), np.moveaxis(windows.clean, 2, 0), self._edges, strict=True):
            columns += [window_features(own), signal_features(own, signal, edges)]
        centred = noise - noise.mean(axis=1, keepdims=True)
        covariance = np.einsum("wsa,wsb->wab", centred, centred)
        size = np.sqrt(np.maximum(np.einsum("waa->wa", covariance), 1e-12))
        columns.append((covariance / (size[:, :, None] * size[:, None]))[:, *np.triu_indices(noise.shape[2], 1)])
        # where the signal of the first channel of a pair is high minus where it is low
        sign = np.sign(windows.clean - windows.clean.mean(axis=(0, 1)))
        by_signal = np.einsum("wsa,wsb->wab", sign * centred, centred) / (size[:, :, None] * size[:, None])
        columns.append(by_signal[:, ~np.eye(noise.shape[2], dtype=bool)])
        return np.concatenate(columns, axis=1)

    def _seen(self, windows: NoiseWindows) -> np.ndarray:
        return windows.noise + windows.clean if self._with_signal else windows.noise

    def _detected(self, training: np.ndarray) -> tuple[float, float]:
        """False-alarm rate and recall on held-out real windows, means over the cheap detectors; half of the windows set the thresholds."""
        half, rates, recalls = len(training) // 2, [], []
        training, nominal, anomalous = (each / self._noise_sd for each in (training, self._nominal, self._anomalous))
        for name in _CHEAP:
            detector = DETECTORS[name](self.seed).fit(training[:half])
            # an infinite threshold would silence all candidates
            threshold, _ = metrics.finite_threshold(detector.score(training[half:]), _RATE)
            rates.append(metrics.false_alarm_rate(detector.score(nominal), threshold))
            recalls.append(metrics.recall(detector.score(anomalous), threshold))
        return float(np.mean(rates)), float(np.mean(recalls))

    def _noise_on(self, clean: np.ndarray, model: NoiseModel, rng: np.random.Generator) -> NoiseWindows:
        # sums of 32-bit numbers: where the signal is large, the noise that is judged has their steps, as the real one has
        generated = rounded(clean + model.generate(len(clean), rng, clean), self._quantisation)
        return NoiseWindows(generated - clean, clean)

    def judge(self, name: str, model: NoiseModel, rng: np.random.Generator, in_full: bool = True) -> CandidateJudgement:
        """Judges a fitted noise model; `in_full` asks the classifier, which takes longest, also where false alarms or recall have decided."""
        noise = self._noise_on(self._clean, model, rng)
        alarms, recall = self._detected(self._seen(noise))
        is_close = alarms - self.real_alarms <= MAX_ALARM_EXCESS and self.real_recall - recall <= MAX_RECALL_LOSS
        auc = self.classify(model, rng) if in_full or is_close else None
        return CandidateJudgement(name, auc, self.real_auc, alarms, self.real_alarms, recall, self.real_recall)

    def classify(self, model: NoiseModel, rng: np.random.Generator) -> float:
        """Returns the AUC of a classifier that separates windows with the model's noise from held-out real ones."""
        pieces = pieces_of(self._learnt, self._held_out, self._noise_on(self._few, model, rng))[-1]
        return boosted_trees(self._features(pieces), self._held_out_features, self.seed)


def signal_edges(signal_windows: np.ndarray) -> np.ndarray:
    """Where `signal_features` divides a signal's levels, and its slopes, into thirds: both edges of each, shape `(2, 2)`."""
    values = np.asarray(signal_windows, np.float64)
    return np.stack([np.quantile(each, (1 / 3, 2 / 3)) for each in (values, np.gradient(values, axis=1))])


def signal_features(noise_windows: np.ndarray, signal_windows: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Computes twelve features of noise and the signal below it, which tell noise that depends on the signal from noise that does not.

    Both are windows of the same shape; the edges are those of `signal_edges`.

    The features are the mean of the noise and the logarithm of its root mean square, each where the signal is low, medium and
    high, and where it falls, is flat and rises. Where a window has no such samples, they are those of the whole window.
    """
    noise, signal = np.asarray(noise_windows, np.float64), np.asarray(signal_windows, np.float64)
    columns = []
    for values, (low, high) in zip((signal, np.gradient(signal, axis=1)), edges, strict=True):
        third = (values > low).astype(int) + (values > high)
        for number in range(3):
            is_there = third == number
            is_there[~is_there.any(axis=1)] = True
            count = is_there.sum(axis=1)
            mean_square = np.sum(noise**2, axis=1, where=is_there) / count
            columns += [np.sum(noise, axis=1, where=is_there) / count, np.log(mean_square + 1e-24) / 2]
    return np.stack(columns, axis=1)


def anomalous_windows(
    nominal: np.ndarray, noise_sd: np.ndarray, seed: int, severities: Sequence[float] = SEVERITIES
) -> dict[tuple[str, float], np.ndarray]:
    """Injects anomalies of every kind and severity, in units of the noise of each channel, into one channel of each window; durations alternate."""
    durations = [min(duration, nominal.shape[1]) for duration in DURATIONS]
    found = {}
    for kind in INJECTIONS:
        for severity in severities:
            windows = found[kind, severity] = nominal.copy()
            for place, duration in enumerate(durations):
                rows, rng = np.arange(place, len(windows), len(durations)), np.random.default_rng([seed, place])
                channel = rng.integers(0, windows.shape[2], len(rows))
                unit = noise_sd[channel][:, None]
                windows[rows, :, channel] = inject(windows[rows, :, channel] / unit, kind, severity, duration, 1.0, rng)[0] * unit
    return found


def pieces_of(*groups: NoiseWindows) -> list[NoiseWindows]:
    """Returns disjoint windows of each group, as many of each, cut into pieces if there are few."""
    disjoint, window = [each.disjoint for each in groups], groups[0].noise.shape[1]
    number = min(map(len, disjoint))
    pieces = max(1, min(-(-_ENOUGH_PIECES // max(number, 1)), window // _LEAST_PIECE))
    short, found = window // pieces, []
    for each in disjoint:
        some = each.evenly(number)
        cut = (windows[:, : short * pieces].reshape(-1, short, *windows.shape[2:]) for windows in (some.noise, some.clean))
        found.append(NoiseWindows(*cut))
    return found
