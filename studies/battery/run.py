"""The cells of the study, one for each regime and seed, and the tables that they fill."""

import argparse
import importlib.metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.stages import Stages
from studies.battery import record
from studies.battery.orbits import REGIMES
from studies.battery.simulate import check_installed
from studies.battery.summary import KEPT
from studies.common.replicates import run_study
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd


def run(options: argparse.Namespace, settings: Settings, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; see `run_study`.

    Raises:
        InputError: If PyBaMM is not installed.
    """
    check_installed()
    versions = {"pybamm": importlib.metadata.version("pybamm")}

    def tables_of(regime: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return tables_of_cell(settings, stages, regime, seed, versions["pybamm"])

    return run_study("battery", tables_of, REGIMES, options, settings, out, {"versions": versions})


def tables_of_cell(settings: Settings, stages: Stages, regime: str, seed: int, version: str) -> "dict[str, pd.DataFrame]":
    """Simulates the runs of one seed in one regime with this version of PyBaMM, and judges enhancers and detectors on them."""
    import pandas as pd

    chosen = settings.battery
    counts = {part: getattr(chosen, f"{part}_orbits") for part in record.PARTS}

    def simulate(folder: Path) -> None:
        record.record(folder, counts, REGIMES[regime], seed, stages.progress)

    simulated = f"battery {regime} {seed}"
    runs = stages.run(simulated, simulate, (counts, regime, seed, version))

    def judge(folder: Path) -> None:
        for name, rows in judge_cell(record.read(runs), regime, seed, settings).items():
            pd.DataFrame(rows).assign(regime=regime, seed=seed).to_parquet(folder / f"{name}.parquet")

    judged = stages.run(f"battery judged {regime} {seed}", judge, (regime, seed, chosen.paper_epochs), [simulated])
    return {name: pd.read_parquet(judged / f"{name}.parquet") for name in KEPT.names}


def judge_cell(recorded: record.Recorded, regime: str, seed: int, settings: Settings) -> dict[str, list[dict[str, Any]]]:
    """The rows of all tables for recorded runs."""
    from studies.battery import errors
    from studies.battery.detectors import Judge

    pairs = record.pair_windows(recorded, "fit", errors.NUM_WINDOWS, seed)
    enhancers = errors.fit_enhancers(pairs, tuple(errors.ENHANCERS), seed, settings.battery.paper_epochs)
    choice = errors.choice_rows(pairs, seed)
    judge = Judge(recorded, pairs, next(row["candidate"] for row in choice if row["is_chosen"]), seed)
    return {
        "errors": errors.error_rows(recorded, enhancers, seed),
        "choice": choice,
        "trust": errors.trust_rows(recorded, pairs),
        "speed": errors.speed_rows(recorded, enhancers, REGIMES[regime], seed),
        "runs": [{"num_runs": len(recorded.runs), "num_reduced": len(recorded.reduced)}],
        "alarms": judge.source_rows() + judge.reference_rows(),
    }
