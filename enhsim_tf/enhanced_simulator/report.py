"""The report on a simulator fitted to a channel, as numbers and as sentences. `report_measure` computes the numbers."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import printable
from enhsim_tf.enhanced_simulator.noise_fitting import sentence_of, warning_of

RATE = 0.01  # false-alarm rate for which thresholds are set
SEVERITY = 4.0  # size of the injected anomalies, in standard deviations of the noise
NOTICED, MISSED = 0.8, 0.2  # a kind of anomaly is found if its recall is at least the first, missed if at most the second
_USABLE = 0.1  # maximum false-alarm rate on real nominal windows; the recall of a detector above it is meaningless
_FEW = 100  # with fewer disjoint windows, the report adds an upper bound of the false-alarm rate
_NAMED = 3  # maximum number of noise measures that the verdict names
_SUSPICIOUS = 2.0  # a measure distinguishes generated from real noise above this multiple of its real-vs-real baseline


@dataclasses.dataclass(frozen=True)
class ChannelReport:
    """The report on a fitted simulator.

    Args:
        channel: Name of the channel.
        window: Length of a window in samples.
        period_s: Period of the coarse simulator in seconds, or in samples if the channel has no time. NaN without a period.
        is_held_out: Whether the telemetry of the evaluation was held out from training.
        num_windows: Number of real windows used for errors and false alarms. They may overlap.
        num_disjoint: How many of these windows can be chosen without overlap; this is the effective sample size.
        nrmse: Normalised root-mean-square error (NRMSE) of `coarse`, `ridge` (regression), `nearest` (mean of the nearest
            training windows) and `enhanced`: the median over windows of the error divided by the window's standard deviation.
        noise: Rows of `realism.Row` as dictionaries, which compare generated with extracted noise. Empty if there is too
            little telemetry.
        noise_window: Length in samples of the windows in which noise was compared.
        false_alarms: Share of real windows flagged by each detector, for the training data `generated` and `real`.
        recall: For each detector trained on generated windows and each kind of anomaly, the share of anomalies of
            `SEVERITY` that it finds.
        noise_sd: Standard deviation of the extracted noise, in the telemetry's unit.
        examples: Windows for the figure: `coarse`, `enhanced`, `generated` and `real`.
        unit: Unit of the values.
        time_unit: Unit of the period: `s` or `samples`.
        levels: For quantised telemetry, the `count` of its levels and the `step` between them; otherwise empty.
        ladder: For each enhancer that was judged on held-out time, its `name`, `error`, `standard_error`, `is_within` (one
            standard error of the best) and `is_chosen`. Empty if the paper's network was used without a choice.
        noise_model: Name of the noise model that was asked for, or `best`.
        noise_candidates: Rows of `noise_fitting.choose_noise`. Empty if a noise model was asked for, or if there was too little to judge on.
        noise_auc: AUC of a classifier that separates `generated` noise from that of the evaluation telemetry, and of one that
            separates `real` noise of the training telemetry from it. Empty if there is too little telemetry.
        coarse: Which coarse simulator was chosen and why; the first line of the report.
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
    unit: str = "1"
    time_unit: str = "s"
    levels: Mapping[str, float] = dataclasses.field(default_factory=dict)
    ladder: Sequence[Mapping[str, Any]] = ()
    noise_model: str = "best"
    noise_candidates: Sequence[Mapping[str, Any]] = ()
    noise_auc: Mapping[str, float] = dataclasses.field(default_factory=dict)
    coarse: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields except the examples, and the verdict, in plain JSON types."""
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "examples"}
        nrmse = {name: None if np.isnan(error) else error for name, error in self.nrmse.items()}  # NaN is not valid JSON
        return plain | {
            "period_s": self.period_s if np.isfinite(self.period_s) else None,
            "nrmse": nrmse,
            "noise": [
                {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in row.items()}
                for row in self.noise
            ],
            "ladder": [dict(each) for each in self.ladder],
            "noise_candidates": [dict(each) for each in self.noise_candidates],
            "noise_auc": dict(self.noise_auc),
            "verdict": self.verdict,
        }

    @property
    def usable(self) -> list[str]:
        """Detectors trained on generated windows whose false-alarm rate on real windows is low enough to be useful."""
        return [name for name, rate in self.false_alarms["generated"].items() if rate <= _USABLE]

    @property
    def found(self) -> dict[str, tuple[str, float]]:
        """For each kind of anomaly, the usable detector with the highest recall, and that recall; empty if none is usable."""
        kinds = next(iter(self.recall.values())) if self.usable else ()
        best = {kind: max(self.usable, key=lambda name, kind=kind: self.recall[name][kind]) for kind in kinds}
        return {kind: (name, self.recall[name][kind]) for kind, name in best.items()}

    @property
    def verdict(self) -> list[str]:
        """Sentences on the accuracy of the simulator, and on which anomalies a detector trained on its output finds."""
        said = [
            *self._of_the_enhancers(),
            self._of_the_signal(),
            self._of_the_noise_models(),
            self._of_the_noise(),
            self._of_false_alarms(),
            self._of_anomalies(),
        ]
        if self.levels:
            said.append(
                f"Levels: the telemetry has {self.levels['count']:,.0f} values, {self.levels['step']:.4g} apart; generated values are rounded "
                "to this grid."
            )
        return said

    def _of_the_enhancers(self) -> list[str]:
        if not self.ladder:
            return []
        errors = _listed([f"{each['name']} {each['error']:.3f} ± {each['standard_error']:.3f}" for each in self.ladder])
        (chosen,) = [each["name"] for each in self.ladder if each["is_chosen"]]
        return [
            f"Enhancers: error on held-out blocks of the training time (NRMSE), aligned with ridge regression: {errors}. Used: {chosen}."
        ]

    def _of_the_signal(self) -> str:
        errors = self.nrmse
        if any(np.isnan(error) for error in errors.values()):
            return f"Signal: no window of {self._where()} moves, so the error cannot be measured."
        others = {
            "the coarse simulator": errors["coarse"],
            "ridge regression": errors["ridge"],
            "the mean of the nearest training windows": errors["nearest"],
        }
        beaten = [name for name, error in others.items() if errors["enhanced"] < error]
        judged = (
            "The enhancer is nearest to it."
            if len(beaten) == len(others)
            else f"The enhancer is no nearer than {min(others, key=others.get)}."
        )
        return (
            f"Signal: error {errors['enhanced']:.3f} on {self._where()} (NRMSE, median window); the coarse simulator "
            f"{errors['coarse']:.3f}, ridge regression {errors['ridge']:.3f}, the mean of the nearest training windows "
            f"{errors['nearest']:.3f}. {judged}"
        )

    def _of_the_noise_models(self) -> str:
        said = sentence_of(self.noise_candidates, self.noise_model)
        if not self.noise_auc:
            return said
        auc = f"AUC of a classifier against the noise of {self._where()}: generated {self.noise_auc['generated']:.2f}"
        return f"{said} {auc}, real {self.noise_auc['real']:.2f}."

    def _of_the_noise(self) -> str:
        measured = [row for row in self.noise if row["ratio"] is not None]
        if not measured:
            return "Noise: the telemetry is too short to compare its noise with generated noise, or varies too seldom."
        different = sorted((row for row in measured if row["ratio"] > _SUSPICIOUS), key=lambda row: -row["ratio"])
        if not different:
            return f"Noise: none of {len(measured)} measures tells generated noise from the telemetry's."
        which = "it is" if len(different) == 1 else "most of all" if len(different) > _NAMED else "they are"
        named = _listed([row["measure"] for row in different[:_NAMED]])
        return f"Noise: {len(different)} of {len(measured)} measures {_tell(len(different))} generated noise from the telemetry's; {which} {named}."

    def _of_false_alarms(self) -> str:
        real = self.false_alarms["real"]
        rates = [f"{name} {rate:.0%} ({real[name]:.0%})" for name, rate in self.false_alarms["generated"].items()]
        said = (
            f"False alarms on {self._where()}, at thresholds set for {RATE:.0%}, trained on generated windows (in brackets: on real ones): "
            f"{_listed(rates)}. {_counted(self.num_windows, 'window')} tried"
        )
        if self.num_disjoint < self.num_windows:
            said += f", which overlap: {self.num_disjoint} of them {'shares' if self.num_disjoint == 1 else 'share'} no sample"
        if self.num_disjoint >= _FEW:
            return f"{said}."
        worst = 1 - 0.05 ** (
            1 / max(1, self.num_disjoint)
        )  # at this rate, no false alarm in so many independent windows has a probability of 5 %
        return f"{said}. With so few, even where none alarms the rate may be up to {worst:.0%}."

    def _of_anomalies(self) -> str:
        noisy = [name for name in self.false_alarms["generated"] if name not in self.usable]
        about = f"Anomalies of {SEVERITY:g} standard deviations of the noise"
        if not self.usable:
            return f"{about}: no detector trained on this can be used, because each alarms on more than {_USABLE:.0%} of nominal windows."
        shares = {share: [] for share in ("notices", "misses", "between")}
        for kind, (name, rate) in self.found.items():
            share = "notices" if rate >= NOTICED else "misses" if rate <= MISSED else "between"
            shares[share].append(f"{kind.replace('_', ' ')} ({f'{name}, ' if share != 'misses' else ''}{rate:.0%})")
        said = f"{about}: of those tried, a detector trained on this notices {_listed(shares['notices']) or 'none'}"
        said += f"; it finds only some of {_listed(shares['between'])}" if shares["between"] else ""
        said += f"; it misses {_listed(shares['misses'])}" if shares["misses"] else ""
        alarm = "it alarms" if len(noisy) == 1 else "they alarm"
        left = f" Left out, because {alarm} on more than {_USABLE:.0%} of nominal windows: {_listed(noisy)}."
        return f"{said}.{left if noisy else ''}"

    def _where(self) -> str:
        return "telemetry it has not seen" if self.is_held_out else "the telemetry it learnt from (none was held out)"

    def lines(self) -> list[str]:
        """Returns the report as lines of text: the coarse simulator, a heading and the verdict."""
        windows = _counted(self.num_windows, "window")
        where = f"{windows} held out" if self.is_held_out else f"{windows} of the training telemetry"
        period = f", period {self.period_s:.6g} {self.time_unit}" if np.isfinite(self.period_s) else ""
        head = f"windows of {self.window} samples{period}; measured on {where}"
        warning = warning_of(self.noise_auc.get("generated"), self.noise_auc.get("real"))
        first, *rest = [*([self.coarse] if self.coarse else []), head]
        return [f"{printable(self.channel)}: {warning}{first}", *(f"{printable(self.channel)}: {line}" for line in rest), *self.verdict]


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def _tell(number: int) -> str:
    return "tells" if number == 1 else "tell"


def _listed(words: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
