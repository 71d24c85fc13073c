"""What a simulator fitted to a channel is worth, in numbers and in plain sentences; `channel_report` measures it."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import printable

RATE = 0.01  # of false alarms, that thresholds are set for
SEVERITY = 4.0  # standard deviations of the noise, of the anomalies that the verdict speaks of
NOTICED, MISSED = 0.8, 0.2  # shares of anomalies that count as found and as missed
_USABLE = 0.1  # share of real nominal windows: a detector that alarms on more finds everything and says nothing
_FEW = 100  # windows that share no sample: with fewer, the rates are given with what they may be at worst
_NAMED = 3  # measures of the noise that are named, at most
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
        unit: Unit of the values.
        time_unit: What the period counts: `s` or `samples`.
        levels: For quantised telemetry its number of levels and the `step` between them; else empty.
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

    def to_dict(self) -> dict[str, Any]:
        """Everything but the examples, in plain JSON types."""
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "examples"}
        nrmse = {name: None if np.isnan(error) else error for name, error in self.nrmse.items()}  # NaN is no JSON
        return plain | {"nrmse": nrmse, "noise": [dict(row) for row in self.noise], "verdict": self.verdict}

    @property
    def usable(self) -> list[str]:
        """Detectors trained on generated windows that alarm on few enough real ones to say anything."""
        return [name for name, rate in self.false_alarms["generated"].items() if rate <= _USABLE]

    @property
    def found(self) -> dict[str, tuple[str, float]]:
        """For each kind of anomaly the usable detector that finds most of it, and what share; empty where none is usable."""
        kinds = next(iter(self.recall.values())) if self.usable else ()
        best = {kind: max(self.usable, key=lambda name, kind=kind: self.recall[name][kind]) for kind in kinds}
        return {kind: (name, self.recall[name][kind]) for kind, name in best.items()}

    @property
    def verdict(self) -> list[str]:
        """What the simulator is worth, and what a detector trained on it would and would not notice, in plain sentences."""
        said = [self._of_the_signal(), self._of_the_noise(), self._of_false_alarms(), self._of_anomalies()]
        if self.levels:
            said.append(
                f"Levels: the telemetry has {self.levels['count']:,.0f} values, {self.levels['step']:.4g} apart; generated values are not "
                "rounded to them, which a detector can tell. Round them to that step before training."
            )
        return said

    def _of_the_signal(self) -> str:
        errors = self.nrmse
        if any(np.isnan(error) for error in errors.values()):
            return f"Signal: no window of {self._where()} moves, so the error cannot be measured."
        others = {"the coarse simulator": errors["coarse"], "ridge regression": errors["ridge"]}
        beaten = [name for name, error in others.items() if errors["enhanced"] < error]
        judged = "The enhancer is nearest to it." if len(beaten) == 2 else f"The enhancer is no nearer than {min(others, key=others.get)}."
        return (
            f"Signal: error {errors['enhanced']:.3f} on {self._where()} (NRMSE, median window); the coarse simulator "
            f"{errors['coarse']:.3f}, ridge regression {errors['ridge']:.3f}. {judged}"
        )

    def _of_the_noise(self) -> str:
        measured = [row for row in self.noise if row["ratio"] is not None]
        if not measured:
            return "Noise: the telemetry is too short to compare its noise with generated noise."
        told = sorted((row for row in measured if row["ratio"] > _SUSPICIOUS), key=lambda row: -row["ratio"])
        if not told:
            return f"Noise: none of {len(measured)} measures tells generated noise from the telemetry's."
        which = "it is" if len(told) == 1 else "most of all" if len(told) > _NAMED else "they are"
        named = _listed([row["measure"] for row in told[:_NAMED]])
        return f"Noise: {len(told)} of {len(measured)} measures {_tell(len(told))} generated noise from the telemetry's; {which} {named}."

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
        worst = 1 - 0.05 ** (1 / max(1, self.num_disjoint))  # of this many independent windows none, with a chance of 5 %
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
        """The report in plain words."""
        windows = _counted(self.num_windows, "window")
        where = f"{windows} held out" if self.is_held_out else f"{windows} of what it learnt from"
        head = f"windows of {self.window} samples, period {self.period_s:.6g} {self.time_unit}; measured on {where}"
        return [f"{printable(self.channel)}: {head}", *self.verdict]


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def _tell(number: int) -> str:
    return "tells" if number == 1 else "tell"


def _listed(words: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
