"""The report on a fitted simulator: numbers for `report.json`, and the lines that `fit` prints."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import printable, spoken
from enhsim_tf.enhancer.candidates import Choice, Training
from enhsim_tf.enhancer.names import COARSE
from enhsim_tf.simulator.detector_choice import RATE, RELATIONS, JudgedDetector
from enhsim_tf.simulator.joint import nrmse, windows_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.trusted_range import TrustedRange
from enhsim_tf.telemetry.windows import evenly_spaced_starts

_NUM_WINDOWS = 500  # windows on which errors and noise are measured
_LEAST_RECALL = 0.3  # of injected anomalies; below it, the report warns
_FLOORS = 3.0  # cross-correlations further apart than this multiple of the floor are said to differ


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """The report on a fitted simulator."""

    channels: list[str]
    window: int
    is_held_out: bool  # whether the telemetry of the measurements was held out from the fit
    num_samples: int  # of that telemetry
    coarse: str  # which coarse simulator was used and why
    notes: list[str]  # what else is to be said
    enhancers: list[
        dict[str, Any]
    ]  # `name`, `error` (NRMSE), `standard_error` and `is_chosen` of each that was judged
    nrmse: dict[
        str, dict[str, float]
    ]  # of each channel, the error of `coarse` and `enhanced` in standard deviations of the telemetry
    noise_model: str
    cross_correlation: dict[str, Any]  # of several channels, see `_cross_correlation`
    detectors: list[dict[str, Any]]  # see `detector_choice.JudgedDetector`
    detector: str  # the one that `score` uses
    keeps_promise: bool  # whether it flags no more of held-out nominal time than it may
    outside: (
        float | None
    )  # of recorded runs, the share of that time outside the training range of the coarse columns
    examples: dict[
        str, np.ndarray
    ]  # for the figure: `coarse`, `enhanced`, `generated` and `real`, each of shape `(samples, channels)`

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields except the examples, in plain JSON types."""
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name != "examples"
        }

    def lines(self) -> list[str]:
        """Returns the report as lines of text: warnings come first."""
        name = spoken(self.channels)
        where = (
            "held-out time" if self.is_held_out else "the telemetry of the fit (none was held out)"
        )
        found = [
            *self.warnings(),
            self.coarse,
            f"windows of {self.window} samples; measured on {self.num_samples:,} samples of {where}",
            *self.notes,
            self._of_enhancers(),
            self._of_signals(),
            f"noise: {self.noise_model}",
            self._of_cross_correlation(),
            self._of_detectors(),
        ]
        if self.outside is not None:
            found.append(
                f"range: {self.outside:.1%} of that time are outside the training range of the coarse columns"
            )
        return [f"{name}: {printable(line)}" for line in found if line]

    def warnings(self) -> list[str]:
        """Returns what should keep a reader from trusting the simulator, the first of `lines`."""
        (used,), found = [each for each in self.detectors if each["name"] == self.detector], []
        if not self.keeps_promise:
            found.append(
                f"WARNING: no detector keeps its promise; the best, {self.detector}, flags {used['false_alarms']:.0%} of nominal telemetry at {RATE:.0%} set. "
                "Do not trust its alarms"
            )
        if used["recall"] < _LEAST_RECALL:
            found.append(
                f"WARNING: {self.detector}, the detector that score uses, finds only {used['recall']:.0%} of the injected anomalies, so a fault can go unseen. "
                "Compare the line of the detectors; another --window, or --detector of score, may find more"
            )
        return found

    def _of_enhancers(self) -> str:
        errors = ", ".join(
            f"{each['name']} {each['error']:.3f} ± {each['standard_error']:.3f}"
            for each in self.enhancers
        )
        (used,) = [each["name"] for each in self.enhancers if each["is_chosen"]]
        return f"enhancers, error on held-out blocks of the training time (NRMSE): {errors}. Used: {used}"

    def _of_signals(self) -> str:
        if len(self.channels) > 1:
            said = ", ".join(
                f"{name} {each['enhanced']:.3f} ({each['coarse']:.3f})"
                for name, each in self.nrmse.items()
            )
            return f"signals: error of the enhanced (and of the coarse) signal, NRMSE, with the noise: {said}"
        (errors,) = self.nrmse.values()
        return f"signal: error {errors['enhanced']:.3f} of the enhanced signal, {errors['coarse']:.3f} of the coarse one (NRMSE, with the noise)"

    def _of_detectors(self) -> str:
        rates = []
        for each in self.detectors:
            relations = [
                each["by_kind"][kind] for kind in RELATIONS if kind in each["by_kind"]
            ]  # of several channels
            least = f" ({min(relations):.0%} of relations)" if relations else ""
            rates.append(
                f"{each['name']} {each['false_alarms']:.1%} and {each['recall']:.0%}{least}"
            )
        said = (
            f"detectors there, set for {RATE:.0%} (false alarms, and recall of injected anomalies)"
        )
        return f"{said}: {'; '.join(rates)}. score uses: {self.detector}"

    def _of_cross_correlation(self) -> str:
        if not self.cross_correlation:
            return ""
        apart, floor = self.cross_correlation["apart"], self.cross_correlation["floor"]
        where = " and ".join(self.cross_correlation["pair"])
        fails = f"; joint noise fails between {where}" if apart > _FLOORS * floor else ""
        return f"cross-correlation of the noise: at most {apart:.3f} apart from the real one ({where}); two halves of the real one {floor:.3f}{fails}"


def make_report(
    simulator: EnhancedSimulator,
    choice: Choice,
    detectors: Sequence[JudgedDetector],
    judged: Recording,
    run: Recording | None,
    is_held_out: bool,
    coarse: str,
    notes: list[str],
    seed: int,
) -> Report:
    """Measures a fitted simulator, whose noise and detector were judged, on telemetry in parts of at least a window and its coarse run."""
    real, clean = simulator.windows_and_signal(judged, run, _NUM_WINDOWS)
    plain, outside = _coarse_signal(simulator, real, run)
    noise = real - clean
    generated = simulator.draw_noise(
        simulator.generate(len(real), seed=seed, with_noise=False), np.random.default_rng([seed, 5])
    )
    errors = {"coarse": nrmse(plain, real), "enhanced": nrmse(clean, real)}
    shown = int(np.argsort(np.mean(noise**2, axis=(1, 2)))[len(noise) // 2])
    trained = simulator.trained
    return Report(
        channels=list(simulator.channels),
        window=simulator.window,
        is_held_out=is_held_out,
        num_samples=len(judged),
        coarse=coarse,
        notes=notes,
        enhancers=[
            {
                "name": each.name,
                "error": each.error,
                "standard_error": each.standard_error,
                "is_chosen": each.name == choice.enhancer.name,
            }
            for each in choice.judged
        ],
        nrmse={
            name: {kind: float(each[k]) for kind, each in errors.items()}
            for k, name in enumerate(simulator.channels)
        },
        noise_model=trained["noise"],
        cross_correlation=_cross_correlation(simulator.channels, noise, generated),
        detectors=[dataclasses.asdict(each) | {"keeps": bool(each.keeps)} for each in detectors],
        detector=trained["detector"],
        keeps_promise=trained["keeps_promise"],
        outside=outside,
        examples={
            "coarse": plain[shown],
            "enhanced": clean[shown],
            "real": real[shown],
            "generated": simulator.generate(1, seed=seed)[0],
        },
    )


def _coarse_signal(
    simulator: EnhancedSimulator, real: np.ndarray, run: Recording | None
) -> tuple[np.ndarray, float | None]:
    """The coarse signal of each channel, for a run its most similar column; and the share of a run outside the training range."""
    if run is None:
        coarse, shift, gain = simulator.alignment.align(real)
        return shift[:, None] + gain[:, None] * coarse, None
    trusted, starts = (
        TrustedRange(simulator),
        evenly_spaced_starts(run.parts, simulator.window, _NUM_WINDOWS),
    )
    coarse = windows_of(run, starts, simulator.window)
    outside = np.concatenate([trusted.score_run(part.values) for part in run.parts]) > 1
    return Training(coarse, real, np.arange(len(real))).fit(COARSE).predict(coarse), float(
        outside.mean()
    )


def correlation_of(windows: np.ndarray) -> np.ndarray:
    """Returns the correlation of the channels of windows of noise, shape `(channels, channels)`, 0 for a constant channel."""
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(
            np.corrcoef(windows.reshape(-1, windows.shape[2]), rowvar=False, dtype=np.float64)
        )


def _cross_correlation(
    channels: Sequence[str], real: np.ndarray, generated: np.ndarray
) -> dict[str, Any]:
    """The largest difference between correlations of generated and real noise, the pair of channels, and the same of halves of the real one."""
    if len(channels) == 1:
        return {}
    pairs = np.triu_indices(len(channels), 1)
    apart = np.abs(correlation_of(generated) - correlation_of(real))[pairs]
    floor = np.abs(correlation_of(real[::2]) - correlation_of(real[1::2]))[pairs]
    halves = (
        np.abs(correlation_of(real[: len(real) // 2]) - correlation_of(real[len(real) // 2 :]))[
            pairs
        ]
        if len(real) > 3
        else floor
    )
    worst = int(np.argmax(apart))
    pair = [channels[pairs[0][worst]], channels[pairs[1][worst]]]
    return {
        "apart": float(apart[worst]),
        "floor": float(max(floor.max(), halves.max())),
        "pair": pair,
    }
