"""Evaluates a simulator fitted to a channel: its error, its noise, and detectors trained on its output.

The evaluation uses held-out telemetry if there is any.
"""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.detection import evaluation
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.enhanced_simulator.noise_fitting import MOST_JUDGED, auc_of
from enhsim_tf.enhanced_simulator.report import SEVERITY, ChannelReport
from enhsim_tf.enhancer.baselines import nearest_window_means, ridge_windows
from enhsim_tf.enhancer.training_pairs import cut_pairs, window_errors
from enhsim_tf.noise import real_floor
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts, scattered_starts

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

QUICK = ("limit check", "PCA residual", "nearest neighbours", "isolation forest")  # detectors whose training takes about a second
_NUM_WINDOWS = 1_000  # generated windows for training a detector, and as many others for its threshold
_NUM_COMPARED = 200  # maximum number of real windows for errors and false alarms
_LEAST_NOISE_WINDOW, _NUM_NOISE_WINDOWS = 16, 40  # comparison of noise: minimum window length, and target number of disjoint windows


def report_on(
    simulator: "EnhancedSimulator", learnt: Sequence[Telemetry], held_out: Sequence[Telemetry], is_held_out: bool, seed: int
) -> ChannelReport:
    """Evaluates a simulator on real telemetry.

    Args:
        simulator: The fitted simulator, trained with `follow=True`.
        learnt: Telemetry that the simulator was trained on.
        held_out: Telemetry for the evaluation.
        is_held_out: Whether the evaluation telemetry was held out from training.
        seed: Random seed of the evaluation.

    Returns:
        The report.
    """
    window = simulator.window
    starts = evenly_spaced_starts(held_out, window, _NUM_COMPARED)
    pairs = cut_pairs(held_out, simulator.coarse, starts, window, follow=True)  # aligned without the enhancer
    enhanced = simulator.follow(simulator.pairs(held_out, starts))
    typical = _typical(enhanced, pairs.target)
    generated = simulator.generate(2 * _NUM_WINDOWS, seed=seed + 1)
    extracted = simulator.residual_windows(learnt, _NUM_WINDOWS, np.random.default_rng([seed, 2]))
    noise_sd = float(np.std(extracted, dtype=np.float64))
    noise_window, rows = _compare_noise(simulator, [*learnt, *held_out] if is_held_out else list(learnt), seed)
    starts = evenly_spaced_starts(learnt, window, 2 * _NUM_WINDOWS)
    training = cut_pairs(learnt, simulator.coarse, starts, window, follow=True)
    real = training.target
    trial = evaluation.make_trial(pairs.target, pairs.target, None, noise_sd, seed)
    trial = dataclasses.replace(trial, anomalous={key: value for key, value in trial.anomalous.items() if key[1] == SEVERITY})
    levels = Levels.find(np.concatenate([part.values for part in learnt]))
    quick = {name: DETECTORS[name] for name in QUICK}
    cut = len(real) * 3 // 5  # later real windows set the threshold, with a gap in time, because neighbouring windows overlap
    gap = window * len(real) // max(1, sum(map(len, learnt)))
    with np.errstate(divide="ignore", invalid="ignore"):  # of constant windows, PCA computes shares of a variance of 0, which are not used
        judged = {
            "generated": evaluation.evaluate_arm(generated[:_NUM_WINDOWS], generated[_NUM_WINDOWS:], trial, quick, seed),
            "real": evaluation.evaluate_arm(real[: max(1, cut - gap)], real[cut:], trial, quick, seed),
        }
    recall = {name: {row["kind"]: row["recall"] for row in judged["generated"]["recall"] if row["detector"] == name} for name in QUICK}
    return ChannelReport(
        learnt[0].name,
        window,
        float("nan") if simulator.coarse.is_constant else max(wave.period_s for wave in simulator.coarse.waves),
        is_held_out,
        len(pairs),
        min(len(pairs), sum(len(part) // window for part in held_out)),
        {
            "coarse": _nrmse(pairs.coarse_rescaled, pairs.target),
            "ridge": _nrmse(ridge_windows(training, pairs, simulator.interval_s), pairs.target),
            "nearest": _nrmse(nearest_window_means(training, pairs, simulator.interval_s), pairs.target),
            "enhanced": _nrmse(enhanced, pairs.target),
        },
        rows,
        noise_window,
        {name: evaluation.false_alarm_rates(tables["alarms"]) for name, tables in judged.items()},
        recall,
        noise_sd,
        {
            "coarse": pairs.coarse_rescaled[typical],
            "enhanced": enhanced[typical],
            "real": pairs.target[typical],
            "generated": generated[0],
        },
        learnt[0].unit,
        learnt[0].time_unit,
        {} if levels is None else {"count": levels.count, "step": levels.step},
        simulator.trained.get("ladder", ()),
        simulator.trained["noise"],
        simulator.trained.get("noise_candidates", ()),
        _noise_auc(simulator, learnt, held_out, seed),
        simulator.trained.get("coarse", {}).get("said", ""),
    )


def _noise_auc(simulator: "EnhancedSimulator", learnt: Sequence[Telemetry], held_out: Sequence[Telemetry], seed: int) -> dict[str, float]:
    """Returns the AUC of a classifier of generated, and of learnt, against held-out noise; empty if there are too few windows."""
    real = [simulator.noise_windows(parts, evenly_spaced_starts(parts, simulator.window, MOST_JUDGED)) for parts in (learnt, held_out)]
    rng = np.random.default_rng([seed, 3])
    return auc_of(lambda windows: simulator.add_noise(windows, rng), real[0].clean, *real, seed)


def _nrmse(windows: np.ndarray, target: np.ndarray) -> float:
    """Returns the median error over the windows that are not constant, or NaN if all are constant."""
    errors = window_errors(windows, target)
    return float(np.nanmedian(errors)) if np.isfinite(errors).any() else float("nan")


def _typical(windows: np.ndarray, target: np.ndarray) -> int:
    """Returns the index of the window whose error is nearest to the median."""
    apart = np.abs(window_errors(windows, target) - _nrmse(windows, target))
    return int(np.argmin(np.where(np.isnan(apart), np.inf, apart)))


def _compare_noise(simulator: "EnhancedSimulator", parts: Sequence[Telemetry], seed: int) -> tuple[int, list[dict[str, Any]]]:
    """Compares generated with extracted noise in all measures, in windows short enough that there are many disjoint ones.

    The windows begin at random phases of the signal, as generated windows do. In windows of one phase, errors of the enhancer that
    depend on the phase would make all generated noise look wrong, even whole residual windows drawn again.
    """
    window = simulator.window
    whole = [part for part in parts if len(part) >= window]
    starts, before, rng = [], 0, np.random.default_rng([seed, 4])
    for part in whole:
        starts += list(before + scattered_starts(len(part), window, rng))
        before += len(part) - window + 1
    residual = simulator.noise_windows(whole, np.array(starts)).noise
    pieces = max(1, -(-_NUM_NOISE_WINDOWS // len(residual)))
    short = window // pieces
    if short < _LEAST_NOISE_WINDOW:
        return short, []
    residual = residual[:, : short * pieces].reshape(-1, short)
    half = len(residual) // 2
    if np.count_nonzero(np.ptp(residual, axis=1) > 0) <= len(residual) - half or not np.ptp(residual[:half]) > 0:
        return short, []  # where most windows are constant, measures of noise are not defined
    floor = real_floor.RealFloor(residual[:half], residual[half : 2 * half], num_resplits=40, block=max(1, half // 10), seed=seed)
    clean = simulator.generate_clean(-(-half // pieces), seed=seed)
    generated = simulator.draw_noise(clean, np.random.default_rng(seed))[:, : short * pieces].reshape(-1, short)[:half]
    rows = [dataclasses.asdict(row) for row in floor.evaluate(generated).rows]
    return short, [{key: None if value != value else value for key, value in row.items()} for row in rows]  # NaN is not valid JSON
