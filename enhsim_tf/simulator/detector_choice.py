"""Chooses the detector of a simulator by evidence: false alarms and recall of injected anomalies on held-out nominal time.

A detector keeps its promise if it flags at most three times the share that it is set for, or one and a half of the disjoint held-out windows
where these are few, but never more than a tenth. Of those that do, the ones whose mean recall is within twenty points of the best are equal,
because injected anomalies only stand in for real ones, and the first of them in the order of `CANDIDATES` is chosen. Of several channels, the same
holds for the anomalies of their relation; where no detector is near the best in both, the sum decides. If none keeps its promise, the one with the
fewest false alarms is taken, and the report says so in its first line.

The tenth and the twenty points were set on 2026-11-26, after six SMAP channels had been seen (mean area under the precision-recall curve .74 with
two points and no tenth; .81 of the residual alone).
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.detection import metrics
from enhsim_tf.detection.anomalies import DURATIONS, INJECTIONS, inject
from enhsim_tf.simulator.options import ScoreOptions
from enhsim_tf.simulator.scoring import Scorer
from enhsim_tf.simulator.simulator import EnhancedSimulator

CANDIDATES = ("residual", "PCA residual", "innovation", "largest step", "moving deviation")
RATE = 0.01  # false-alarm rate for which thresholds are set
SEVERITIES = (2.0, 4.0, 8.0)  # of injected anomalies, in standard deviations of the noise
RELATIONS = ("another time", "a delay", "noise of another time")
"""Anomalies of one channel that leave all its values as they are."""
_MOST_TIMES, _FEW = 3.0, 1.5  # multiples of the rate, and windows, that a detector may flag
_MOST = 0.1  # largest share that a detector may flag, however few the windows
_EQUAL = 0.2  # recall within which detectors are equal
_NUM_ANOMALOUS = 60  # windows of each kind and severity
_NUM_GENERATED = 1_000  # windows from which candidates learn
_DELAY = 0.25  # of a window, by which one channel is shifted against the others


@dataclasses.dataclass(frozen=True)
class JudgedDetector:
    """A detector on held-out nominal time."""

    name: str
    false_alarms: float  # share of held-out nominal samples that it flags
    allowed: float  # largest share with which it keeps its promise
    recall: (
        float  # mean over all kinds and severities of injected anomalies, those of relations apart
    )
    by_kind: dict[str, float]  # mean over severities

    @property
    def keeps(self) -> bool:
        """Whether it flags no more of held-out nominal time than it is allowed to."""
        return self.false_alarms <= self.allowed

    def of_relations(self) -> float:
        """Least recall of the anomalies that only the relation of the channels shows; 0 for a single channel."""
        found = [self.by_kind[kind] for kind in RELATIONS if kind in self.by_kind]
        return min(found, default=0.0)


def choose_detector(judged: Sequence[JudgedDetector]) -> JudgedDetector:
    """Returns the detector that the rule chooses; see the module."""
    keeping = [each for each in judged if each.keeps]
    if not keeping:
        return min(judged, key=lambda each: each.false_alarms)
    best, best_relation = (
        max(each.recall for each in keeping),
        max(each.of_relations() for each in keeping),
    )
    near = [
        each
        for each in keeping
        if each.recall >= best - _EQUAL and each.of_relations() >= best_relation - _EQUAL
    ]
    return near[0] if near else max(keeping, key=lambda each: each.recall + each.of_relations())


def judge_detectors(
    simulator: EnhancedSimulator, held_out: Recording, run: Recording | None, seed: int = 0
) -> list[JudgedDetector]:
    """Judges all candidates on nominal telemetry after the fit, in parts of at least a window, and its coarse run, for recorded runs."""
    series = simulator.judged_series(held_out, run)
    windows, clean = simulator.windows_and_signal(held_out, run, 3 * _NUM_ANOMALOUS)
    below = np.zeros_like(clean) if run is None else clean
    some = np.linspace(0, len(windows) - 1, min(_NUM_ANOMALOUS, len(windows))).astype(int)
    unit = np.where(simulator.noise_sd > 0, simulator.noise_sd, simulator.scale)
    anomalous = {
        key: each - below[some]
        for key, each in anomalous_windows(windows[some], unit, seed).items()
    }
    if len(simulator.channels) > 1:
        relations = relation_anomalies(windows, clean, np.random.default_rng([seed, 17]))
        anomalous |= {key: each - below for key, each in relations.items()}
    anomalies = np.concatenate(list(anomalous.values()))
    num_disjoint = sum(len(each) // simulator.window for each in series)
    allowed = min(max(_MOST_TIMES * RATE, _FEW / max(num_disjoint, 1)), _MOST)
    found = []
    for name in CANDIDATES:
        scorer = Scorer(simulator, ScoreOptions(name, _NUM_GENERATED, RATE, seed))
        flags = np.concatenate([scorer.score_series(each) > 1 for each in series])
        # single windows are compared with single nominal windows, whose scores vary more than those of samples
        nominal = scorer.score_windows(windows - below)
        limit = max(float(np.quantile(nominal, 1 - RATE)), scorer.threshold)
        recalls: dict[str, list[float]] = {}
        scores = np.split(
            scorer.score_windows(anomalies),
            np.cumsum([len(each) for each in anomalous.values()])[:-1],
        )
        for (kind, _), some in zip(anomalous, scores, strict=True):
            recalls.setdefault(kind, []).append(metrics.recall(some, limit))
        by_kind = {kind: float(np.mean(each)) for kind, each in recalls.items()}
        recall = float(np.mean([each for kind, each in by_kind.items() if kind not in RELATIONS]))
        found.append(JudgedDetector(name, float(flags.mean()), allowed, recall, by_kind))
    return found


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
                rows, rng = (
                    np.arange(place, len(windows), len(durations)),
                    np.random.default_rng([seed, place]),
                )
                channel = rng.integers(0, windows.shape[2], len(rows))
                unit = noise_sd[channel][:, None]
                windows[rows, :, channel] = (
                    inject(windows[rows, :, channel] / unit, kind, severity, duration, 1.0, rng)[0]
                    * unit
                )
    return found


def relation_anomalies(
    windows: np.ndarray, clean: np.ndarray, rng: np.random.Generator
) -> dict[tuple[str, float], np.ndarray]:
    """Makes anomalies that leave the values of every channel as they are, and change only how the channels move together.

    In each window one channel is that of another time, is shifted by a quarter of a window against the others, or has the noise of another
    time above its enhanced signal. Windows and result are as in `anomalous_windows`; `clean` is the enhanced signal below them.
    """
    number, samples, channels = windows.shape
    rows, channel = np.arange(number), rng.integers(0, channels, number)
    other, late, noise, away = (
        windows.copy(),
        windows.copy(),
        windows.copy(),
        (rows + number // 2) % number,
    )
    other[rows, :, channel] = windows[away, :, channel]
    late[rows, :, channel] = np.roll(windows[rows, :, channel], round(_DELAY * samples), axis=1)
    noise[rows, :, channel] = clean[rows, :, channel] + (windows - clean)[away, :, channel]
    return dict(zip([(kind, 1.0) for kind in RELATIONS], (other, late, noise), strict=True))
