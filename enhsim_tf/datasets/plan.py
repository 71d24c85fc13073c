"""The plan of a large data set: its scenarios, the checksum of its model, its seed, and its division into shards.

Two plans with the same `plan_key` describe the same shards.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
import os
import urllib.parse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.mix import MOST_WINDOWS, Mix
from enhsim_tf.simulator.model_folder import MANIFEST
from enhsim_tf.simulator.simulator import EnhancedSimulator

FORMAT = "enhsim_tf.datasets.generate/4"
_SHARD = 8_192  # default windows per shard, for windows of up to 512 samples
_SHARD_VALUES = 2**22  # default values per shard, for longer windows
MOST_VALUES = 2**26  # maximum values per shard: 256 MiB, which a worker holds in memory
_VERSIONS = ("numpy", "pyarrow")


@dataclasses.dataclass(frozen=True)
class Plan:
    """The plan of a data set: its mix, and what it uses of its model, a saved simulator."""

    mix: Mix
    name: str
    folder: Path  # the content of the data set does not depend on it
    sha256: str  # of the manifest of the model, which contains the checksums of its files
    window: int
    interval_s: float
    channels: tuple[str, ...]
    seed: int
    num_windows: int
    shard: int  # windows per shard; the last one may have fewer

    def __post_init__(self):
        most, names = MOST_VALUES // (self.window * len(self.channels)), ", ".join(self.channels)[:200]
        for part in self.mix.scenarios:
            if part.channel not in (None, *self.channels):
                raise InputError(f"Expected a channel, one of: {names}. Received: {part.channel!r} in the scenario.")
        if not 1 <= self.num_windows <= MOST_WINDOWS:
            raise InputError(f"Expected 1 to {MOST_WINDOWS:,} windows. Received: {self.num_windows:,}.")
        if self.shard > most:
            raise InputError(f"Expected shards of at most {most:,} such windows. Received: shard: {self.shard:,}.")

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
            "interval_s": self.interval_s,
            **({"channels": self.channels} if len(self.channels) > 1 else {}),
            "nominal": self.mix.nominal,
            "scenarios": [{name: value for name, value in each.items() if value is not None} for each in scenarios],
            "model": {"name": self.name, "sha256": self.sha256},
            "versions": {name: importlib.metadata.version(name) for name in _VERSIONS},
        }
        return json.loads(json.dumps(settings))


def plan_key(settings: Mapping[str, Any]) -> str:
    """Returns the checksum of all settings except the number of windows. Shards with equal key, number and size have identical bytes."""
    others = {name: value for name, value in settings.items() if name != "windows"}
    return hashlib.sha256(json.dumps(others, sort_keys=True).encode()).hexdigest()


def make_plan(mix: Mix, folder: str | os.PathLike, seed: int, num_windows: int) -> Plan:
    """Makes the plan of a data set from a saved simulator, of which it reads window length, interval, channels and checksum."""
    folder = Path(folder).absolute()
    simulator = EnhancedSimulator.load(folder)
    if mix.scenarios and simulator.is_run_model:
        raise InputError(
            f"Expected no scenario of a model of recorded runs. Received: {mix.scenarios[0].mode} for {folder}. "
            "Simulate it and give the run: generate MODEL_DIR --coarse fault_run.csv."
        )
    name, window, channels = urllib.parse.unquote(folder.name), simulator.window, simulator.channels
    shard = mix.shard or max(1, min(_SHARD, _SHARD_VALUES // (window * len(channels))))
    return Plan(mix, name, folder, sha256(folder / MANIFEST), window, simulator.interval_s, channels, seed, num_windows, shard)
