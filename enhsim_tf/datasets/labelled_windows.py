"""Labelled windows: the plan of a set of them, and writing them to Parquet files, all to one, or
each shard to a file of its own.

The windows of a shard depend only on the plan and the number of the shard, which has a random seed
of its own. The bytes of a shard are therefore the same in every worker and in every order of
generation. Two plans with the same `Plan.key` describe the same shards.
"""

import contextlib
import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.common.atomic_files import replace_file, sha256
from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.datasets.label_columns import window_table
from enhsim_tf.datasets.places import ScenarioRange
from enhsim_tf.simulator.model_folder import MANIFEST
from enhsim_tf.simulator.simulator import EnhancedSimulator

FORMAT = "enhsim_tf.datasets.generate/5"
MOST_WINDOWS = 10**10
_SHARD = 8_000  # windows per shard, for windows of up to 500 samples
_SHARD_VALUES = 4_000_000  # values per shard, for longer windows
_VERSIONS = ("numpy", "pyarrow")
_STREAM = 0x666C656574  # distinguishes these seeds from all others in the package
_KEY = b"settings"  # of the metadata of a file


@dataclasses.dataclass(frozen=True)
class Plan:
    """The plan of a set of labelled windows: its scenarios, and what it uses of its model, a saved
    simulator.
    """

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
            raise InputError(
                f"Expected 1 to {MOST_WINDOWS:,} windows. Received: --windows {self.num_windows}."
            )
        if self.nominal_share < 1 and round(self.num_windows * self.shares[-1], 6) < 1:
            raise InputError(
                "Expected at least one window for each of "
                f"{counted(len(self.scenarios), 'scenario')}. Received: "
                f"{counted(self.num_windows, 'window')}, of which a "
                f"share of {self.nominal_share:g} is nominal. Ask for more windows."
            )

    @property
    def shares(self) -> list[float]:
        """Shares of the nominal windows and of those of each scenario."""
        others = [(1 - self.nominal_share) / len(self.scenarios) for _ in self.scenarios]
        return [self.nominal_share, *others]

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.num_windows // self.shard)

    def num_windows_in(self, shard: int) -> int:
        """Returns the number of windows in a shard."""
        return min(self.shard, self.num_windows - shard * self.shard)

    def settings(self) -> dict[str, Any]:
        """Returns all settings on which the content depends, in plain JSON types. Paths are not
        among them.
        """
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

    def key(self) -> str:
        """Returns the checksum of all settings except the number of windows. Shards with equal key,
        number and size have identical bytes.
        """
        settings = self.settings()
        del settings["windows"]
        return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def make_plan(
    simulator: EnhancedSimulator,
    folder: str | os.PathLike,
    scenarios: Sequence[ScenarioRange],
    nominal_share: float,
    num_windows: int,
    seed: int,
) -> Plan:
    """Makes the plan of labelled windows of a simulator that is saved in a folder. Without
    scenarios, all of them are nominal.
    """
    folder = Path(folder).absolute()
    simulator.alignment.check(scenarios)
    window = simulator.window
    channels = simulator.channels
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


def shard_file(shard: int) -> str:
    """Returns the file name of a shard."""
    return f"shard-{shard:06d}.parquet"


def draw_scenarios(plan: Plan, shard: int) -> list[Degraded | None]:
    """Draws the scenario of each window of a shard, None if it is nominal. Each has its share of
    the windows, rounded at random.
    """
    rng = np.random.default_rng([_STREAM, plan.seed, shard])
    numbers = systematic(plan.shares, plan.num_windows_in(shard), rng)
    return [plan.scenarios[number - 1].draw(rng) if number else None for number in numbers.tolist()]


def systematic(shares: Sequence[float], num_rows: int, rng: np.random.Generator) -> np.ndarray:
    """Assigns rows to categories in random order by systematic sampling: each category gets its
    share, rounded up or down.
    """
    edges = np.cumsum(shares) / np.sum(shares)
    points = (rng.random() + np.arange(num_rows)) / num_rows
    return rng.permutation(
        np.minimum(np.searchsorted(edges, points, side="right"), np.flatnonzero(shares)[-1])
    )


def write_windows(
    path: str | os.PathLike,
    plan: Plan,
    simulator: EnhancedSimulator,
    shards: Iterable[int] | None = None,
) -> None:
    """Writes the windows of some shards to one Parquet file, chunk by chunk. The file appears only
    when it is complete.

    A window that its scenario has not changed, such as one in which the mechanism would have stood
    still anyway, is labelled nominal.

    Args:
        path: Path of the file.
        plan: The plan of the windows.
        simulator: The model of the plan.
        shards: Numbers of the shards. None: all of them, one after the other.
    """
    about = {
        "format": FORMAT,
        _KEY: plan.key(),
        "interval_s": repr(plan.interval_s),
        "channel": ", ".join(plan.channels),
    }
    none = np.zeros((0, plan.window, len(plan.channels)), np.float32)
    schema = window_table(none, none > 0, plan.channels, []).schema.with_metadata(about)
    # bytes of equal significance are stored together: signs and exponents compress well, noisy
    # mantissas do not
    encoding = {
        f"{name}.list.element": "BYTE_STREAM_SPLIT"
        for name in schema.names
        if name.startswith("window")
    }
    options = {
        "compression": "zstd",
        "use_dictionary": ["scenario"],
        "column_encoding": encoding,
        "write_statistics": ["scenario"],
    }
    with replace_file(path) as temporary, pq.ParquetWriter(temporary, schema, **options) as writer:
        for shard in range(plan.num_shards) if shards is None else shards:
            sequence = np.random.SeedSequence([_STREAM, plan.seed, shard, 1])
            seed = int(sequence.generate_state(1, np.uint64)[0])
            scenarios = draw_scenarios(plan, shard)
            for windows, masks in simulator.generate_labelled_chunks(scenarios, seed):
                drawn = scenarios[: len(windows)]
                scenarios = scenarios[len(windows) :]
                writer.write_table(window_table(windows, masks, plan.channels, drawn))


def finished_shards(folder: Path, plan: Plan) -> Iterator[tuple[int, str]]:
    """Yields number and checksum of the shards whose files are there and have the key and the
    number of windows of the plan.
    """
    key = plan.key().encode()
    for shard in range(plan.num_shards):
        path = folder / shard_file(shard)
        with contextlib.suppress(OSError, pa.ArrowException):  # no file, or one that is damaged
            file = pq.read_metadata(path)
            if (file.metadata or {}).get(_KEY) == key and file.num_rows == plan.num_windows_in(
                shard
            ):
                yield shard, sha256(path)


class ShardMaker:
    """Generates shards in one process. The model is loaded once; each call writes one file to the
    folder.
    """

    def __init__(self, plan: Plan, folder: str | os.PathLike):
        self.plan = plan
        self.folder = Path(folder).absolute()
        # computed on the main machine; workers on other machines must agree
        self.settings = plan.settings()

    @functools.cached_property
    def simulator(self) -> EnhancedSimulator:
        """The loaded model of the plan, if it is still the same, and the libraries of this machine
        too.
        """
        if self.plan.settings() != self.settings:
            versions = ", ".join(
                f"{name} {version}" for name, version in self.settings["versions"].items()
            )
            raise InputError(
                f"Expected every machine to have {versions}. Received: other versions on "
                f"{os.uname().nodename}. Install these."
            )
        simulator = EnhancedSimulator.load(self.plan.folder)
        if sha256(self.plan.folder / MANIFEST) != self.plan.sha256:
            raise InputError(
                "Expected the same model as at the start of the data set. Received: another model "
                f"in {self.plan.folder}."
            )
        return simulator

    def __call__(self, shard: int) -> tuple[int, str]:
        """Generates a shard, writes its file atomically, and returns its number and the checksum of
        the file.
        """
        path = self.folder / shard_file(shard)
        write_windows(path, self.plan, self.simulator, [shard])
        return shard, sha256(path)
