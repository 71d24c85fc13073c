"""The report on a fitted simulator: numbers for `report.json`, and the lines that `fit` prints."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import printable, spoken
from enhsim_tf.enhancer.candidates import Choice
from enhsim_tf.enhancer.names import COARSE
from enhsim_tf.simulator.detector_choice import RATE, RELATIONS, JudgedDetector
from enhsim_tf.simulator.joint import cut
from enhsim_tf.simulator.noise_choice import TOLD_APART
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.trusted_range import TrustedRange
from enhsim_tf.telemetry.windows import evenly_spaced_starts

_NUM_WINDOWS = 500  # windows on which errors and noise are measured
_FLOORS = 3.0  # cross-correlations further apart than this multiple of the floor are said to differ


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """The report on a fitted simulator.

    Args:
        channels: Names of the channels.
        window: Length of a window in samples.
        is_held_out: Whether the telemetry of the measurements was held out from the fit.
        num_samples: Number of its samples.
        coarse: Which coarse simulator was used and why.
        notes: What else is to be said.
        enhancers: For each enhancer that was judged, its `name`, `error` (NRMSE), `standard_error` and `is_chosen`.
        nrmse: For each channel, the root-mean-square error of `coarse` and `enhanced` divided by the standard deviation of the telemetry.
        noise_model: Name of the noise model.
        noise_candidates: Rows of `noise_choice.choose_noise`; empty if the model was asked for, or there was too little to judge on.
        noise: For each channel, standard deviation (`sd`) and lag-1 correlation (`lag_1`) of `real` and `generated` noise.
        cross_correlation: For several channels, the largest difference between correlations of generated and real noise (`apart`), the same
            between two halves of the real noise (`floor`), and the pair of channels.
        detectors: Each detector on held-out time, see `detector_choice.JudgedDetector`.
        detector: The one that `score` uses.
        keeps_promise: Whether it flags no more of held-out nominal time than it may.
        outside: For recorded runs, the share of that time outside the training range of the coarse columns; otherwise None.
        examples: Windows for the figure: `coarse`, `enhanced`, `generated` and `real`, each of shape `(samples, channels)`.
    """

    channels: tuple[str, ...]
    window: int
    is_held_out: bool
    num_samples: int
    coarse: str
    notes: tuple[str, ...]
    enhancers: tuple[Mapping[str, Any], ...]
    nrmse: Mapping[str, Mapping[str, float]]
    noise_model: str
    noise_candidates: tuple[Mapping[str, Any], ...]
    noise: Mapping[str, Mapping[str, Mapping[str, float]]]
    cross_correlation: Mapping[str, Any]
    detectors: tuple[Mapping[str, Any], ...]
    detector: str
    keeps_promise: bool
    outside: float | None
    examples: Mapping[str, np.ndarray]

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields except the examples, in plain JSON types."""
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "examples"}
        return plain | {name: list(plain[name]) for name in ("channels", "notes", "enhancers", "noise_candidates", "detectors")}

    def lines(self) -> list[str]:
        """Returns the report as lines of text: the warning, if there is one, comes first."""
        name = spoken(self.channels)
        where = "held-out time" if self.is_held_out else "the telemetry of the fit (none was held out)"
        chosen = next(each for each in self.detectors if each["name"] == self.detector)
        rates = "; ".join(f"{each['name']} {each['false_alarms']:.1%} and {each['recall']:.0%}{_relation(each)}" for each in self.detectors)
        found = [
            *self._warnings(chosen),
            self.coarse,
            f"windows of {self.window} samples; measured on {self.num_samples:,} samples of {where}",
            *self.notes,
            self._of_enhancers(),
            *self._of_signals(),
            self._of_noise(),
            *self._of_cross_correlation(),
            f"detectors there, set for {RATE:.0%} (false alarms, and recall of injected anomalies): {rates}. score uses: {self.detector}",
        ]
        if self.outside is not None:
            found.append(f"range: {self.outside:.1%} of that time are outside the training range of the coarse columns")
        return [f"{name}: {printable(line)}" for line in found if line]

    def _warnings(self, chosen: Mapping[str, Any]) -> list[str]:
        found = []
        if not self.keeps_promise:
            found.append(
                f"WARNING: no detector keeps its promise; the best, {chosen['name']}, flags {chosen['false_alarms']:.0%} of nominal telemetry at "
                f"{RATE:.0%} set. Do not trust its alarms"
            )
        used = next((each for each in self.noise_candidates if each["is_chosen"]), None)
        if used is not None and (used["auc"] or 0) > TOLD_APART:
            found.append(
                f"WARNING: a classifier tells generated noise from real (AUC {used['auc']:.2f}; real from real {used['real_auc']:.2f})"
            )
        return found

    def _of_enhancers(self) -> str:
        errors = ", ".join(f"{each['name']} {each['error']:.3f} ± {each['standard_error']:.3f}" for each in self.enhancers)
        (used,) = [each["name"] for each in self.enhancers if each["is_chosen"]]
        return f"enhancers, error on held-out blocks of the training time (NRMSE): {errors}. Used: {used}"

    def _of_signals(self) -> list[str]:
        if len(self.channels) == 1:
            errors = self.nrmse[self.channels[0]]
            return [
                f"signal: error {errors['enhanced']:.3f} of the enhanced signal, {errors['coarse']:.3f} of the coarse one (NRMSE, with the noise)"
            ]
        said = ", ".join(f"{name} {each['enhanced']:.3f} ({each['coarse']:.3f})" for name, each in self.nrmse.items())
        return [f"signals: error of the enhanced (and of the coarse) signal, NRMSE, with the noise: {said}"]

    def _of_noise(self) -> str:
        judged = "; ".join(f"{each['name']} {_auc(each)}, {each['alarms']:.1%} and {each['recall']:.0%}" for each in self.noise_candidates)
        if not judged:
            return f"noise: {self.noise_model}"
        used = next(each for each in self.noise_candidates if each["is_chosen"])
        real = f"real {used['real_auc']:.2f}, {used['real_alarms']:.1%} and {used['real_recall']:.0%}"
        why = "the simplest that passes" if used["passes"] else "none passes, and it departs least"
        return (
            f"noise on held-out time (AUC of a classifier against real noise; false alarms and recall of two detectors): {judged}; {real}. "
            f"Used: {self.noise_model}, {why if used['name'] == self.noise_model else 'because held-out time contradicts the other'}"
        )

    def _of_cross_correlation(self) -> list[str]:
        if not self.cross_correlation:
            return []
        apart, floor = self.cross_correlation["apart"], self.cross_correlation["floor"]
        where = " and ".join(self.cross_correlation["pair"])
        fails = f"; joint noise fails between {where}" if apart > _FLOORS * floor else ""
        return [
            f"cross-correlation of the noise: at most {apart:.3f} apart from the real one ({where}); two halves of the real one {floor:.3f}{fails}"
        ]


def make_report(
    simulator: EnhancedSimulator,
    choice: Choice,
    noise_rows: Sequence[Mapping[str, Any]],
    detectors: Sequence[JudgedDetector],
    learnt: Recording,
    judged: Recording,
    runs: tuple[Recording | None, Recording | None],
    is_held_out: bool,
    coarse: str,
    notes: Sequence[str],
    seed: int,
) -> Report:
    """Measures a fitted simulator.

    Args:
        simulator: The simulator, with noise and detector.
        choice: The judged enhancers.
        noise_rows: The judged noise models.
        detectors: The judged detectors.
        learnt: Telemetry of the fit.
        judged: Telemetry on which it is measured, in parts of at least a window.
        runs: The coarse runs of both, for recorded runs.
        is_held_out: Whether `judged` was held out.
        coarse: Which coarse simulator was used and why.
        notes: What else is to be said.
        seed: Random seed of what is generated.
    """
    series, window = [part.values for part in judged.parts], simulator.window
    starts = evenly_spaced_starts(series, window, _NUM_WINDOWS)
    real = cut(series, starts, window)
    if runs[1] is None:
        aligned = simulator.alignment.align(real)
        clean = simulator.enhance(*aligned)
        plain = aligned.shift[:, None] + aligned.gain[:, None] * aligned.coarse
        outside = None
    else:
        coarse_series = [part.values for part in runs[1].parts]
        clean = cut([simulator.enhance_run(each) for each in coarse_series], starts, window)
        plain = _coarse_prediction(choice, cut(coarse_series, starts, window), real)
        trusted = TrustedRange(simulator)
        outside = float(np.mean(np.concatenate([trusted.score_run(each) for each in coarse_series]) > 1))
    noise = real - clean
    generated = simulator.draw_noise(simulator.generate_clean(len(real), seed=seed), np.random.default_rng([seed, 5]))
    deviation = np.std(real, axis=(0, 1), dtype=np.float64)
    deviation = np.where(deviation > 0, deviation, 1.0)
    errors = {
        name: np.sqrt(np.mean((each - real) ** 2, axis=(0, 1), dtype=np.float64)) / deviation
        for name, each in (("coarse", plain), ("enhanced", clean))
    }
    shown = int(np.argsort(np.mean(noise**2, axis=(1, 2)))[len(noise) // 2])
    examples = {"coarse": plain[shown], "enhanced": clean[shown], "real": real[shown], "generated": simulator.generate(1, seed=seed)[0]}
    return Report(
        simulator.channels,
        window,
        is_held_out,
        sum(map(len, series)),
        coarse,
        tuple(notes),
        tuple(
            {"name": each.name, "error": each.error, "standard_error": each.standard_error, "is_chosen": each.name == choice.enhancer.name}
            for each in choice.judged
        ),
        {name: {kind: float(each[k]) for kind, each in errors.items()} for k, name in enumerate(simulator.channels)},
        str(simulator.trained["noise"]),
        tuple(noise_rows),
        {
            name: {kind: _described(each[:, :, k]) for kind, each in (("real", noise), ("generated", generated))}
            for k, name in enumerate(simulator.channels)
        },
        _cross_correlation(simulator.channels, noise, generated),
        tuple(each.to_dict() for each in detectors),
        str(simulator.trained["detector"]),
        bool(simulator.trained["keeps_promise"]),
        outside,
        examples,
    )


def _relation(row: Mapping[str, Any]) -> str:
    """Least recall of the anomalies of relations, of several channels."""
    found = [row["by_kind"][kind] for kind in RELATIONS if kind in row["by_kind"]]
    return f" ({min(found):.0%} of relations)" if found else ""


def _auc(row: Mapping[str, Any]) -> str:
    return "-" if row["auc"] is None else f"{row['auc']:.2f}"


def _coarse_prediction(choice: Choice, coarse: np.ndarray, real: np.ndarray) -> np.ndarray:
    """The coarse column that is most similar to each channel, unchanged."""
    from enhsim_tf.enhancer.candidates import fit_enhancer

    return fit_enhancer(COARSE, coarse, real, np.arange(len(real))).predict(coarse)


def _described(windows: np.ndarray) -> dict[str, float]:
    values = np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)
    power = float(np.mean(values**2))
    return {"sd": float(np.sqrt(power)), "lag_1": float(np.mean(values[:, 1:] * values[:, :-1]) / power) if power > 0 else 0.0}


def correlation_of(windows: np.ndarray) -> np.ndarray:
    """Returns the correlation of the channels of windows of noise, shape `(channels, channels)`, 0 for a constant channel."""
    rows = np.asarray(windows, np.float64).reshape(-1, windows.shape[2])
    covariance = np.cov(rows, rowvar=False).reshape(rows.shape[1], -1)
    size = np.sqrt(np.diag(covariance))
    return covariance / np.where(size > 0, size, 1.0)[:, None] / np.where(size > 0, size, 1.0)


def _cross_correlation(channels: Sequence[str], real: np.ndarray, generated: np.ndarray) -> dict[str, Any]:
    if len(channels) == 1:
        return {}
    pairs = np.triu_indices(len(channels), 1)
    apart = np.abs(correlation_of(generated) - correlation_of(real))[pairs]
    floor = np.abs(correlation_of(real[::2]) - correlation_of(real[1::2]))[pairs]
    halves = np.abs(correlation_of(real[: len(real) // 2]) - correlation_of(real[len(real) // 2 :]))[pairs] if len(real) > 3 else floor
    worst = int(np.argmax(apart))
    pair = [channels[pairs[0][worst]], channels[pairs[1][worst]]]
    return {"apart": float(apart[worst]), "floor": float(max(floor.max(), halves.max())), "pair": pair}
