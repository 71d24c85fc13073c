"""Generates one shard of a large data set. The content of a shard depends only on the plan and the number of the shard.

Each shard has a random seed of its own, and enhancers always compute batches of the same size. The bytes of a shard are
therefore the same in every worker and in every order of generation.
"""

import functools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

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
_START_RANGE = 1_000_000  # windows start at a random sample below this one, so that every phase of the waves occurs
_BATCH, _BATCH_VALUES = 1_024, 2**19  # maximum windows and values per call of the enhancer
_ROW_GROUP = 4_096


class Record(NamedTuple):
    """A finished shard: its number, its number of windows, and the checksum of its file."""

    shard: int
    rows: int
    sha256: str


class Rows(NamedTuple):
    """Properties of the windows of a shard, one value per window. Scenario 0 is nominal."""

    scenario: np.ndarray
    severity: np.ndarray
    onset: np.ndarray
    start: np.ndarray
    level: np.ndarray


def shard_file(shard: int) -> str:
    """Returns the file name of a shard."""
    return f"shard-{shard:06d}.parquet"


def draw_rows(plan: Plan, shard: int) -> tuple[Rows, np.random.Generator, np.random.Generator]:
    """Draws the properties of the windows of a shard. Each scenario has its share of the windows, rounded at random.

    Returns:
        The properties, the random generator of the scenarios, and the random generator of the noise.
    """
    seeds = np.random.SeedSequence([_STREAM, plan.seed, shard]).spawn(4)
    mixing, placing, happening, noise = map(np.random.default_rng, seeds)
    num_rows = plan.num_windows_in(shard)
    scenario = systematic([plan.mix.nominal, *(part.share for part in plan.mix.scenarios)], num_rows, mixing)
    ranges = np.array([((0, 0), (0, 0)), *((part.severity, part.onset) for part in plan.mix.scenarios)], float)[scenario]
    severity, onset = (ranges[..., 0] + (ranges[..., 1] - ranges[..., 0]) * mixing.random((num_rows, 2))).T
    severity = severity.astype(np.float32).astype(np.float64)  # the precision of the label
    return Rows(scenario, severity, onset, placing.integers(0, _START_RANGE, num_rows), placing.random(num_rows)), happening, noise


def systematic(shares: Sequence[float], num_rows: int, rng: np.random.Generator) -> np.ndarray:
    """Assigns rows to categories in random order by systematic sampling: each category gets its share, rounded up or down."""
    edges = np.cumsum(shares) / np.sum(shares)
    points = (rng.random() + np.arange(num_rows)) / num_rows
    return rng.permutation(np.minimum(np.searchsorted(edges, points, side="right"), np.flatnonzero(shares)[-1]))


def make_windows(plan: Plan, simulator: EnhancedSimulator, shard: int) -> tuple[np.ndarray, np.ndarray, Rows]:
    """Generates the windows of a shard with the loaded model of the plan.

    Returns:
        The windows, float32 of shape `(rows, samples, channels)`, a boolean array of the same shape that marks the changed samples, and the
        properties of the windows.
    """
    rows, happening, noise = draw_rows(plan, shard)
    shape = (len(rows.start), plan.window, len(plan.channels))
    windows, masks = np.empty(shape, np.float32), np.empty(shape, bool)
    batch = max(1, min(_BATCH, plan.shard, _BATCH_VALUES // (shape[1] * shape[2])))
    for first in range(0, shape[0], batch):
        here = slice(first, min(first + batch, shape[0]))
        num_rows = here.stop - first
        starts, scenarios = np.zeros(batch, np.int64), [_scenario_of(plan, rows, row) for row in range(first, here.stop)]
        starts[:num_rows] = rows.start[here]
        drawn = simulator.alignment.draw(starts, [*scenarios, *[None] * (batch - num_rows)], happening)
        levels = None
        if simulator.levels is not None:
            levels = np.zeros((batch, *simulator.levels.shape[1:]))
            levels[:num_rows] = simulator.levels[(rows.level[here] * len(simulator.levels)).astype(int)]
        windows[here], masks[here] = (each[:num_rows] for each in simulator.complete(drawn, levels, noise))
    return windows, masks, rows


def _scenario_of(plan: Plan, rows: Rows, row: int) -> Degraded | None:
    number = rows.scenario[row]
    if number == 0:
        return None
    part = plan.mix.scenarios[number - 1]
    return Degraded(part.mode, float(rows.severity[row]), float(rows.onset[row]), part.channel)


def shard_schema(settings: dict[str, Any]) -> pa.Schema:
    """Returns the Parquet schema of the shards of a data set, from `Plan.settings`."""
    about = {"format": FORMAT, "settings": plan_key(settings), "interval_s": repr(settings["interval_s"])}
    return window_schema(settings["window"], settings.get("channels", ("",))).with_metadata(about)


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

    def __call__(self, shard: int) -> Record:
        """Generates a shard, writes its file atomically, and returns its record."""
        windows, masks, rows = make_windows(self.plan, self.simulator, shard)
        modes = np.array([NOMINAL, *(part.mode for part in self.plan.mix.scenarios)], object)
        table, path = window_table(windows, masks, self.plan.channels, modes[rows.scenario], rows.severity), self.folder / shard_file(shard)
        with replace_file(path) as temporary:
            schema = shard_schema(self.settings)
            pq.write_table(table.cast(schema), temporary, row_group_size=_ROW_GROUP, **parquet_options(schema))
            return Record(shard, table.num_rows, sha256(temporary))
