"""The report on a run model: how telemetry and coarse run were paired, the ladder of enhancers, and errors on held-out time."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import printable
from enhsim_tf.enhanced_simulator.noise_fitting import sentence_of, warning_of

RATE = 0.01  # false-alarm rate for which the threshold of the residual detector is set


@dataclasses.dataclass(frozen=True)
class RunReport:
    """The report on a run model.

    Args:
        channel: Name of the channel.
        window: Length of a window in samples.
        columns: Coarse columns that are inputs of the enhancer.
        notes: What was done to bring telemetry and coarse run to one clock, one sentence each.
        ladder: For each rung, its `name`, `error` and `standard_error` on held-out blocks of the training time (NRMSE), and
            `is_within`, whether it is within one standard error of the best rung.
        num_stretches: Number of disjoint windows on which the rungs were judged.
        chosen: Name of the rung that the model uses.
        was_asked: Whether that rung was asked for.
        is_held_out: Whether the errors below are on telemetry that was held out from the whole fit.
        num_samples: Number of samples of that telemetry.
        nrmse: Normalised root-mean-square error of `coarse` and `enhanced` there, without noise in either.
        noise: Standard deviation (`sd`) and correlation of neighbouring samples (`lag_1`), for `real` residuals and `generated` noise.
        false_alarms: Share of these samples that the residual detector flags, at a threshold set for `RATE`.
        outside: Share of these samples whose coarse run is outside the training range.
        noise_candidates: Rows of `noise_fitting.choose_noise`. Empty if a noise model was asked for, or if there was too little to judge on.
        noise_model: Name of the noise model that was asked for, or `best`.
        noise_auc: AUC of a classifier that separates `generated` noise from the residuals of the judged telemetry, and of one that
            separates `real` residuals of the training telemetry from them. Empty if there is too little telemetry.
        unit: Unit of the values.
        examples: A stretch for the figure: `coarse`, `enhanced`, `generated` and `real`.
        coarse: Which coarse simulator was chosen and why; the first line of the report. Empty if the run was given.
    """

    channel: str
    window: int
    columns: tuple[str, ...]
    notes: tuple[str, ...]
    ladder: tuple[Mapping[str, Any], ...]
    num_stretches: int
    chosen: str
    was_asked: bool
    is_held_out: bool
    num_samples: int
    nrmse: Mapping[str, float]
    noise: Mapping[str, Mapping[str, float]]
    false_alarms: float
    outside: float
    noise_candidates: tuple[Mapping[str, Any], ...] = ()
    noise_model: str = "best"
    noise_auc: Mapping[str, float] = dataclasses.field(default_factory=dict)
    unit: str = "1"
    examples: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    coarse: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields except the examples, and the lines of text, in plain JSON types."""
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "examples"}
        plain |= {"columns": list(self.columns), "notes": list(self.notes), "ladder": [dict(each) for each in self.ladder]}
        return plain | {
            "nrmse": dict(self.nrmse),
            "noise": {kind: dict(each) for kind, each in self.noise.items()},
            "noise_candidates": [dict(each) for each in self.noise_candidates],
            "noise_auc": dict(self.noise_auc),
            "verdict": self.verdict,
        }

    @property
    def verdict(self) -> list[str]:
        """Sentences on the enhancers, the error, the noise and the range."""
        where = "held out from the fit" if self.is_held_out else "of the training (none was held out)"
        rungs = [f"{each['name']} {each['error']:.4f} ± {each['standard_error']:.4f}" for each in self.ladder]
        why = "as asked for" if self.was_asked else "the simplest within one standard error of the best"
        real, generated = self.noise["real"], self.noise["generated"]
        unit = "" if self.unit == "1" else f" {self.unit}"
        return [
            f"Enhancers, error on held-out blocks of the training time (NRMSE, {self.num_stretches} disjoint windows): {', '.join(rungs)}. "
            f"Chosen: {self.chosen}, {why}.",
            f"Signal: error {self.nrmse['enhanced']:.4f} on {self.num_samples:,} samples {where}; the coarse simulator {self.nrmse['coarse']:.4f}. "
            "Both errors contain the noise of the telemetry.",
            self._of_the_noise_models(),
            f"Noise: standard deviation {generated['sd']:.4g}{unit} generated, {real['sd']:.4g}{unit} real; correlation of neighbouring samples "
            f"{generated['lag_1']:.2f} generated, {real['lag_1']:.2f} real.",
            f"False alarms of `score --coarse` there, at a threshold set for {RATE:.0%}: {self.false_alarms:.1%} of the samples.",
            f"Range: {self.outside:.1%} of these samples are outside the training range of the coarse columns.",
        ]

    def _of_the_noise_models(self) -> str:
        said = sentence_of(self.noise_candidates, self.noise_model)
        if not self.noise_auc:
            return said
        return f"{said} AUC of a classifier against held-out residuals: generated {self.noise_auc['generated']:.2f}, real {self.noise_auc['real']:.2f}."

    def lines(self) -> list[str]:
        """Returns the report as lines of text: a heading, the notes on the pairing, and the verdict."""
        head = f"windows of {self.window} samples; inputs: {', '.join(self.columns)}"
        warning = warning_of(self.noise_auc.get("generated"), self.noise_auc.get("real"))
        first, *rest = [*([self.coarse] if self.coarse else []), head]
        heads = [f"{self.channel}: {warning}{first}", *(f"{self.channel}: {line}" for line in rest)]
        return [printable(line) for line in (*heads, *self.notes, *self.verdict)]


def compare_noise(parts: Sequence[np.ndarray], generated: np.ndarray) -> dict[str, dict[str, float]]:
    """Measures scale and neighbouring correlation of real residuals and generated noise.

    Args:
        parts: Contiguous residuals.
        generated: A series of generated noise.
    """
    return {"real": _describe(parts), "generated": _describe([generated])}


def _describe(parts: Sequence[np.ndarray]) -> dict[str, float]:
    mean = np.concatenate(parts).mean(dtype=np.float64)
    centred = [np.asarray(part, np.float64) - mean for part in parts]
    power = float(np.mean(np.concatenate(centred) ** 2))
    products = np.concatenate([part[1:] * part[:-1] for part in centred])
    return {"sd": float(np.sqrt(power)), "lag_1": float(np.mean(products) / power) if power > 0 else 0.0}
