"""Goes on from a fitted simulator with newer nominal telemetry (step 3 of the pipeline, "respond to
situations on the vehicle").

A fit takes seconds, so the simulator is fitted again with its own options, and both are judged on
the held-out end of the new telemetry.
"""

import dataclasses
from typing import Any

from enhsim_tf.coarse.alignment import Paired
from enhsim_tf.common.errors import InputError, counted, printable
from enhsim_tf.common.measures import nrmse_of_channels
from enhsim_tf.fitting.fit import fit
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.fitting.report import alarms_of
from enhsim_tf.scoring.score import scorer_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Telemetry, check_telemetry

_NUM_WINDOWS = 300  # of the held-out end, on which errors are measured


@dataclasses.dataclass(frozen=True)
class State:
    """What an update compares of a simulator, by channel; level, gain and period are those of
    square waves.
    """

    nrmse: dict[str, float]
    noise_sd: dict[str, float]
    alarms: float  # share of samples above the threshold
    level: dict[str, float]
    gain: dict[str, float]
    period_s: dict[str, float]


@dataclasses.dataclass(frozen=True)
class UpdateReport:
    """What an update changed: what each simulator was fitted with, and its errors and alarms on the
    held-out end of the new telemetry, which neither has learnt; on all of it if none is held out.
    """

    channels: list[str]
    num_samples: int
    num_held_out: int
    before: State
    after: State

    def to_dict(self) -> dict[str, Any]:
        """Returns all fields in plain JSON types."""
        return dataclasses.asdict(self)

    def lines(self) -> list[str]:
        """Returns the report as lines of text."""
        all_of_them = ", ".join(self.channels)
        held_out = f"{self.num_held_out:,} held-out ones"
        lines = [
            f"{all_of_them}: updated with {self.num_samples:,} samples; judged on "
            f"{held_out if self.num_held_out else 'all'} of them"
        ]
        for name in self.channels:
            parts = []
            for what in ("level", "gain", "period_s", "noise_sd", "nrmse"):
                old = getattr(self.before, what).get(name)
                new = getattr(self.after, what).get(name)
                if old is not None and new is not None:
                    parts.append(f"{what.removesuffix('_s')} {old:.5g} -> {new:.5g}")
            lines.append(f"{name}: {', '.join(parts)}")
        lines.append(
            f"{all_of_them}: samples above the threshold {self.before.alarms:.1%} -> "
            f"{self.after.alarms:.1%}"
        )
        return [printable(line) for line in lines]


def update(
    simulator: EnhancedSimulator,
    telemetry: Telemetry,
    run: Telemetry | None = None,
    held_out: float = 0.2,
    seed: int = 0,
) -> tuple[EnhancedSimulator, UpdateReport]:
    """Updates a simulator with newer nominal telemetry.

    Args:
        simulator: The fitted simulator. It is not changed.
        telemetry: Newer nominal telemetry of its channels.
        run: The coarse run of the same time, for a simulator of recorded runs.
        held_out: Share of the new telemetry, taken from its end, on which both simulators are
            judged.
        seed: Random seed.

    Returns:
        The updated simulator, and the report on what changed.

    Raises:
        InputError: If the telemetry has other channels or another interval, or is too short.
    """
    check_telemetry(telemetry)
    if "options" not in simulator.trained:
        raise InputError(
            "Expected a simulator with the options of its fit. Received: one without. Make it with "
            "`fit`."
        )
    telemetry = simulator.named(telemetry)
    paired = simulator.pair(telemetry, run)
    options = FitOptions(**simulator.trained["options"] | {"held_out": held_out, "seed": seed})
    scorer = scorer_of(simulator)
    new, report = fit(telemetry, run, options)
    this = {"num_samples": len(telemetry), "held_out": held_out, "seed": seed}
    new.trained |= {"updates": [*simulator.trained.get("updates", ()), this]}
    window = max(simulator.window, new.window, scorer.window)
    judged = paired.split_end(held_out)[1] if report.is_held_out else paired
    judged = judged.long_enough(window)
    if judged is None:
        longest = counted(max(map(len, telemetry.parts)), "sample")
        raise InputError(
            f"Expected a part of at least {window} samples to judge both simulators on. Received: "
            f"{longest}, before the end is held out. Give longer parts, or another --held-out."
        )
    alarms, _ = alarms_of(scorer, simulator.judged_series(judged))
    before = _state(simulator, judged, alarms)
    # `new` has learnt the end, too; the alarms of its report are of views that have not
    after = _state(new, new.pair(judged.telemetry, run), report.false_alarms)
    held = len(judged) * report.is_held_out
    return new, UpdateReport(list(simulator.channels), len(telemetry), held, before, after)


def _state(simulator: EnhancedSimulator, paired: Paired, alarms: float) -> State:
    real, _, clean = simulator.windows_and_signals(paired, _NUM_WINDOWS)
    measured = {"nrmse": nrmse_of_channels(clean, real), "noise_sd": simulator.noise_sd}
    by_channel = {
        name: dict(zip(simulator.channels, values.tolist(), strict=True))
        for name, values in measured.items()
    }
    return State(**by_channel, alarms=alarms, **simulator.alignment.state())
