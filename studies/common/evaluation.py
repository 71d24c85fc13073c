"""Evaluation of detectors on real telemetry, as a function of their training data (title and abstract of the paper).

An arm of the experiment is a kind of training data, for example windows of the enhanced simulator. Each detector is trained on
one arm, and its threshold is set on held-out windows of the same arm. If the arm and real telemetry were exchangeable, the
false-alarm rate on real nominal windows would be at most the nominal rate. The excess of the
false-alarm rate over the nominal rate measures the gap between simulation and reality.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.anomalies import DURATIONS, INJECTIONS, SEVERITIES, inject, put_anomalies
from enhsim_tf.detection.interface import Detector
from enhsim_tf.detection.metrics import recall, threshold
from enhsim_tf.telemetry.windows import cut_windows, mean_over_windows
from studies.common.metrics import auc_pr_at_prevalence, auc_roc, recall_at_real_rate, vus_pr

PREVALENCE = 0.02  # share of anomalous windows for which precision is stated


@dataclasses.dataclass(frozen=True)
class Trial:
    """Real telemetry on which all arms are evaluated.

    Args:
        nominal: Real nominal windows without overlaps, in the order of time, on which false alarms are counted.
        reference: Other real nominal windows. Recall at the real rate uses a threshold from their scores.
        anomalous: Maps a kind and a severity to anomalous windows, which `anomalies.inject` made from real nominal windows.
        trace: A continuous trace with anomalies of every kind, or None.
        labels: Boolean array that marks the anomalous samples of the trace, or None.
        rate: Nominal false-alarm rate of the thresholds.
        stride: Number of samples from one scored window of the trace to the next.
        max_buffer: Largest buffer length of VUS-PR in samples, for example a period of the signal.
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
    """Creates a trial by injecting anomalies of every kind and severity into real nominal telemetry.

    The random numbers are independent of the arms. The three durations alternate between windows. All kinds and severities use
    the same windows and positions.

    Args:
        nominal: Real nominal windows, shape `(windows, samples)`, in the order of time.
        reference: Other real nominal windows.
        trace: A continuous real nominal trace, or None.
        noise_sd: Standard deviation of the real noise, which is the unit of severity.
        seed: Seed for the positions.
        num_anomalous: Number of anomalous windows for each kind and severity, evenly spaced over the nominal windows.
        trace_severity: Severity of the anomalies in the trace.
        **settings: Further fields of `Trial`.

    Returns:
        The trial.
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


def inject_into_trace(
    trace: np.ndarray, kind: str, severity: float, duration: int, noise_sd: float, num_ranges: int, gap: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Injects anomalies of one kind into a continuous trace, at positions drawn uniformly from all possible arrangements.

    Args:
        trace: Nominal telemetry, shape `(samples,)`. It is not modified.
        kind: Kind of the anomalies, a key of `anomalies.INJECTIONS`.
        severity: Severity of the anomalies, in units of `noise_sd`.
        duration: Duration of each anomaly, in samples.
        noise_sd: Standard deviation of the noise, in the unit of the telemetry.
        num_ranges: Number of anomalies.
        gap: Minimum number of nominal samples between two anomalies, before the first and after the last.
        rng: Random number generator. Positions are drawn first.

    Returns:
        The float32 trace, and a boolean array that marks the anomalous samples, both of the shape of `trace`.

    Raises:
        InputError: If the anomalies do not fit into the trace.
    """
    free = len(trace) - num_ranges * (duration + gap) - gap
    if free < 0 or num_ranges < 1:
        raise InputError(
            f"Expected at least one anomaly, and a trace of at least {len(trace) - free} samples. "
            f"Received: num_ranges={num_ranges} and {len(trace)} samples."
        )
    steps = np.sort(rng.choice(free + num_ranges, num_ranges, replace=False))  # an arrangement, with each anomaly shrunk to one sample
    begins = gap + steps + np.arange(num_ranges) * (duration + gap - 1)
    rows, columns = np.zeros((num_ranges, 1), int), begins[:, None] + np.arange(duration)
    anomalous, labels = put_anomalies(np.asarray(trace)[None], rows, columns, kind, severity * noise_sd, rng)
    return anomalous[0], labels[0]


def evaluate_arm(
    training: np.ndarray,
    held_out: np.ndarray,
    trial: Trial,
    detectors: Mapping[str, Callable[[int], Detector]],
    seed: int,
    num_blocks: int = 10,
    on_detector: Callable[[int], None] | None = None,
) -> dict[str, list[dict]]:
    """Trains every detector on one arm and evaluates it on real telemetry.

    Args:
        training: Training windows of the arm, shape `(windows, samples)`.
        held_out: Further windows of the arm, on which the threshold is set.
        trial: Real telemetry for the evaluation.
        detectors: Maps a name to a factory, which takes a seed and returns an unfitted detector.
        seed: Seed for the detectors.
        num_blocks: Number of consecutive blocks of time for which false alarms are counted separately.
        on_detector: Called after each detector with the number of completed detectors.

    Returns:
        The rows of three tables: `alarms` (detector, block, alarms, windows), `recall` (detector, kind, severity, recall,
        recall_at_real_rate, auc_roc, auc_pr) and `traces` (detector, vus_pr).
    """
    tables: dict[str, list[dict]] = {"alarms": [], "recall": [], "traces": []}
    for done, (name, make) in enumerate(detectors.items(), 1):
        detector = make(seed).fit(training)
        limit = threshold(detector.score(held_out), trial.rate)
        nominal, reference = detector.score(trial.nominal), detector.score(trial.reference)
        for block, scores in enumerate(np.array_split(nominal, num_blocks)):
            tables["alarms"].append({"detector": name, "block": block, "alarms": int(np.sum(scores > limit)), "windows": len(scores)})
        all_scores = detector.score(np.concatenate(list(trial.anomalous.values())))
        parts = np.split(all_scores, np.cumsum([len(windows) for windows in trial.anomalous.values()])[:-1])
        for (kind, severity), scores in zip(trial.anomalous, parts, strict=True):
            tables["recall"].append(
                {
                    "detector": name,
                    "kind": kind,
                    "severity": severity,
                    "recall": recall(scores, limit),
                    "recall_at_real_rate": recall_at_real_rate(reference, scores, trial.rate),
                    "auc_roc": auc_roc(nominal, scores),
                    "auc_pr": auc_pr_at_prevalence(nominal, scores, PREVALENCE),
                }
            )
        if trial.trace is not None:
            scores = score_trace(detector, trial.trace, training.shape[1], trial.stride)
            tables["traces"].append({"detector": name, "vus_pr": vus_pr(trial.labels, scores, trial.max_buffer)})
        if on_detector is not None:
            on_detector(done)
    return tables


def score_trace(detector: Detector, trace: np.ndarray, window: int, stride: int) -> np.ndarray:
    """Scores each sample of a trace by the mean score of the windows that contain it.

    Args:
        detector: A fitted detector.
        trace: Telemetry of shape `(samples,)`.
        window: Number of samples in a window.
        stride: Number of samples from one window to the next.

    Returns:
        Scores of shape `(samples,)`.

    Raises:
        InputError: If the trace is shorter than a window.
    """
    if len(trace) < window:
        raise InputError(f"Expected a trace of at least a window of {window} samples. Received: {len(trace)} samples.")
    begins = np.unique(np.append(np.arange(0, len(trace) - window + 1, stride), len(trace) - window))
    return mean_over_windows(detector.score(cut_windows(trace, begins, window)), begins, window, len(trace))


def false_alarm_rates(rows: Sequence[Mapping]) -> dict[str, float]:
    """Computes the false-alarm rate of each detector.

    Args:
        rows: Rows of the table `alarms`, see `evaluate_arm`.

    Returns:
        A dictionary from the name of a detector to its false-alarm rate.
    """
    names = dict.fromkeys(row["detector"] for row in rows)
    return {
        name: sum(row["alarms"] for row in rows if row["detector"] == name) / sum(row["windows"] for row in rows if row["detector"] == name)
        for name in names
    }
