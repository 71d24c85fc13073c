"""Simulates the systems of the study, reads the real cells, and writes table, findings and
figure.
"""

import argparse
import importlib.metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages, load_arrays
from studies.common.replicates import run_study
from studies.common.settings import Settings
from studies.common.tables import stage_tables
from studies.reference_or_source import ageing, recordings
from studies.reference_or_source.aircraft import Aircraft
from studies.reference_or_source.battery import Battery
from studies.reference_or_source.judging import rows_of
from studies.reference_or_source.real_cells import load_cells

if TYPE_CHECKING:
    import pandas as pd

SIMULATED = {"battery": (Battery, "pybamm"), "aircraft": (Aircraft, "jsbsim")}
"""Class and package of each simulated system."""
CELLS = "cells"
FAMILIES = "families"
"""The real cells, and models of their sisters, which are studied together."""
# raise them when the simulated runs, or the rows of a replicate, change
_RUNS_VERSION = 3
_ROWS_VERSION = 1


def run(options: argparse.Namespace, settings: Settings, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; see `run_study`.

    Raises:
        InputError: If the simulator of a system is not installed, or the cells are wanted without
            their folder.
    """
    import pandas as pd

    systems = (*SIMULATED, CELLS) if options.system is None else (options.system,)
    for name in SIMULATED:  # the cells are simulated by PyBaMM, too
        SIMULATED[name][0]().check_installed()
    if options.data is None and CELLS in systems:
        raise InputError(
            "Expected the folder of NASA's battery data set. Received: no --data. Give --data "
            "FOLDER, or --system battery and --system aircraft."
        )

    def tables_of(name: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        if name in SIMULATED:
            return {"found": simulated_table(settings, stages, name, seed)}
        if seed != settings.reference_or_source.first_seed:
            return {}  # nothing is drawn for the cells
        tables = [cells_table(stages, part, options.data) for part in (CELLS, FAMILIES)]
        return {"found": pd.concat(tables, ignore_index=True)}

    versions = {package: importlib.metadata.version(package) for _, package in SIMULATED.values()}
    return run_study(
        "reference_or_source", tables_of, systems, options, settings, out, {"versions": versions}
    )


def simulated_table(settings: Settings, stages: Stages, name: str, seed: int) -> "pd.DataFrame":
    """The rows of a simulated system and seed; runs and rows are cached stages.

    Args:
        settings: All settings; `reference_or_source` is used.
        stages: Runs stages and caches their results.
        name: Name of the system.
        seed: The seed.
    """
    kind, package = SIMULATED[name]
    chosen = settings.reference_or_source
    system = kind()
    inside = system.unit_samples // system.window
    numbers = {
        "fit": chosen.known_windows,
        "test": chosen.test_windows,
        "source": chosen.source_windows,
        "parameters": chosen.parameter_windows,
        "fault": chosen.fault_windows,
    }
    counts = {part: max(1, number // inside) for part, number in numbers.items()}

    def simulate(folder: Path) -> None:
        recordings.record(system, counts, seed, folder, stages.progress)

    version = importlib.metadata.version(package)
    simulated = f"{name} {seed}"
    runs = stages.run(simulated, simulate, (name, counts, seed, version), version=_RUNS_VERSION)

    def judge() -> dict[str, Any]:
        return {"rows": rows_of(system, load_arrays(runs, "runs"), seed)}

    judged = stage_tables(stages, f"{simulated}, uses", judge, (), [simulated], _ROWS_VERSION)
    return judged["rows"].assign(system=name, seed=seed)


def cells_table(stages: Stages, name: str, folder: Path) -> "pd.DataFrame":
    """The rows of the real cells, a cached stage.

    Args:
        stages: Runs stages and caches their results.
        name: `CELLS`, or `FAMILIES` for models of sisters.
        folder: The folder of the data set.
    """
    cells = load_cells(folder)
    rows_of_cells = ageing.ageing_rows if name == CELLS else ageing.family_rows
    data = [(cell.name, len(cell.discharges)) for cell in cells]
    depends = (data, importlib.metadata.version("pybamm"))
    judged = stage_tables(
        stages, name, lambda: {"rows": rows_of_cells(cells)}, depends, (), _ROWS_VERSION
    )
    return judged["rows"].assign(system=name, seed=0)
