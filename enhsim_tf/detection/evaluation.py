"""The experiment that the paper's title asks for: does what detectors were trained on make them robust on real telemetry?

Arms (what detectors are trained on), detectors and anomalies are given; out come tables. Every detector sets its threshold
on held-out windows of its own arm. If arm and reality were exchangeable, it would alarm on real nominal windows at the rate
it was set for: what it alarms above that is the gap between simulation and reality, and no other choice can hide it.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics as detection
from enhsim_tf.detection.anomalies import DURATIONS, INJECTIONS, SEVERITIES, inject, inject_into_trace
from enhsim_tf.detection.interface import Detector
from enhsim_tf.telemetry.windows import cut_windows

PREVALENCE = 0.02  # share of anomalous windows that precision is stated for


@dataclasses.dataclass(frozen=True)
class Trial:
    """The real side of the experiment, the same for all arms.

    Args:
        nominal: Real nominal windows that share no sample, in the order of time; false alarms are counted on them.
        reference: Other real nominal windows, whose scores set the threshold for recall at the real rate.
        anomalous: From a kind and a severity to windows, made of real nominal ones by `injections.inject`.
        trace: A continuous trace with anomalies of every kind, or None.
        labels: Which samples of the trace are anomalous.
        rate: False-alarm rate that thresholds are set for.
        stride: Samples from one scored window of the trace to the next.
        max_buffer: Largest buffer of VUS-PR in samples, for example a period of the signal.
    """

    nominal: np.ndarray
    reference: np.ndarray
    anomalous: Mapping[tuple[str, float], np.ndarray]
    trace: np.ndarray | None = None
    labels: np.ndarray | None = None
    rate: float = 0.01
    stride: int = 25
    max_buffer: int = 120


def make_trial(
    nominal: np.ndarray,
    reference: np.ndarray,
    trace: np.ndarray | None,
    noise_sd: float,
    seed: int,
    num_anomalous: int = 150,
    trace_severity: float = 4.0,
    **settings: float,
) -> Trial:
    """Puts anomalies of every kind and severity into real nominal telemetry, with draws that know no arm.

    Each window takes one of the three durations in turn; the same windows and places serve every kind and severity.

    Args:
        nominal: Real nominal windows, shape `(windows, samples)`, in the order of time.
        reference: Other real nominal windows.
        trace: A continuous real nominal trace, or None.
        noise_sd: Standard deviation of the real noise: the unit of severity.
        seed: Seed of the places.
        num_anomalous: Anomalous windows of each kind and severity, spread evenly over the nominal ones.
        trace_severity: Severity of the anomalies in the trace.
        **settings: Further fields of `Trial`.
    """
    chosen = nominal[np.linspace(0, len(nominal) - 1, min(num_anomalous, len(nominal))).astype(int)]
    durations = [min(duration, nominal.shape[1]) for duration in DURATIONS]
    anomalous = {}
    for kind in INJECTIONS:
        for severity in SEVERITIES:
            parts = [
                inject(chosen[number :: len(durations)], kind, severity, duration, noise_sd, np.random.default_rng([seed, number]))[0]
                for number, duration in enumerate(durations)
            ]
            anomalous[kind, severity] = np.concatenate(parts)
    labels = None
    if trace is not None:
        stretches, marks = [], []
        for number, (kind, stretch) in enumerate(zip(INJECTIONS, np.array_split(trace, len(INJECTIONS)), strict=True)):
            duration = min(DURATIONS[1], len(stretch) // 6)
            rng = np.random.default_rng([seed, 100 + number])
            changed, mark = inject_into_trace(stretch, kind, trace_severity, duration, noise_sd, 2, duration, rng)
            stretches.append(changed)
            marks.append(mark)
        trace, labels = np.concatenate(stretches), np.concatenate(marks)
    return Trial(nominal, reference, anomalous, trace, labels, **settings)


def evaluate_arm(
    training: np.ndarray,
    held_out: np.ndarray,
    trial: Trial,
    detectors: Mapping[str, Callable[[int], Detector]],
    seed: int,
    num_blocks: int = 10,
    on_detector: Callable[[int], None] | None = None,
) -> dict[str, list[dict]]:
    """Trains every detector on one arm and judges it on real telemetry.

    Args:
        training: Windows of the arm to learn from, shape `(windows, samples)`.
        held_out: Further windows of the arm, which set the threshold.
        trial: The real side.
        detectors: From a name to what makes the untrained detector from a seed.
        seed: Seed of the detectors.
        num_blocks: Consecutive blocks of time that false alarms are counted in.
        on_detector: Called after each detector with how many are done.

    Returns:
        Rows of three tables: `alarms` (detector, block, alarms, windows), `recall` (detector, kind, severity, recall,
        recall_at_real_rate, auc_roc, auc_pr) and `traces` (detector, vus_pr).
    """
    tables: dict[str, list[dict]] = {"alarms": [], "recall": [], "traces": []}
    for done, (name, make) in enumerate(detectors.items(), 1):
        detector = make(seed).fit(training)
        threshold = detection.threshold(detector.score(held_out), trial.rate)
        nominal, reference = detector.score(trial.nominal), detector.score(trial.reference)
        for block, scores in enumerate(np.array_split(nominal, num_blocks)):
            tables["alarms"].append({"detector": name, "block": block, "alarms": int(np.sum(scores > threshold)), "windows": len(scores)})
        all_scores = detector.score(np.concatenate(list(trial.anomalous.values())))
        parts = np.split(all_scores, np.cumsum([len(windows) for windows in trial.anomalous.values()])[:-1])
        for (kind, severity), scores in zip(trial.anomalous, parts, strict=True):
            tables["recall"].append(
                {
                    "detector": name,
                    "kind": kind,
                    "severity": severity,
                    "recall": detection.recall(scores, threshold),
                    "recall_at_real_rate": detection.recall_at_real_rate(reference, scores, trial.rate),
                    "auc_roc": detection.auc_roc(nominal, scores),
                    "auc_pr": detection.auc_pr_at_prevalence(nominal, scores, PREVALENCE),
                }
            )
        if trial.trace is not None:
            scores = score_trace(detector, trial.trace, training.shape[1], trial.stride)
            tables["traces"].append({"detector": name, "vus_pr": detection.vus_pr(trial.labels, scores, trial.max_buffer)})
        if on_detector is not None:
            on_detector(done)
    return tables


def score_trace(detector: Detector, trace: np.ndarray, window: int, stride: int) -> np.ndarray:
    """A score for each sample: the mean score of the windows that it lies in.

    Args:
        detector: A fitted detector.
        trace: Telemetry of shape `(samples,)`, at least a window long.
        window: Samples of a window.
        stride: Samples from one window to the next.

    Returns:
        Scores of shape `(samples,)`.

    Raises:
        InputError: If the trace is shorter than a window.
    """
    if len(trace) < window:
        raise InputError(f"Expected a trace of at least a window of {window} samples. Received: {len(trace)} samples.")
    begins = np.unique(np.append(np.arange(0, len(trace) - window + 1, stride), len(trace) - window))
    return mean_over_windows(detector.score(cut_windows(trace, begins, window)), begins, window, len(trace))


def mean_over_windows(scores: np.ndarray, begins: np.ndarray, window: int, num_samples: int) -> np.ndarray:
    """A score for each sample: the mean over the windows that it lies in; samples behind the last window take its score.

    Args:
        scores: Score of each window, shape `(windows,)`.
        begins: First sample of each, rising from 0 in steps of a window at most.
        window: Samples of a window.
        num_samples: Length of the series.

    Returns:
        Scores of shape `(num_samples,)`.
    """
    steps = np.zeros((2, num_samples + 1))
    for sign, places in ((1, begins), (-1, begins + window)):
        np.add.at(steps[0], places, sign * scores)
        np.add.at(steps[1], places, sign)
    end = begins[-1] + window
    total, number = np.cumsum(steps[:, :end], axis=1)
    return np.append(total / number, np.full(num_samples - end, scores[-1]))


def mix_real_and_simulated(simulated: np.ndarray, real: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Windows of which a share is real: the mixing curve's arms (Jaufmann et al.).

    Args:
        simulated: Simulated windows.
        real: As many real ones.
        share: Share that is real, from 0 to 1.
        rng: Owner of the order.
    """
    if not 0 <= share <= 1 or len(simulated) != len(real):
        raise InputError(f"Expected a share from 0 to 1 and as many windows of both. Received: {share}, {len(simulated)} and {len(real)}.")
    num_real = round(share * len(real))
    return rng.permutation(np.concatenate([real[:num_real], simulated[num_real:]]))


def false_alarm_rates(rows: Sequence[Mapping]) -> dict[str, float]:
    """False-alarm rate of each detector, from the rows of `alarms`."""
    names = dict.fromkeys(row["detector"] for row in rows)
    return {
        name: sum(row["alarms"] for row in rows if row["detector"] == name) / sum(row["windows"] for row in rows if row["detector"] == name)
        for name in names
    }
