"""Simulates the systems of the study, tries every point of the map, and writes table, findings and figure."""

import argparse
import importlib.metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.stages import Stages, load_arrays
from studies.common.replicates import run_study
from studies.common.settings import Settings
from studies.reference_or_source import recordings
from studies.reference_or_source.aircraft import Aircraft
from studies.reference_or_source.battery import Battery
from studies.reference_or_source.cells import points, rows_of

if TYPE_CHECKING:
    import pandas as pd

_CLASSES = {"battery": (Battery, "pybamm"), "aircraft": (Aircraft, "jsbsim")}
"""Class and package of each system."""
_RUNS_VERSION, _VERSION = 2, 3  # raise them when the simulated runs, or the rows of a point, change


def run(options: argparse.Namespace, settings: Settings, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; see `run_study`.

    Raises:
        InputError: If the simulator of a system is not installed.
    """
    systems = tuple(_CLASSES) if options.system is None else (options.system,)
    for name in systems:
        _CLASSES[name][0]().check_installed()

    def tables_of(name: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return {"alarms": table_of(settings, stages, name, seed)}

    versions = {
        _CLASSES[name][1]: importlib.metadata.version(_CLASSES[name][1]) for name in systems
    }
    return run_study(
        "reference_or_source", tables_of, systems, options, settings, out, {"versions": versions}
    )


def table_of(settings: Settings, stages: Stages, name: str, seed: int) -> "pd.DataFrame":
    """The rows of one system and seed; each point of the map is a stage of its own.

    Args:
        settings: All settings; `reference_or_source` is used.
        stages: Runs stages and caches their results.
        name: Name of the system.
        seed: The seed.
    """
    import pandas as pd

    kind, package = _CLASSES[name]
    chosen, system = settings.reference_or_source, kind()
    inside = system.unit_samples // system.window
    known = [max(1, number // inside) for number in chosen.known_windows]
    numbers = {
        "fit": max(chosen.known_windows),
        "test": chosen.test_windows,
        "source": chosen.source_windows,
    }
    numbers |= {"parameters": chosen.parameter_windows, "fault": chosen.fault_windows}
    counts = {part: max(1, number // inside) for part, number in numbers.items()}
    version = importlib.metadata.version(package)

    def simulate(folder: Path) -> None:
        recordings.record(system, counts, seed, folder, stages.progress)

    simulated = f"{name} {seed}"
    runs = stages.run(simulated, simulate, (name, counts, seed, version, _RUNS_VERSION))
    arrays: dict[str, Any] = {}
    alone: dict[str, dict[str, Any]] = {}  # what does not depend on the simulator, by telemetry
    found = []
    for point in points(system, known, max(1, chosen.middle // inside)):

        def judge(folder: Path, point: Any = point) -> None:
            if not arrays:
                arrays.update(load_arrays(runs, "runs"))
            same = alone.setdefault(repr((point.units, point.windows)), {})
            pd.DataFrame(rows_of(system, arrays, point, seed, same)).to_parquet(
                folder / "rows.parquet"
            )

        about = (
            f"{name} {seed}, {point.axis} {point.level} {point.simulator} {point.units}".replace(
                "  ", " "
            )
        )
        found.append(
            pd.read_parquet(
                stages.run(about, judge, (repr(point), seed, _VERSION), [simulated])
                / "rows.parquet"
            )
        )
    return pd.concat(found, ignore_index=True).assign(system=name, seed=seed)
