"""What a simulator fitted to a channel is worth: its error, its noise, and what detectors trained on it say of real windows.

Everything is measured on telemetry that the simulator has not seen, where there is any.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf import realism, robustness
from enhsim_tf.detectors import DETECTORS
from enhsim_tf.pairs import at_level, cut_pairs, cut_parts, even_places
from enhsim_tf.telemetry import Telemetry

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator import EnhancedSimulator

QUICK = ("limit check", "PCA residual", "nearest neighbours", "isolation forest")  # detectors that train in a second
NOTICED, MISSED = 0.8, 0.2  # shares of anomalies that count as found and as missed
SEVERITY = 4.0  # standard deviations of the noise, of the anomalies that the verdict speaks of
_NUM_WINDOWS = 1_000  # generated windows that a detector learns from; as many set its threshold
_NUM_COMPARED = 200  # windows that errors and alarms are measured on, at most
_RATE = 0.01
_LEAST_NOISE_WINDOW, _NUM_NOISE_WINDOWS = 16, 40  # of the comparison of noises, which needs windows that share no sample
_SUSPICIOUS = 2.0  # times its floor: from there on a measure tells generated noise from real


@dataclasses.dataclass(frozen=True)
class ChannelReport:
    """The report on a fitted simulator.

    Args:
        channel: Name of the channel.
        window: Samples of a window.
        period_s: Period of the coarse simulator, in seconds (in samples where the channel has no time).
        is_held_out: Whether it was measured on telemetry that the simulator has not seen.
        num_windows: Real windows behind the errors and alarms; they overlap.
        num_disjoint: How many of them share no sample: the honest size of the sample.
        nrmse: Median error over windows, in units of each window's standard deviation: `coarse`, `ridge`, `enhanced`.
        noise: Rows of `realism.Row` as dictionaries, generated against extracted noise; empty where telemetry is too short.
        noise_window: Samples of the windows that noises were compared in.
        false_alarms: Share of real windows that each detector alarms on, by what it was trained on: `generated`, `real`.
        recall: Share of anomalies of `SEVERITY` that each detector trained on generated windows finds, by kind.
        noise_sd: Standard deviation of the extracted noise, in the telemetry's unit.
        examples: Windows for the figure: `coarse`, `enhanced`, `generated` and `real`.
    """

    channel: str
    window: int
    period_s: float
    is_held_out: bool
    num_windows: int
    num_disjoint: int
    nrmse: Mapping[str, float]
    noise: Sequence[Mapping[str, Any]]
    noise_window: int
    false_alarms: Mapping[str, Mapping[str, float]]
    recall: Mapping[str, Mapping[str, float]]
    noise_sd: float
    examples: Mapping[str, np.ndarray]

    def to_dict(self) -> dict[str, Any]:
        """Everything but the examples, in plain JSON types."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name not in ("examples", "noise")} | {
            "noise": [dict(row) for row in self.noise],
            "verdict": self.verdict,
        }

    @property
    def verdict(self) -> list[str]:
        """What a detector trained on this would and would not notice, in plain sentences."""
        where = "telemetry it has not seen" if self.is_held_out else "the telemetry it learnt from (none was held out)"
        error = self.nrmse["enhanced"]
        best = min(("coarse", "ridge"), key=lambda name: self.nrmse[name])
        said = [
            f"Signal: NRMSE {error:.3f} on {where}; the coarse simulator {self.nrmse['coarse']:.3f}, ridge regression "
            f"{self.nrmse['ridge']:.3f}. "
            + ("The enhancer earns its place." if error < self.nrmse[best] else f"The enhancer is no better than {best}.")
        ]
        told = [row["measure"] for row in self.noise if row["ratio"] > _SUSPICIOUS]
        if not self.noise:
            said.append("Noise: the telemetry is too short to compare its noise with generated noise.")
        elif told:
            said.append(f"Noise: of {len(self.noise)} measures these tell generated from extracted noise: {', '.join(told)}.")
        else:
            said.append(f"Noise: none of {len(self.noise)} measures tells generated from extracted noise.")
        alarms = self.false_alarms["generated"]
        said.append(
            f"False alarms, set for {_RATE:.0%}, on {self.num_disjoint} windows that share no sample ({self.num_windows} that overlap): "
            + ", ".join(
                f"{name} {rate:.0%} (trained on real telemetry {self.false_alarms['real'][name]:.0%})" for name, rate in alarms.items()
            )
            + "."
        )
        best_of = {kind: max(rates, key=rates.get) for kind, rates in _by_kind(self.recall).items()}
        found = {kind: self.recall[name][kind] for kind, name in best_of.items()}
        noticed = [f"{kind.replace('_', ' ')} ({best_of[kind]})" for kind, rate in found.items() if rate >= NOTICED]
        missed = [kind.replace("_", " ") for kind, rate in found.items() if rate <= MISSED]
        said.append(
            f"Anomalies of {SEVERITY:g} standard deviations of the noise: a detector trained on this notices "
            f"{', '.join(noticed) or 'none of the kinds tried'}; it does not notice {', '.join(missed) or 'less than a fifth of none'}."
        )
        return said

    def lines(self) -> list[str]:
        """The report in plain words."""
        where = f"{self.num_windows} windows held out" if self.is_held_out else "the telemetry it learnt from"
        return [f"{self.channel}: windows of {self.window} samples, period {self.period_s:g}; measured on {where}", *self.verdict]


def _by_kind(recall: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    kinds = next(iter(recall.values()))
    return {kind: {name: rates[kind] for name, rates in recall.items()} for kind in kinds}


def report_on(
    simulator: "EnhancedSimulator", learnt: Sequence[Telemetry], held_out: Sequence[Telemetry], is_held_out: bool, seed: int
) -> ChannelReport:
    """Measures a simulator on real telemetry.

    Args:
        simulator: The fitted simulator, which follows the telemetry.
        learnt: What it learnt from.
        held_out: What it is measured on.
        is_held_out: Whether that is something else.
        seed: Seed of everything drawn.
    """
    window = simulator.window
    pairs = cut_pairs(held_out, simulator.coarse, even_places(held_out, window, _NUM_COMPARED), window, follow=True)
    enhanced = simulator.follow(pairs)
    generated = simulator.generate(2 * _NUM_WINDOWS, seed=seed + 1)
    extracted = simulator.residual_windows(learnt, _NUM_WINDOWS, np.random.default_rng([seed, 2]))
    noise_sd = float(np.std(extracted, dtype=np.float64))
    noise_window, rows = _compare_noise(simulator, [*learnt, *held_out] if is_held_out else list(learnt), seed)
    real = cut_parts(learnt, even_places(learnt, window, 2 * _NUM_WINDOWS), window)[0]
    trial = robustness.make_trial(pairs.target, pairs.target, None, noise_sd, seed)
    trial = dataclasses.replace(trial, anomalous={key: value for key, value in trial.anomalous.items() if key[1] == SEVERITY})
    quick = {name: DETECTORS[name] for name in QUICK}
    cut = len(real) * 3 // 5  # of real windows the later ones set the threshold: neighbours overlap
    gap = window * len(real) // max(1, sum(map(len, learnt)))
    judged = {
        "generated": robustness.judge_arm(generated[:_NUM_WINDOWS], generated[_NUM_WINDOWS:], trial, quick, seed),
        "real": robustness.judge_arm(real[: max(1, cut - gap)], real[cut:], trial, quick, seed),
    }
    recall = {name: {row["kind"]: row["recall"] for row in judged["generated"]["recall"] if row["detector"] == name} for name in QUICK}
    return ChannelReport(
        learnt[0].name,
        window,
        max(wave.period_s for wave in simulator.coarse.waves),
        is_held_out,
        len(pairs),
        sum(len(part) // window for part in held_out),
        {
            "coarse": _nrmse(pairs.coarse_at_level, pairs.target),
            "ridge": _nrmse(_ridge(simulator, learnt, pairs), pairs.target),
            "enhanced": _nrmse(enhanced, pairs.target),
        },
        rows,
        noise_window,
        {name: robustness.summary(tables["alarms"]) for name, tables in judged.items()},
        recall,
        noise_sd,
        {"coarse": pairs.coarse_at_level[0], "enhanced": enhanced[0], "real": pairs.target[0], "generated": generated[0]},
    )


def _nrmse(windows: np.ndarray, target: np.ndarray) -> float:
    """Median over windows of the error in units of the window's own standard deviation; flat windows say nothing."""
    deviation = target.std(axis=1, dtype=np.float64)
    error = np.sqrt(np.mean((windows - target) ** 2, axis=1, dtype=np.float64))
    moves = deviation > 0
    return float(np.median(error[moves] / deviation[moves])) if moves.any() else float("nan")


def _ridge(simulator: "EnhancedSimulator", learnt: Sequence[Telemetry], pairs: Any) -> np.ndarray:
    """Ridge regression from the same coarse windows to the same targets, at the level of each window."""
    from sklearn.linear_model import Ridge

    places = even_places(learnt, simulator.window, 2 * _NUM_WINDOWS)
    training = cut_pairs(learnt, simulator.coarse, places, simulator.window, follow=True).clear()
    ridge = Ridge().fit(training.coarse, training.target_in_unit)
    return at_level(ridge.predict(pairs.coarse).astype(np.float32), pairs.shift, pairs.gain)


def _compare_noise(simulator: "EnhancedSimulator", parts: Sequence[Telemetry], seed: int) -> tuple[int, list[dict[str, Any]]]:
    """Rows of every fidelity measure, generated against extracted noise, in windows short enough that many share no sample."""
    window = simulator.window
    whole = [part for part in parts if len(part) >= window]
    places, before = [], 0
    for part in whole:
        places += list(before + np.arange(0, len(part) - window + 1, window))
        before += len(part) - window + 1
    pairs = cut_pairs(whole, simulator.coarse, np.array(places), window, follow=True)
    residual = pairs.target - simulator.follow(pairs)
    pieces = max(1, -(-_NUM_NOISE_WINDOWS // len(residual)))
    short = window // pieces
    if short < _LEAST_NOISE_WINDOW:
        return short, []
    residual = residual[:, : short * pieces].reshape(-1, short)
    half = len(residual) // 2
    floor = realism.RealFloor(residual[:half], residual[half : 2 * half], num_resplits=40, block=max(1, half // 10), seed=seed)
    generated = simulator.noise.generate(-(-half // pieces), seed)[:, : short * pieces].reshape(-1, short)[:half]
    rows = [dataclasses.asdict(row) for row in floor.judge(generated).rows]
    return short, [{key: None if value != value else value for key, value in row.items()} for row in rows]  # NaN is no JSON
