"""The mix of a large data set: which scenarios and models it has, and their shares."""

import dataclasses
from collections.abc import Sequence

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.common.errors import InputError

MOST_WINDOWS = 10**10
MOST_SCENARIOS = 1_000
MOST_MODELS = 20  # each worker holds all models in memory
LATEST_ONSET = 0.999


@dataclasses.dataclass(frozen=True)
class ScenarioShare:
    """A degraded mode and its share of the windows.

    Args:
        mode: One of `degraded.MODES`.
        share: Share of all windows.
        severity: Minimum and maximum severity. The severity of each window is drawn uniformly between them.
        onset: Minimum and maximum onset as a share of the window, drawn in the same way.
        channel: The only channel that is degraded; None for all.
    """

    mode: str
    share: float
    severity: tuple[float, float]
    onset: tuple[float, float]
    channel: str | None = None


@dataclasses.dataclass(frozen=True)
class ModelShare:
    """A model and its share of the windows.

    Args:
        name: Label of its windows in the column `model`.
        folder: Folder of the model, relative to the folder of all models.
        share: Share of all windows.
    """

    name: str
    folder: str
    share: float


@dataclasses.dataclass(frozen=True)
class Mix:
    """The composition of a data set: scenarios and models with their shares.

    Args:
        nominal: Share of nominal windows. This share and those of the scenarios add up to one.
        scenarios: The degraded modes.
        models: The models. If empty, the options of the command select the models.
        num_windows: Total number of windows, or None if the file does not contain it.
        seed: Master seed of the data set, or None.
        shard: Windows per file, or None for the default.
    """

    nominal: float = 1.0
    scenarios: tuple[ScenarioShare, ...] = ()
    models: tuple[ModelShare, ...] = ()
    num_windows: int | None = None
    seed: int | None = None
    shard: int | None = None


def make_mix(scenarios: Sequence[Degraded], nominal_share: float) -> Mix:
    """Makes the mix given by the options `--scenario` and `--nominal-share`. All scenarios get equal shares.

    Args:
        scenarios: Degraded modes. If there is none, all windows are nominal.
        nominal_share: Share of nominal windows.

    Raises:
        InputError: If the share or an onset is out of range.
    """
    if not 0 <= nominal_share <= 1:
        raise InputError(f"Expected a nominal share from 0 to 1. Received: {nominal_share}.")
    if not scenarios:
        return Mix()
    late = [each.onset for each in scenarios if each.onset > LATEST_ONSET]
    if late:
        raise InputError(f"Expected an onset from 0 to {LATEST_ONSET}. Received: {late[0]}. Choose an earlier one.")
    share = (1 - nominal_share) / len(scenarios)
    parts = [ScenarioShare(each.mode, share, (each.severity,) * 2, (each.onset,) * 2, each.channel) for each in scenarios]
    return Mix(nominal_share, tuple(parts))
