"""The plan of a set of labelled windows: scenarios, the checksum of its model, its seed, and its division into shards.

Two plans with the same `plan_key` describe the same shards.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.datasets.places import ScenarioRange
from enhsim_tf.simulator.model_folder import MANIFEST
from enhsim_tf.simulator.simulator import EnhancedSimulator

FORMAT = "enhsim_tf.datasets.generate/5"
MOST_WINDOWS = 10**10
_SHARD = 8_000  # windows per shard, for windows of up to 500 samples
_SHARD_VALUES = 4_000_000  # values per shard, for longer windows
_VERSIONS = ("numpy", "pyarrow")


@dataclasses.dataclass(frozen=True)
class Plan:
    """The plan of a set of labelled windows: its scenarios, and what it uses of its model, a saved simulator."""

    scenarios: tuple[ScenarioRange, ...]  # with equal shares of the windows that are not nominal
    nominal_share: float
    folder: Path  # the content of the windows does not depend on it
    sha256: str  # of the manifest of the model, which contains the checksums of its files
    window: int
    interval_s: float
    channels: tuple[str, ...]
    seed: int
    num_windows: int
    shard: int  # windows per shard; the last one may have fewer

    def __post_init__(self):
        if not 1 <= self.num_windows <= MOST_WINDOWS:
            raise InputError(f"Expected 1 to {MOST_WINDOWS:,} windows. Received: --windows {self.num_windows}.")
        if self.nominal_share < 1 and round(self.num_windows * self.shares[-1], 6) < 1:
            raise InputError(
                f"Expected at least one window for each of {len(self.scenarios)} scenarios. Received: {counted(self.num_windows, 'window')}, of which a "
                f"share of {self.nominal_share:g} is nominal. Ask for more windows."
            )

    @property
    def shares(self) -> list[float]:
        """Shares of the nominal windows and of those of each scenario."""
        return [self.nominal_share, *[(1 - self.nominal_share) / len(self.scenarios) for _ in self.scenarios]]

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.num_windows // self.shard)

    def num_windows_in(self, shard: int) -> int:
        """Returns the number of windows in a shard."""
        return min(self.shard, self.num_windows - shard * self.shard)

    def settings(self) -> dict[str, Any]:
        """Returns all settings on which the content depends, in plain JSON types. Paths are not among them."""
        settings = {
            "windows": self.num_windows,
            "shard": self.shard,
            "seed": self.seed,
            "window": self.window,
            "interval_s": self.interval_s,
            "channels": self.channels,
            "nominal": self.nominal_share,
            "scenarios": [dataclasses.asdict(scenario) for scenario in self.scenarios],
            "model": self.sha256,
            "versions": {name: importlib.metadata.version(name) for name in _VERSIONS},
        }
        return json.loads(json.dumps(settings))


def plan_key(settings: Mapping[str, Any]) -> str:
    """Returns the checksum of all settings except the number of windows. Shards with equal key, number and size have identical bytes."""
    others = {name: value for name, value in settings.items() if name != "windows"}
    return hashlib.sha256(json.dumps(others, sort_keys=True).encode()).hexdigest()


def make_plan(
    simulator: EnhancedSimulator,
    folder: str | os.PathLike,
    scenarios: Sequence[ScenarioRange],
    nominal_share: float,
    num_windows: int,
    seed: int,
) -> Plan:
    """Makes the plan of labelled windows of a simulator that is saved in a folder. Without scenarios, all of them are nominal."""
    folder = Path(folder).absolute()
    rng = np.random.default_rng(0)
    simulator.alignment.draw(np.zeros(len(scenarios), int), [each.draw(rng) for each in scenarios], rng)  # refuses what it cannot apply
    window, channels = simulator.window, simulator.channels
    return Plan(
        tuple(scenarios),
        nominal_share if scenarios else 1.0,
        folder,
        sha256(folder / MANIFEST),
        window,
        simulator.interval_s,
        channels,
        seed,
        num_windows,
        max(1, min(_SHARD, _SHARD_VALUES // (window * len(channels)))),
    )
