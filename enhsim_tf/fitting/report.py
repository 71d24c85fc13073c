"""The report on a fitted simulator: numbers for `report.json`, and the lines that `fit` prints."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import MANY, printable, spoken
from enhsim_tf.common.measures import nrmse_of_channels
from enhsim_tf.enhancer.candidates import Judged
from enhsim_tf.fitting.fitted import Fitted
from enhsim_tf.scoring.scorer import Scorer
from enhsim_tf.scoring.trusted_range import TrustedRange
from enhsim_tf.simulator.simulator import EnhancedSimulator

_NUM_WINDOWS = 500  # windows on which errors and noise are measured
RATE = 0.01  # share of nominal time for which thresholds are set
_MOST_ALARMS = 0.1  # share of held-out nominal time; above it, the report warns
_FLOORS = 3.0  # cross-correlations further apart than this multiple of the floor are said to differ


@dataclasses.dataclass(frozen=True)
class SignalError:
    """Root-mean-square errors of a channel, in standard deviations of its telemetry (NRMSE)."""

    coarse: float
    enhanced: float


@dataclasses.dataclass(frozen=True)
class CrossCorrelation:
    """How far the correlations of generated noise are from those of the real one."""

    apart: float  # the largest difference
    floor: float  # the largest difference between halves of the real noise
    pair: list[str]  # the channels of the largest difference


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """The report on a fitted simulator."""

    channels: list[str]
    window: int
    is_held_out: bool  # whether the telemetry of the measurements was held out from the fit
    num_samples: int  # of that telemetry
    coarse: str  # which coarse simulator was used and why
    notes: list[str]  # what else is to be said
    enhancers: list[Judged]
    enhancer: str  # the one that is used
    nrmse: dict[str, SignalError]
    noise_model: str
    cross_correlation: CrossCorrelation | None  # of several channels
    false_alarms: float  # share of that time above the threshold of `score`, see `alarms_of`
    set_for: float  # the share for which the threshold is set, larger where telemetry is short
    # of each view, the share of held-out time beyond its nominal quantile
    views: dict[str, float]
    # of recorded runs, the share of that time outside the training range of the coarse columns
    outside: float | None
    # for the figure: `coarse`, `enhanced`, `generated` and `real`, each of shape `(samples,
    # channels)`
    examples: dict[str, np.ndarray]

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields except the examples, in plain JSON types."""
        fields = dataclasses.asdict(self)
        del fields["examples"]
        return fields

    def lines(self) -> list[str]:
        """Returns the report as lines of text: warnings come first."""
        name = spoken(self.channels)
        where = (
            "held-out time"
            if self.is_held_out
            else "the telemetry of the fit (no part of a window was held out)"
        )
        lines = [
            *self.warnings(),
            self.coarse,
            f"windows of {self.window} samples; measured on {self.num_samples:,} samples of "
            f"{where}",
            *self.notes,
            self._of_enhancers(),
            self._of_signals(),
            f"noise: {self.noise_model}",
            self._of_cross_correlation(),
            self._of_views(),
        ]
        if self.outside is not None:
            lines.append(
                f"range: {self.outside:.1%} of that time are outside the training range of the "
                "coarse columns"
            )
        return [f"{name}: {printable(line)}" for line in lines if line]

    def warnings(self) -> list[str]:
        """Returns what should keep a reader from trusting the simulator, the first of `lines`."""
        said = []
        if self.false_alarms > _MOST_ALARMS:
            said.append(
                f"WARNING: {self.false_alarms:.0%} of {'held-out ' * self.is_held_out}nominal time "
                f"are above the threshold, which is set for {100 * self.set_for:.2g}%: it has left "
                "what was learnt. Expect false alarms, or fit to more telemetry"
            )
        worse = [
            f"{name} {error.enhanced:.3g}"
            for name, error in self.nrmse.items()
            if error.enhanced > 1
        ]
        if worse:
            said.append(
                "WARNING: the enhanced signal is worse than the mean of the telemetry alone (NRMSE "
                f"above 1): {', '.join(worse[:3])}. Do not use it; of a counter, give the "
                "differences"
            )
        return said

    def _of_enhancers(self) -> str:
        errors = ", ".join(
            f"{judged.name} {judged.error:.3f} ± {judged.standard_error:.3f}"
            for judged in self.enhancers
        )
        where = "error on held-out blocks of the training time (NRMSE)"
        return f"enhancers, {where}: {errors}. Used: {self.enhancer}"

    def _of_signals(self) -> str:
        if len(self.channels) > 1:
            errors = list(self.nrmse.items())
            what = "error of the enhanced (and of the coarse) signal, NRMSE, with the noise"
            if len(errors) > MANY:
                errors = sorted(errors, key=lambda item: -item[1].enhanced)[:MANY]
                what += f", the largest of {len(self.nrmse):,}"
            said = ", ".join(
                f"{name} {error.enhanced:.3f} ({error.coarse:.3f})" for name, error in errors
            )
            return f"signals: {what}: {said}"
        (error,) = self.nrmse.values()
        return (
            f"signal: error {error.enhanced:.3f} of the enhanced signal, "
            f"{error.coarse:.3f} of the coarse one (NRMSE, with the noise)"
        )

    def _of_views(self) -> str:
        shares = ", ".join(f"{name} {share:.1%}" for name, share in self.views.items())
        return (
            f"views there: {self.false_alarms:.1%} above the threshold of their sum, set for "
            f"{100 * self.set_for:.2g}%"
        ) + f"; beyond their quantiles of {RATE:.0%}: {shares}" * bool(shares)

    def _of_cross_correlation(self) -> str:
        noise = self.cross_correlation
        if noise is None:
            return ""
        where = " and ".join(noise.pair)
        fails = f"; joint noise fails between {where}" * (noise.apart > _FLOORS * noise.floor)
        return (
            f"cross-correlation of the noise: at most {noise.apart:.3f} apart from the real one "
            f"({where}); two halves of the real one {noise.floor:.3f}{fails}"
        )


def alarms_of(
    scorer: Scorer, held_out: Sequence[np.ndarray] = ()
) -> tuple[float, dict[str, float]]:
    """Returns the share of held-out nominal samples above the threshold of views that have learnt
    other series, and of each view the share of windows beyond its quantile.

    If nothing is held out, the share is that of blocks of the learnt series, each by views that
    have not learnt it; the views are left out, because these blocks set their quantiles.
    """
    if not held_out:
        return float(np.mean(scorer.nominal_scores > 1)), {}
    scores = [scorer.score(series) for series in held_out]
    above = np.concatenate([score.samples for score in scores]) > 1
    beyond = np.concatenate([score.by_view for score in scores], axis=1) > 1
    return float(above.mean()), dict(zip(scorer.names, beyond.mean(axis=1).tolist(), strict=True))


def make_report(simulator: EnhancedSimulator, fitted: Fitted, noise: str) -> Report:
    """Measures a simulator with a noise model of this name on held-out telemetry, or on that of the
    fit if no held-out part has a window of the views.
    """
    scorer = Scorer(fitted.learnt_series, RATE)
    held_out = fitted.held_out and fitted.held_out.long_enough(scorer.window)
    false_alarms, views = alarms_of(scorer, simulator.judged_series(held_out) if held_out else ())
    judged = held_out or fitted.learnt
    choice = fitted.choice
    seed = fitted.options.seed
    real, plain, clean = simulator.windows_and_signals(judged, _NUM_WINDOWS)
    left = real - clean
    generated = simulator.draw_noise(
        simulator.generate(len(real), seed=seed, with_noise=False), np.random.default_rng([seed, 5])
    )
    errors = zip(
        simulator.channels,
        nrmse_of_channels(plain, real).tolist(),
        nrmse_of_channels(clean, real).tolist(),
        strict=True,
    )
    outside = None
    if judged.run is not None:
        outside = float((TrustedRange(simulator).score_parts(judged.run) > 1).mean())
    errors_of_windows = np.mean((left / simulator.scale) ** 2, axis=(1, 2))
    shown = int(np.argsort(errors_of_windows)[len(left) // 2])
    return Report(
        channels=list(simulator.channels),
        window=simulator.window,
        is_held_out=held_out is not None,
        num_samples=len(judged),
        coarse=fitted.coarse,
        notes=fitted.notes,
        enhancers=list(choice.judged),
        enhancer=choice.enhancer.name,
        nrmse={name: SignalError(coarse, enhanced) for name, coarse, enhanced in errors},
        noise_model=noise,
        cross_correlation=_cross_correlation(simulator.channels, left, generated),
        false_alarms=false_alarms,
        set_for=scorer.rate,
        views=views,
        outside=outside,
        examples={
            "coarse": plain[shown],
            "enhanced": clean[shown],
            "real": real[shown],
            "generated": simulator.generate(1, seed=seed)[0],
        },
    )


def correlation_of(windows: np.ndarray) -> np.ndarray:
    """Returns the correlation of the channels of windows of noise, shape `(channels, channels)`, 0
    for a constant channel.
    """
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(
            np.corrcoef(windows.reshape(-1, windows.shape[2]), rowvar=False, dtype=np.float64)
        )


def _cross_correlation(
    channels: Sequence[str], real: np.ndarray, generated: np.ndarray
) -> CrossCorrelation | None:
    """Compares correlations of generated and real noise; None of a single channel."""
    if len(channels) == 1:
        return None
    pairs = np.triu_indices(len(channels), 1)

    def apart(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.abs(correlation_of(first) - correlation_of(second))[pairs]

    distances = apart(generated, real)
    middle = len(real) // 2
    halves = (real[::2], real[1::2]), (real[:middle], real[middle:])
    floor = max(apart(*both).max() for both in halves)
    worst = int(np.argmax(distances))
    pair = [channels[numbers[worst]] for numbers in pairs]
    return CrossCorrelation(float(distances[worst]), float(floor), pair)
