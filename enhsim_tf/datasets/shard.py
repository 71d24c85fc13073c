"""Generates labelled windows and writes them to Parquet files: all of them to one, or each shard to a file of its own.

The windows of a shard depend only on the plan and the number of the shard, which has a random seed of its own. The bytes of a shard are
therefore the same in every worker and in every order of generation.
"""

import contextlib
import functools
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.common.atomic_files import replace_file, sha256
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.label_columns import NOMINAL, parquet_options, window_schema, window_table
from enhsim_tf.datasets.plan import FORMAT, Plan, plan_key
from enhsim_tf.simulator.model_folder import MANIFEST
from enhsim_tf.simulator.simulator import EnhancedSimulator

_STREAM = 0x666C656574  # distinguishes these seeds from all others in the package
_KEY = b"settings"  # of the metadata of a file


def shard_file(shard: int) -> str:
    """Returns the file name of a shard."""
    return f"shard-{shard:06d}.parquet"


def draw_scenarios(plan: Plan, shard: int) -> list[Degraded | None]:
    """Draws the scenario of each window of a shard, None if it is nominal. Each has its share of the windows, rounded at random."""
    rng = np.random.default_rng([_STREAM, plan.seed, shard])
    numbers = systematic(plan.shares, plan.num_windows_in(shard), rng)
    return [plan.scenarios[number - 1].draw(rng) if number else None for number in numbers.tolist()]


def systematic(shares: Sequence[float], num_rows: int, rng: np.random.Generator) -> np.ndarray:
    """Assigns rows to categories in random order by systematic sampling: each category gets its share, rounded up or down."""
    edges = np.cumsum(shares) / np.sum(shares)
    points = (rng.random() + np.arange(num_rows)) / num_rows
    return rng.permutation(np.minimum(np.searchsorted(edges, points, side="right"), np.flatnonzero(shares)[-1]))


def write_windows(path: str | os.PathLike, plan: Plan, simulator: EnhancedSimulator, shards: Iterable[int] | None = None) -> None:
    """Writes the windows of some shards to one Parquet file, chunk by chunk. The file appears only when it is complete.

    A window that its scenario has not changed, such as one in which the mechanism would have stood still anyway, is labelled nominal.

    Args:
        path: Path of the file.
        plan: The plan of the windows.
        simulator: The model of the plan.
        shards: Numbers of the shards. None: all of them, one after the other.
    """
    about = {"format": FORMAT, _KEY: plan_key(plan.settings()), "interval_s": repr(plan.interval_s), "channel": ", ".join(plan.channels)}
    schema = window_schema(plan.window, plan.channels).with_metadata(about)
    with replace_file(path) as temporary, pq.ParquetWriter(temporary, schema, **parquet_options(schema)) as writer:
        for shard in range(plan.num_shards) if shards is None else shards:
            (seed,) = np.random.SeedSequence([_STREAM, plan.seed, shard, 1]).generate_state(1, np.uint64).tolist()
            scenarios, first = draw_scenarios(plan, shard), 0
            for windows, masks in simulator.generate_labelled_chunks(scenarios, seed):
                some, first = scenarios[first : first + len(windows)], first + len(windows)
                names, severities = zip(*((each.mode, each.severity) if each else (NOMINAL, 0.0) for each in some), strict=True)
                writer.write_table(window_table(windows, masks, plan.channels, names, severities))


def finished_shards(folder: Path, plan: Plan) -> Iterator[tuple[int, str]]:
    """Yields number and checksum of the shards whose files are there and have the key and the number of windows of the plan."""
    key = plan_key(plan.settings()).encode()
    for shard in range(plan.num_shards):
        path = folder / shard_file(shard)
        with contextlib.suppress(OSError, pa.ArrowException):  # no file, or one that is damaged
            file = pq.read_metadata(path)
            if (file.metadata or {}).get(_KEY) == key and file.num_rows == plan.num_windows_in(shard):
                yield shard, sha256(path)


class ShardMaker:
    """Generates shards in one process. The model is loaded once; each call writes one file to the folder."""

    def __init__(self, plan: Plan, folder: str | os.PathLike):
        self.plan, self.folder = plan, Path(folder).absolute()
        self.settings = plan.settings()  # computed on the main machine; workers on other machines must agree

    @functools.cached_property
    def simulator(self) -> EnhancedSimulator:
        """The loaded model of the plan, if it is still the same, and the libraries of this machine too."""
        if self.plan.settings() != self.settings:
            versions = ", ".join(f"{name} {version}" for name, version in self.settings["versions"].items())
            raise InputError(
                f"Expected every machine to have {versions}. Received: other versions on {os.uname().nodename}. Install these."
            )
        simulator = EnhancedSimulator.load(self.plan.folder)
        if sha256(self.plan.folder / MANIFEST) != self.plan.sha256:
            raise InputError(f"Expected the same model as at the start of the data set. Received: another model in {self.plan.folder}.")
        return simulator

    def __call__(self, shard: int) -> tuple[int, str]:
        """Generates a shard, writes its file atomically, and returns its number and the checksum of the file."""
        path = self.folder / shard_file(shard)
        write_windows(path, self.plan, self.simulator, [shard])
        return shard, sha256(path)
