"""What a large data set is mixed from, and the YAML file that says so: shares of scenarios, severities, models.

The file is read with limits on its size and depth, without aliases, tags or repeated keys, and every mistake is named
with its place: `scenarios[2].severity`. docs/scenarios.md describes it.
"""

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import PurePosixPath

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.yaml_file import Place, load_settings

MOST_WINDOWS = 10**10
MOST_SCENARIOS = 1_000
MOST_MODELS = 20  # each worker holds all of them
_LATEST_ONSET = 0.999


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
    late = [each.onset for each in scenarios if each.onset > _LATEST_ONSET]
    if late:
        raise InputError(f"Expected an onset from 0 to {_LATEST_ONSET}. Received: {late[0]}. Choose an earlier one.")
    share = (1 - nominal_share) / len(scenarios)
    parts = [ScenarioShare(each.mode, share, (each.severity,) * 2, (each.onset,) * 2) for each in scenarios]
    return Mix(nominal_share, tuple(parts))


def read_mix(path: str | os.PathLike) -> Mix:
    """Reads and checks a scenario file.

    Raises:
        InputError: If it cannot be read or anything in it is not as described; the line names the place.
    """
    content = load_settings(path)
    content.allow("windows", "seed", "shard", "nominal", "scenarios", "models")
    scenarios = [_scenario_of(each) for each in content.children("scenarios", MOST_SCENARIOS)]
    shared = math.fsum(scenario.share for scenario in scenarios)
    nominal = content.number("nominal", 0, 1, max(0.0, 1 - shared))
    content.add_up("nominal and the shares of the scenarios", nominal + shared)

    children = content.children("models", MOST_MODELS)
    models = [_model_of(each, len(children)) for each in children]
    if models:
        content.add_up("the shares of the models", math.fsum(model.share for model in models))
    for number, model in enumerate(models):
        if model.name in [before.name for before in models[:number]]:
            raise children[number].refuse("a name that no other model has", model.name, "name")
    return Mix(
        nominal,
        tuple(scenarios),
        tuple(models),
        content.whole("windows", 1, MOST_WINDOWS),
        content.whole("seed", 0, 2**31 - 1),
        content.whole("shard", 1, 10_000_000),
    )


def _scenario_of(content: Place) -> ScenarioShare:
    content.allow("mode", "share", "severity", "onset")
    mode = content.get("mode")
    if not isinstance(mode, str) or mode not in MODES:
        raise content.refuse(f"a mode, one of {', '.join(MODES)}", mode, "mode")
    severity = content.range("severity", 1.0)
    return ScenarioShare(mode, content.number("share", 0, 1), severity, content.range("onset", _LATEST_ONSET, (0.25, 0.25)))


def _model_of(content: Place, num_models: int) -> ModelShare:
    content.allow("folder", "name", "share")
    folder = content.text("folder")
    parts = PurePosixPath(folder).parts
    if folder.startswith("/") or ".." in parts or "\\" in folder or not parts:
        raise content.refuse("a folder inside MODEL_DIR, such as vehicle-1/volts", folder, "folder")
    name = content.text("name", "/".join(parts))
    return ModelShare(name, "/".join(parts), content.number("share", 0, 1, 1 / num_models))
