"""What a large data set is mixed from, and the YAML file that says so: shares of scenarios, severities, models.

docs/scenarios.md describes the file, `scenario_form` checks it.
"""

import dataclasses
import os
from collections.abc import Sequence

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.common.errors import InputError

MOST_WINDOWS = 10**10
MOST_SCENARIOS = 1_000
MOST_MODELS = 20  # each worker holds all of them
LATEST_ONSET = 0.999


@dataclasses.dataclass(frozen=True)
class ScenarioShare:
    """A degraded mode with its share of the windows.

    Args:
        mode: One of `simulator.MODES`.
        share: Its share of all windows.
        severity: Lowest and highest severity; each window has its own, drawn evenly between them.
        onset: Lowest and highest onset, as a share of the window; drawn in the same way.
    """

    mode: str
    share: float
    severity: tuple[float, float]
    onset: tuple[float, float]


@dataclasses.dataclass(frozen=True)
class ModelShare:
    """A model with its share of the windows.

    Args:
        name: What its windows are labelled with.
        folder: Its folder, relative to that of all models.
        share: Its share of all windows.
    """

    name: str
    folder: str
    share: float


@dataclasses.dataclass(frozen=True)
class Mix:
    """What a data set is mixed from.

    Args:
        nominal: Share of nominal windows; with the scenarios' shares it adds up to one.
        scenarios: The degraded modes.
        models: The models; none leaves the choice to the command.
        num_windows: Windows in all, or None where the file does not say.
        seed: The master seed, or None.
        shard: Windows a file, or None for the default.
    """

    nominal: float = 1.0
    scenarios: tuple[ScenarioShare, ...] = ()
    models: tuple[ModelShare, ...] = ()
    num_windows: int | None = None
    seed: int | None = None
    shard: int | None = None


def mix_of(scenarios: Sequence[Degraded], nominal_share: float) -> Mix:
    """The mix that the options `--scenario` and `--nominal-share` ask for: the scenarios share evenly what is not nominal."""
    if not 0 <= nominal_share <= 1:
        raise InputError(f"Expected a nominal share from 0 to 1. Received: {nominal_share}.")
    if not scenarios:
        return Mix()
    late = [each.onset for each in scenarios if each.onset > LATEST_ONSET]
    if late:
        raise InputError(f"Expected an onset from 0 to {LATEST_ONSET}. Received: {late[0]}. Choose an earlier one.")
    share = (1 - nominal_share) / len(scenarios)
    parts = [ScenarioShare(each.mode, share, (each.severity,) * 2, (each.onset,) * 2) for each in scenarios]
    return Mix(nominal_share, tuple(parts))


def read_mix(path: str | os.PathLike) -> Mix:
    """Reads and checks a scenario file.

    Raises:
        InputError: If it cannot be read or anything in it is not as described; the line names the place.
    """
    from enhsim_tf.common.yaml_file import load_settings  # here, as the form below: both load pydantic
    from enhsim_tf.datasets.scenario_form import ScenarioFile

    file = load_settings(path, ScenarioFile)
    scenarios = tuple(ScenarioShare(**dict(each)) for each in file.scenarios)
    models = tuple(ModelShare(**dict(each)) for each in file.models)
    return Mix(file.nominal, scenarios, models, file.windows, file.seed, file.shard)
