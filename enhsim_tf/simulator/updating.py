"""Goes on from a fitted simulator with newer nominal telemetry (step 3 of the pipeline, "respond to situations on the vehicle").

A fit takes seconds, so the simulator is fitted again with its own options, and both are judged on the held-out end of the new telemetry.
"""

import dataclasses
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import printable
from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.joint import long_enough, nrmse, split_end
from enhsim_tf.simulator.options import FitOptions, ScoreOptions
from enhsim_tf.simulator.scoring import Scorer, check_fits
from enhsim_tf.simulator.simulator import EnhancedSimulator

_NUM_WINDOWS = 300  # of the held-out end, on which errors are measured


@dataclasses.dataclass(frozen=True)
class UpdateReport:
    """What an update changed: what each simulator was fitted with, and its errors and alarms on the held-out end of the new telemetry."""

    channels: list[str]
    num_samples: int
    num_held_out: int
    before: dict[
        str, Any
    ]  # `level`, `gain`, `period_s`, `noise_sd` and `nrmse` by channel, and `alarms`, the share of flagged samples
    after: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields in plain JSON types."""
        return dataclasses.asdict(self)

    def lines(self) -> list[str]:
        """Returns the report as lines of text."""
        all_of_them = ", ".join(self.channels)
        lines = [
            f"{all_of_them}: updated with {self.num_samples:,} samples; judged on {self.num_held_out:,} held-out ones of them"
        ]
        for name in self.channels:
            parts = []
            for what in ("level", "gain", "period_s", "noise_sd", "nrmse"):
                old, new = self.before[what].get(name), self.after[what].get(name)
                if old is not None and new is not None:
                    parts.append(f"{what.removesuffix('_s')} {old:.5g} -> {new:.5g}")
            lines.append(f"{name}: {', '.join(parts)}")
        lines.append(
            f"{all_of_them}: flagged samples {self.before['alarms']:.1%} -> {self.after['alarms']:.1%}, set for 1 %"
        )
        return [printable(line) for line in lines]


def update(
    simulator: EnhancedSimulator,
    telemetry: Recording,
    run: Recording | None = None,
    held_out: float = 0.2,
    seed: int = 0,
) -> tuple[EnhancedSimulator, UpdateReport]:
    """Updates a simulator with newer nominal telemetry.

    Args:
        simulator: The fitted simulator. It is not changed.
        telemetry: Newer nominal telemetry of its channels.
        run: The coarse run of the same time, for a simulator of recorded runs.
        held_out: Share of the new telemetry, taken from its end, on which both simulators are judged.
        seed: Random seed.

    Returns:
        The updated simulator, and the report on what changed.

    Raises:
        InputError: If the telemetry has other channels or another interval, or is too short.
    """
    check_fits(simulator, telemetry, run)
    options = FitOptions(**simulator.trained["options"] | {"held_out": held_out, "seed": seed})
    telemetry = dataclasses.replace(telemetry, columns=simulator.channels)
    new, _ = fit(telemetry, run, options)
    new.trained["updates"] = [
        *simulator.trained.get("updates", ()),
        {"num_samples": len(telemetry), "held_out": held_out, "seed": seed},
    ]
    window = max(simulator.window, new.window)
    judged = telemetry if run is None else simulator.recorded_runs().pair(telemetry, run)[0]
    end = long_enough(split_end(judged, held_out)[1], window) or long_enough(judged, window)
    before, after = (_state(each, end, run, seed) for each in (simulator, new))
    return new, UpdateReport(list(simulator.channels), len(telemetry), len(end), before, after)


def _state(
    simulator: EnhancedSimulator, telemetry: Recording, run: Recording | None, seed: int
) -> dict[str, Any]:
    if run is not None:
        telemetry, run = simulator.recorded_runs().pair(telemetry, run)
    real, clean = simulator.windows_and_signal(telemetry, run, _NUM_WINDOWS)
    found: dict[str, Any] = {"level": {}, "gain": {}, "period_s": {}}
    if run is None:
        waves = zip(
            simulator.channels,
            simulator.alignment.simulators,
            np.median(simulator.levels, axis=0).tolist(),
            strict=True,
        )
        for name, wave, (found["level"][name], found["gain"][name]) in waves:
            if not wave.is_constant:
                found["period_s"][name] = float(wave.waves[0].period_s)
    for what, each in (("nrmse", nrmse(clean, real)), ("noise_sd", simulator.noise_sd)):
        found[what] = dict(zip(simulator.channels, each.tolist(), strict=True))
    scorer = Scorer(simulator, ScoreOptions(seed=seed))
    flags = np.concatenate(
        [scorer.score_series(each) > 1 for each in simulator.judged_series(telemetry, run)]
    )
    return found | {"alarms": float(flags.mean())}
