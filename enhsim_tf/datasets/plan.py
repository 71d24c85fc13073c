"""The plan of a large data set: its scenarios, the checksums of its models, its seed, and its division into shards.

Two plans with the same `plan_key` describe the same shards.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.mix import MOST_WINDOWS, Mix
from enhsim_tf.simulator.model_folder import MANIFEST
from enhsim_tf.simulator.simulator import EnhancedSimulator

FORMAT = "enhsim_tf.datasets.generate/3"
_SHARD = 8_192  # default windows per shard, for windows of up to 512 samples
_SHARD_VALUES = 2**22  # default values per shard, for longer windows
MOST_VALUES = 2**26  # maximum values per shard: 256 MiB, which a worker holds in memory
_VERSIONS = ("numpy", "pyarrow")


@dataclasses.dataclass(frozen=True)
class Model:
    """A saved simulator that a plan uses."""

    name: str  # label of its windows in the column `model`
    folder: Path  # the content of the data set does not depend on it
    share: float  # of the windows
    sha256: str  # of its manifest, which contains the checksums of its files
    window: int
    interval_s: float
    channels: tuple[str, ...] = ("",)


@dataclasses.dataclass(frozen=True)
class Plan:
    """The plan of a data set. Its models have the same window length, sampling interval and channels."""

    mix: Mix
    models: tuple[Model, ...]
    seed: int
    num_windows: int
    shard: int  # windows per shard; the last one may have fewer

    def __post_init__(self):
        first, most = self.models[0], MOST_VALUES // (self.window * len(self.channels))
        for model in self.models:
            if model.window != first.window or abs(model.interval_s / first.interval_s - 1) > 1e-3:
                raise InputError(
                    f"Expected all models to have the same window and interval: {first.window} samples of {first.interval_s:g} s, as {first.name!r}. "
                    f"Received: {model.window} samples of {model.interval_s:g} s in {model.name!r}."
                )
            if len(model.channels) != len(first.channels) or (len(first.channels) > 1 and model.channels != first.channels):
                raise InputError(
                    f"Expected models of the same channels: {', '.join(first.channels)[:120]}. Received: {', '.join(model.channels)[:120]} in {model.name!r}."
                )
            other = [part.channel for part in self.mix.scenarios if part.channel not in (None, *model.channels)]
            if other:
                names = ", ".join(model.channels)[:200]
                raise InputError(f"Expected a channel, one of: {names}. Received: {other[0]!r} in the scenario.")
        if not 1 <= self.num_windows <= MOST_WINDOWS:
            raise InputError(f"Expected 1 to {MOST_WINDOWS:,} windows. Received: {self.num_windows:,}.")
        if self.shard > most:
            raise InputError(f"Expected shards of at most {most:,} such windows. Received: shard: {self.shard:,}.")

    @property
    def window(self) -> int:
        """Length of a window in samples."""
        return self.models[0].window

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        return self.models[0].channels

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.num_windows // self.shard)

    def num_windows_in(self, shard: int) -> int:
        """Returns the number of windows in a shard."""
        return min(self.shard, self.num_windows - shard * self.shard)

    def settings(self) -> dict[str, Any]:
        """Returns all settings on which the content depends, in plain JSON types. Paths are not among them."""
        scenarios = [dataclasses.asdict(part) for part in self.mix.scenarios]
        settings = {
            "windows": self.num_windows,
            "shard": self.shard,
            "seed": self.seed,
            "window": self.window,
            "interval_s": self.models[0].interval_s,
            **({"channels": self.channels} if len(self.channels) > 1 else {}),
            "nominal": self.mix.nominal,
            "scenarios": [{name: value for name, value in each.items() if value is not None} for each in scenarios],
            "models": [{"name": model.name, "share": model.share, "sha256": model.sha256} for model in self.models],
            "versions": {name: importlib.metadata.version(name) for name in _VERSIONS},
        }
        return json.loads(json.dumps(settings))


def plan_key(settings: Mapping[str, Any]) -> str:
    """Returns the checksum of all settings except the number of windows. Shards with equal key, number and size have identical bytes."""
    others = {name: value for name, value in settings.items() if name != "windows"}
    return hashlib.sha256(json.dumps(others, sort_keys=True).encode()).hexdigest()


def make_plan(mix: Mix, folder: str | os.PathLike, seed: int, num_windows: int, name: str | None = None) -> Plan:
    """Makes the plan of a data set. If the mix names no models, `folder` itself is the only one, and `name` the name of it or of its folder."""
    folder = Path(folder).absolute()
    models = tuple(_model_of(each.name, folder / each.folder, each.share, mix) for each in mix.models)
    models = models or (_model_of(name or folder.name, folder, 1.0, mix),)
    values = models[0].window * len(models[0].channels)
    return Plan(mix, models, seed, num_windows, mix.shard or max(1, min(_SHARD, _SHARD_VALUES // values)))


def _model_of(name: str, folder: Path, share: float, mix: Mix) -> Model:
    """Reads window length, interval and channels of a saved simulator, and the checksum of its manifest."""
    simulator = EnhancedSimulator.load(folder)
    if mix.scenarios and simulator.is_run_model:
        raise InputError(
            f"Expected no scenario of a model of recorded runs. Received: {mix.scenarios[0].mode} for {folder}. "
            "Simulate it and give the run: generate MODEL_DIR --coarse fault_run.csv."
        )
    return Model(name, folder, share, sha256(folder / MANIFEST), simulator.window, simulator.interval_s, simulator.channels)
