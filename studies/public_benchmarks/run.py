"""The rows of the study: all methods with all settings on each series."""

import argparse
import functools
import itertools
import tempfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages
from studies.common.replicates import run_study
from studies.common.settings import Settings
from studies.common.tables import stage_tables
from studies.public_benchmarks.arms import (
    CHOSEN,
    DIFFERENCE,
    GENERATED,
    TELEMETRY,
    Generated,
    Simulators,
    Views,
    settings_of_views,
    window_of,
)
from studies.public_benchmarks.methods import judge_method
from studies.public_benchmarks.onsets import EXAMPLES, example_rows, onset_rows
from studies.public_benchmarks.peers import peers
from studies.public_benchmarks.series import Series, find_series
from studies.public_benchmarks.tool import TOOL, judge_tool

if TYPE_CHECKING:
    import pandas as pd


def run(options: argparse.Namespace, settings: Settings, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; see `run_study`.

    Raises:
        InputError: If a folder does not have a layout of the data sets, or no series can be used.
    """
    found = find_series(options.data)
    left_out = {}

    def tables_of(name: str, seed: int, stages: Stages) -> "Mapping[str, pd.DataFrame]":
        if name == EXAMPLES:
            return {"onsets": _rows_of_examples(seed, stages)}
        try:
            series = found[name]()
        except InputError as error:
            left_out[name] = str(error)
            tell(f"left out: {error}")
            if len(left_out) == len(found):
                raise
            return {}
        return rows_of_series(series, settings, seed, stages)

    about = {"left_out": left_out}
    names = (*found, EXAMPLES)
    return run_study("public_benchmarks", tables_of, names, options, settings, out, about)


def _rows_of_examples(seed: int, stages: Stages) -> "pd.DataFrame":
    def compute() -> dict[str, list[dict[str, Any]]]:
        with tempfile.TemporaryDirectory() as models:
            return {"rows": example_rows(Path(models))}

    rows = stage_tables(stages, EXAMPLES, compute, (), version=2)["rows"]
    about = {"series": rows["kind"], "data_set": EXAMPLES, "seed": seed}
    return rows.assign(**about, severity=np.nan, is_development=True)


@threadpool_limits.wrap(limits=1)  # CPU seconds are those of one thread
def rows_of_series(
    series: Series, settings: Settings, seed: int, stages: Stages
) -> "dict[str, pd.DataFrame]":
    """The tables of one series, a stage for each of `KINDS`."""
    import pandas as pd

    chosen = settings.public_benchmarks
    depends = (
        *(zlib.crc32(np.ascontiguousarray(part)) for part in (series.nominal, series.judged)),
        *(series.events, chosen.num_tried, chosen.false_alarm_rate, seed),
    )
    about = {
        "series": series.name,
        "data_set": series.data_set,
        "seed": seed,
        "is_development": series.is_development,
    }
    tables: dict[str, list[pd.DataFrame]] = {}
    for kind, (table, rows_of, version) in KINDS.items():

        def compute(rows_of: Any = rows_of) -> dict[str, list[dict[str, Any]]]:
            return {"rows": rows_of(series, settings, seed)}

        name = f"{kind} {series.name.replace('/', '-')}"
        found = stage_tables(stages, name, compute, depends, version=version)
        tables.setdefault(table, []).append(found["rows"].assign(**about))
    return {table: pd.concat(rows) for table, rows in tables.items()}


def view_rows(series: Series, settings: Settings, seed: int) -> list[dict[str, Any]]:
    """The rows of the views in all uses, and of `score` as it is."""
    rate = settings.public_benchmarks.false_alarm_rate
    simulators = Simulators(seed)
    window = window_of(series.nominal)
    rows = [{"setting": "", "method": TOOL} | judge_tool(series, simulators, window, rate)]
    uses = [
        (TELEMETRY, "", Views, series),
        (GENERATED, "", functools.partial(Generated, simulators), series),
        (DIFFERENCE, "", Views, simulators.difference(series)),
    ]
    tried = settings_of_views(series.nominal.shape[1]).items()
    for setting, make in itertools.islice(tried, settings.public_benchmarks.num_tried):
        uses.append((CHOSEN, setting, make, series))
    for name, setting, make, judged in uses:
        row = judge_method(make, judged, window, rate)
        rows.append({"setting": setting, "method": name} | row)
    return rows


def peer_rows(series: Series, settings: Settings, seed: int) -> list[dict[str, Any]]:
    """The rows of the peers with the settings that are tried."""
    chosen = settings.public_benchmarks
    window = window_of(series.nominal)
    return [
        {"method": name, "setting": setting}
        | judge_method(make, series, window, chosen.false_alarm_rate)
        for name, tried in peers(window, seed).items()
        for setting, make in itertools.islice(tried.items(), chosen.num_tried)
    ]


KINDS = {
    "views": ("scores", view_rows, 2),
    "peers": ("scores", peer_rows, 1),
    "onsets": ("onsets", onset_rows, 1),
}
"""Stages of a series: their table, and the version that a person raises when results change."""
