"""The report on an update: what changed in the simulator, as numbers and as sentences."""

import dataclasses
from typing import Any

import numpy as np

from enhsim_tf.common.errors import printable

RATE = 0.01  # false-alarm rate for which thresholds are set


@dataclasses.dataclass(frozen=True)
class State:
    """A simulator before or after an update.

    Args:
        level: Median level of windows, in the unit of the telemetry.
        gain: Median gain of windows relative to the coarse simulator.
        period_s: Period in seconds, or in samples without times; None without a period.
        phase: Phase at time 0 of the telemetry as a fraction of a period; None without a period.
        noise_sd: Standard deviation of the generated noise, in the unit of the telemetry.
        error: Median error of the enhanced signal on held-out new telemetry (NRMSE).
        alarms: Share of the windows of that telemetry that the residual detector flags, at a threshold set for `RATE` on
            generated windows.
    """

    level: float
    gain: float
    period_s: float | None
    phase: float | None
    noise_sd: float
    error: float
    alarms: float


@dataclasses.dataclass(frozen=True)
class UpdateReport:
    """The report on an update.

    Args:
        channel: Name of the channel.
        num_samples: Number of samples of the new telemetry.
        num_windows: Number of held-out windows; they may overlap.
        num_disjoint: How many of them share no sample.
        before: The old simulator.
        after: The updated simulator.
        notes: What was kept and why, one sentence each.
        unit: Unit of the values.
        time_unit: Unit of the period: `s` or `samples`.
    """

    channel: str
    num_samples: int
    num_windows: int
    num_disjoint: int
    before: State
    after: State
    notes: tuple[str, ...] = ()
    unit: str = "1"
    time_unit: str = "s"

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields in plain JSON types; numbers that are not finite become None."""
        plain = dataclasses.asdict(self) | {"notes": list(self.notes)}
        for name in ("before", "after"):
            plain[name] = {key: value if value is None or np.isfinite(value) else None for key, value in plain[name].items()}
        return plain

    def lines(self) -> list[str]:
        """Returns the report as lines of text."""
        before, after, unit = self.before, self.after, "" if self.unit == "1" else f" {self.unit}"
        clock = "no period"
        if before.period_s is not None and after.period_s is not None:
            clock = f"period {before.period_s:.6g} -> {after.period_s:.6g} {self.time_unit}, phase {before.phase:.3f} -> {after.phase:.3f}"
        lines = [
            f"{self.channel}: updated with {self.num_samples:,} samples; level {before.level:.5g} -> {after.level:.5g}{unit}, "
            f"gain {before.gain:.4g} -> {after.gain:.4g}, {clock}, noise {before.noise_sd:.4g} -> {after.noise_sd:.4g}{unit} (standard deviation)",
            f"{self.channel}: on {self.num_windows:,} held-out windows of it, {self.num_disjoint:,} of which share no sample: error "
            f"{before.error:.3f} -> {after.error:.3f} (NRMSE, median window), alarms of the residual detector {before.alarms:.0%} -> "
            f"{after.alarms:.0%}, at thresholds set for {RATE:.0%}",
            *(f"{self.channel}: {note}" for note in self.notes),
        ]
        return [printable(line) for line in lines]
