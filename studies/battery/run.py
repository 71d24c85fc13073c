"""The cells of the study, one for each regime and seed, and the tables that they fill."""

import argparse
import importlib.metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.stages import Stages, load_arrays
from studies.battery import record
from studies.battery.orbits import REGIMES
from studies.battery.simulate import import_pybamm
from studies.common.replicates import run_study
from studies.common.settings import Settings
from studies.common.tables import stage_tables

if TYPE_CHECKING:
    import pandas as pd

_NUM_WINDOWS = 1_500  # to which the enhanced simulator is fitted


def run(options: argparse.Namespace, settings: Settings, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; see `run_study`.

    Raises:
        InputError: If PyBaMM is not installed.
    """
    import_pybamm()
    versions = {"pybamm": importlib.metadata.version("pybamm")}

    def tables_of(regime: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return tables_of_cell(settings, stages, regime, seed, versions["pybamm"])

    return run_study("battery", tables_of, REGIMES, options, settings, out, {"versions": versions})


def tables_of_cell(
    settings: Settings, stages: Stages, regime: str, seed: int, version: str
) -> "dict[str, pd.DataFrame]":
    """Simulates the runs of one seed in one regime with this version of PyBaMM, and judges
    detectors on them.
    """
    counts = {part: getattr(settings.battery, f"{part}_orbits") for part in record.PARTS}

    def simulate(folder: Path) -> None:
        record.record(folder, counts, REGIMES[regime], seed, stages.progress)

    simulated = f"battery {regime} {seed}"
    folder = stages.run(simulated, simulate, (counts, regime, seed, version))

    def judge() -> dict[str, list[dict[str, Any]]]:
        from enhsim_tf.enhancer.candidates import choose_enhancer
        from studies.battery.detectors import Judge

        runs = load_arrays(folder, "runs")
        pairs = record.pair_windows(runs, "fit", _NUM_WINDOWS, seed)
        chosen = choose_enhancer(
            pairs.coarse, pairs.telemetry[:, :, None], pairs.starts, seed=seed
        ).enhancer.name
        one = Judge(runs, pairs, chosen, seed)
        about = {"regime": regime, "seed": seed}
        return {"alarms": [row | about for row in one.source_rows() + one.reference_rows()]}

    return stage_tables(
        stages, f"battery judged {regime} {seed}", judge, (regime, seed), [simulated]
    )
