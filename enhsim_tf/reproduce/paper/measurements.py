"""Measurements for the claims: measures of networks and windows, each returned as a dictionary of numbers and arrays."""

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.detection import metrics
from enhsim_tf.detection.autoencoders import DenseAutoencoder
from enhsim_tf.detection.detectors import IsolationForestOnFeatures, PCAResidual
from enhsim_tf.enhancer.ridge import choose_num_neighbours, fit_ridge, nearest_windows
from enhsim_tf.realism import measures as fidelity
from enhsim_tf.realism.two_sample import two_sample_auc
from enhsim_tf.reproduce.settings import DetectorSettings

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator


def enhancement(enhance: Callable, train: Mapping, test: Mapping) -> dict[str, float]:
    """Error of the enhancer and of its baselines with respect to the truth, on training data and on held-out data.

    Args:
        enhance: From coarse to enhanced windows.
        train: `coarse`, `target` and `truth` windows of the training part, and their first samples as `start`. The baselines
            learn from the same windows as the enhancer.
        test: The same of the held-out part.
    """
    learnt = train["coarse"], train["target"], train["start"]
    ridge, num_neighbours = fit_ridge(*learnt), choose_num_neighbours(*learnt)
    nearest = nearest_windows(*learnt[:2], test["coarse"], num_neighbours)
    enhanced = enhance(test["coarse"])
    seen = {window.tobytes() for window in train["coarse"]}
    return {
        "train_nrmse": fidelity.nrmse(enhance(train["coarse"]), train["truth"]),
        "nrmse": fidelity.nrmse(enhanced, test["truth"]),
        "identity_nrmse": fidelity.nrmse(test["coarse"], test["truth"]),
        "ridge_nrmse": fidelity.nrmse(ridge.predict(test["coarse"]), test["truth"]),
        "ridge_penalty": ridge.penalty,
        "ridge_penalty_at_edge": float(ridge.is_at_edge),
        "nearest_nrmse": fidelity.nrmse(nearest, test["truth"]),
        "num_neighbours": float(num_neighbours),
        "roughness": fidelity.roughness(enhanced),
        "truth_roughness": fidelity.roughness(test["truth"]),
        "target_roughness": fidelity.roughness(test["target"]),
        "coarse_roughness": fidelity.roughness(test["coarse"]),
        "distinct_coarse_windows": float(len(seen)),
        "test_windows_seen": float(np.mean([window.tobytes() in seen for window in test["coarse"]])),
    }


def resemblance(
    generated: np.ndarray, real: np.ndarray, real_again: np.ndarray, seed: int, on_comparison: Callable[[int], None] = lambda done: None
) -> dict[str, float]:
    """Similarity of generated and real windows; each measure is returned together with its real-vs-real baseline.

    Args:
        generated: Generated windows.
        real: As many held-out real windows.
        real_again: At least as many other real windows: what the floor compares with `real`.
        seed: Seed of the two-sample classifier's folds.
        on_comparison: Called after each of the two comparisons with how many are done.
    """
    measures = {}
    for done, (name, other) in enumerate((("", generated), ("floor_", real_again[: len(real)])), 1):
        lag_one = fidelity.autocorrelation(other, 1)[1] - fidelity.autocorrelation(real, 1)[1]
        measures |= {
            f"{name}scale_difference": fidelity.scale_difference(other, real),
            f"{name}lag_one_difference": float(abs(lag_one)),
            f"{name}marginal_distance": fidelity.marginal_distance(other, real),
            f"{name}rank_ratio": fidelity.effective_rank(other) / fidelity.effective_rank(real),
            f"{name}roughness_ratio": fidelity.roughness(other) / fidelity.roughness(real),
            f"{name}classifier_auc": two_sample_auc(other, real, seed),
        }
        on_comparison(done)
    ranks = {"rank": fidelity.effective_rank(generated), "real_rank": fidelity.effective_rank(real)}
    return measures | ranks | {"num_windows": float(len(real))}


def speed(simulator: "EnhancedSimulator", num_windows: int, repeats: int = 5) -> dict[str, float]:
    """Seconds of telemetry generated per second of computation, for the coarse simulator and the whole pipeline; medians over repeats.

    Args:
        simulator: The enhanced simulator.
        num_windows: Windows generated at a time.
        repeats: Number of repeats.
    """
    seconds = {"coarse": [], "generate": []}
    simulator.generate(num_windows, seed=0)  # the first call traces the networks, and is not timed
    for repeat in range(repeats):
        for name, work in (("coarse", simulator.generate_coarse), ("generate", simulator.generate)):
            began = time.perf_counter()
            work(num_windows, seed=repeat)
            seconds[name].append(time.perf_counter() - began)
    telemetry_s = num_windows * simulator.window * simulator.interval_s
    rates = {f"{name}_rate": telemetry_s / float(np.median(values)) for name, values in seconds.items()}
    return rates | {"cost_ratio": rates["coarse_rate"] / rates["generate_rate"]}


def false_alarms(
    arms: Mapping, test: np.ndarray, degraded: Mapping, settings: DetectorSettings, seed: int, progress: Progress = SILENT
) -> dict[str, np.ndarray]:
    """False-alarm rate and recall of detectors trained on each arm. Thresholds are set on held-out windows of the arm.

    Args:
        arms: From the name of an arm to its `(training, threshold)` windows.
        test: Disjoint real nominal windows.
        degraded: From a degraded mode to real degraded windows.
        settings: The detectors' settings.
        seed: Seed of the detectors.
        progress: Tells how many arms are done.

    Returns:
        Arrays `false_alarm_rate` and `recall` (mean over the modes) of shape `(arms, detectors)`, and the names
        `arms`, `detectors`.
    """
    rate, found, told = [], [], progress.loop("arm", len(arms))
    for number, (training, threshold_windows) in enumerate(arms.values()):
        detectors = make_detectors(settings, seed)
        for done, detector in enumerate(detectors.values(), 1):
            threshold = metrics.threshold(detector.fit(training).score(threshold_windows), settings.false_alarm_rate)
            rate.append(np.mean(detector.score(test) > threshold))
            found.append(np.mean([np.mean(detector.score(windows) > threshold) for windows in degraded.values()]))
            told(number + done / len(detectors))
    shape = (len(arms), len(detectors))
    return {
        "false_alarm_rate": np.reshape(rate, shape),
        "recall": np.reshape(found, shape),
        "arms": np.array(list(arms)),
        "detectors": np.array(list(detectors)),
        "num_test_windows": np.array(len(test)),
    }


def make_detectors(settings: DetectorSettings, seed: int) -> dict:
    """The untrained detectors of claims C3 and C8, by name."""
    return {
        "PCA residual": PCAResidual(settings.num_components, seed=seed),
        "isolation forest": IsolationForestOnFeatures(settings.num_trees, seed=seed),
        "dense autoencoder": DenseAutoencoder(epochs=settings.autoencoder_epochs, seed=seed),
    }


def degraded_error(enhance: Callable, coarse: Callable, truth: Callable, modes: list[str], severity: float) -> dict[str, np.ndarray]:
    """Error of the enhanced signal in each degraded mode, if the true degraded signal is known.

    Args:
        enhance: From coarse to enhanced windows.
        coarse: From a scenario to coarse windows.
        truth: From a scenario to true windows of the same times and draws.
        modes: Degraded modes.
        severity: Severity of each.

    Returns:
        `modes`, `nrmse` and `identity_nrmse` (the coarse signal taken as it is), the nominal mode first.
    """
    scenarios = {"nominal": None} | {mode: Degraded(mode, severity) for mode in modes}
    errors = [
        (fidelity.nrmse(enhance(coarse(scenario)), truth(scenario)), fidelity.nrmse(coarse(scenario), truth(scenario)))
        for scenario in scenarios.values()
    ]
    enhanced, identity = np.array(errors).T
    return {"modes": np.array(list(scenarios)), "nrmse": enhanced, "identity_nrmse": identity}
