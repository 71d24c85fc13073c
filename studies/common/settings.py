"""The settings of the studies, each with its unit and the reason for its value, beside those of the
paper's pipeline.
"""

import dataclasses
from typing import Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.paper import settings as of_paper


def setting(value: Any, about: str, smoke: Any = None) -> Any:
    """A field of a group of settings, all of them choices of this project unless `about` says
    otherwise.

    Args:
        value: Its value at the full budget.
        about: Its unit, and the reason for its value.
        smoke: The value at the smoke budget, if it differs.
    """
    return dataclasses.field(default=value, metadata={"about": about, "smoke": smoke})


@dataclasses.dataclass(frozen=True)
class RobustnessSettings:
    """The study of robustness: `python -m studies.robustness`."""

    num_seeds: int = setting(5, "seeds: four kinds of noise with each", smoke=2)
    first_seed: int = setting(
        0, "seed: the seeds of the study of readings, whose networks are the same with white noise"
    )
    num_windows: int = setting(
        1_000,
        "windows: training windows of each arm; as many held-out windows set its threshold",
        smoke=200,
    )
    num_anomalous: int = setting(
        150,
        "windows: anomalous windows of each kind and severity, the same places for all kinds, "
        "severities and arms",
        smoke=6,
    )
    num_resplits: int = setting(
        40,
        "re-splits: maximum number of resamples for the real-vs-real baseline; fewer for expensive "
        "measures",
        smoke=5,
    )
    false_alarm_rate: float = setting(
        0.01, "share: target rate of each threshold, on held-out windows of the training arm"
    )


@dataclasses.dataclass(frozen=True)
class SecondSettings:
    """The residual pipeline of the factorial study: noise is the residual of the enhancer."""

    num_windows: int = setting(
        15_000,
        "windows: more windows, so that the enhancer does not memorise their noise",
        smoke=60,
    )
    epochs: int = setting(
        2, "epochs: fewer epochs: half the paper's steps, with a decaying learning rate"
    )
    held_out: float = setting(
        0.0,
        "share: kept for the keys of finished runs; coarse windows repeat, so no windows need to "
        "be held out",
    )


@dataclasses.dataclass(frozen=True)
class ModesSettings:
    """The detailed test of degraded modes, a part of the study of robustness."""

    num_windows: int = setting(300, "windows: test windows in each mode at each severity", smoke=40)
    num_learnt: int = setting(
        15_000, "windows: of all modes, for the methods that learn from faults", smoke=60
    )
    windows_per_configuration: int = setting(50, "windows: 300 configurations are sampled", smoke=5)


@dataclasses.dataclass(frozen=True)
class NoiseModelsSettings:
    """The study of noise models: `python -m studies.noise_models`."""

    num_seeds: int = setting(
        2, "seeds: fourteen families take hours for each seed; --seeds asks for more", smoke=1
    )
    first_seed: int = setting(3_008, "seed: models and rule were fixed before it")
    num_windows: int = setting(
        5_000, "windows: windows of true noise that the models learn", smoke=120
    )
    num_steps: int = setting(
        600,
        "steps: of the mixture density network; its error on held-out noise falls no further",
        smoke=2,
    )
    num_anomalous: int = setting(
        30, "windows: anomalous windows of each kind and severity", smoke=3
    )


@dataclasses.dataclass(frozen=True)
class FewWindowsSettings:
    """The study of few windows: `python -m studies.few_windows`."""

    num_seeds: int = setting(10, "seeds: as in the experiment on robustness", smoke=1)
    first_seed: int = setting(4_000, "seed: no design was chosen on these seeds")
    num_real: tuple[int, ...] = setting(
        (5, 10, 20, 50, 100, 300, 1_000, 10_000),
        "windows: disjoint windows of the real record",
        smoke=(5, 20),
    )
    num_windows: int = setting(
        1_500, "windows: most windows for training, as many as the paper's enhancer", smoke=60
    )
    num_judged: int = setting(
        1_000, "windows: disjoint test windows, and as many for the matched rate", smoke=40
    )
    num_anomalous: int = setting(60, "windows: test windows with an anomaly of each kind", smoke=6)


@dataclasses.dataclass(frozen=True)
class FactorialSettings:
    """The factorial study: `python -m studies.factorial`. Its other settings are those of
    robustness.
    """

    num_seeds: int = setting(5, "seeds: 24 cells for each", smoke=1)
    first_seed: int = setting(2_000, "seed: designs were chosen on 100 to 199")
    max_order: int = setting(
        200, "samples: largest order of the fitted autoregression; AIC selects the order", smoke=40
    )


@dataclasses.dataclass(frozen=True)
class PublicBenchmarksSettings:
    """The study of public telemetry with labels: `python -m studies.public_benchmarks`."""

    num_seeds: int = setting(1, "seeds: series are the replicates; only two methods draw")
    first_seed: int = setting(0, "seed: the first one")
    num_tried: int = setting(9, "settings: of a method that are tried, all of them", smoke=1)
    false_alarm_rate: float = setting(0.01, "share: the default of `score`")


@dataclasses.dataclass(frozen=True)
class BatterySettings:
    """The study of a pair of battery simulators: `python -m studies.battery`."""

    num_seeds: int = setting(10, "seeds: as in the experiment on robustness", smoke=1)
    first_seed: int = setting(3_000, "seed: designs were chosen on seeds below")
    fit_orbits: int = setting(
        60, "orbits: four days of telemetry, to which the simulator is fitted", smoke=4
    )
    more_orbits: int = setting(
        60, "orbits: as many again, for detectors trained on more real telemetry", smoke=4
    )
    test_orbits: int = setting(60, "orbits: four days on which everything is judged", smoke=4)
    coarse_orbits: int = setting(
        120, "orbits: coarse runs from which training data are generated", smoke=8
    )
    fault_orbits: int = setting(
        4, "orbits: orbits under each fault at each severity, in both simulators", smoke=1
    )


@dataclasses.dataclass(frozen=True)
class ReferenceOrSourceSettings:
    """The study of what a simulator is worth having for: `python -m
    studies.reference_or_source`.
    """

    num_seeds: int = setting(10, "seeds: as in the other studies", smoke=1)
    first_seed: int = setting(5_000, "seed: designs were chosen on seed 900")
    known_windows: int = setting(
        100,
        "windows: known telemetry, from which on the battery's reference gains little",
        smoke=30,
    )
    test_windows: int = setting(
        300, "windows: nominal time on which false alarms are counted", smoke=20
    )
    source_windows: int = setting(
        300, "windows: coarse runs from which training data are generated", smoke=20
    )
    parameter_windows: int = setting(
        20, "windows: telemetry to which parameters of the simulator are fitted", smoke=5
    )
    fault_windows: int = setting(20, "windows: under each fault at each severity", smoke=5)


@dataclasses.dataclass(frozen=True)
class Settings:
    """The settings of the paper's pipeline, the kind of noise in its telemetry, and the settings of
    each study.
    """

    paper: of_paper.Settings
    noise: str = setting(
        "white", "kind of noise: the simplest; `noise_processes.GALLERY` has others"
    )
    second: SecondSettings = SecondSettings()
    robustness: RobustnessSettings = RobustnessSettings()
    modes: ModesSettings = ModesSettings()
    factorial: FactorialSettings = FactorialSettings()
    noise_models: NoiseModelsSettings = NoiseModelsSettings()
    few_windows: FewWindowsSettings = FewWindowsSettings()
    public_benchmarks: PublicBenchmarksSettings = PublicBenchmarksSettings()
    battery: BatterySettings = BatterySettings()
    reference_or_source: ReferenceOrSourceSettings = ReferenceOrSourceSettings()
    budget: str = "full"

    @property
    def seed(self) -> int:
        """Seed of all random draws."""
        return self.paper.seed

    def of(self, noise: str, seed: int) -> "Settings":
        """The same settings with another kind of noise and another seed; training ends after the
        paper's iterations.
        """
        return dataclasses.replace(
            self, noise=noise, paper=dataclasses.replace(self.paper, seed=seed, rounds=1)
        )


def make_settings(budget: str = "full", **changed: Any) -> Settings:
    """The settings at a budget, with some of them changed.

    Args:
        budget: `full`, or `smoke` for smaller counts.
        **changed: Values as `group__field=value`, for example `robustness__num_seeds=2` or
          `paper__seed=1`.

    Raises:
        InputError: If a group does not exist.
    """
    values: dict[str, dict[str, Any]] = {}
    for name, value in changed.items():
        group, _, field = name.partition("__")
        values.setdefault(group, {})[field] = value
    # only claim C4 looks beyond the paper's number of iterations
    made: dict[str, Any] = {
        "paper": of_paper.make_settings(budget, **{"rounds": 1} | values.pop("paper", {}))
    }
    groups = {
        field.name: field.type
        for field in dataclasses.fields(Settings)
        if dataclasses.is_dataclass(field.default)
    }
    for name, kind in groups.items():
        smaller = {
            field.name: field.metadata["smoke"]
            for field in dataclasses.fields(kind)
            if budget == "smoke" and field.metadata["smoke"] is not None
        }
        made[name] = kind(**smaller | values.pop(name, {}))
    if values:
        raise InputError(
            f"Expected settings of one of the groups paper, {', '.join(groups)}. Received: "
            f"{min(values)!r}."
        )
    return Settings(**made, budget=budget)
