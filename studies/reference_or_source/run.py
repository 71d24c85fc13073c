"""Simulates the systems of the study, tries every point of the map, and writes table, findings and figure."""

import importlib
import importlib.metadata
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.stages import Stages, load_arrays
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings
from studies.reference_or_source import recordings

if TYPE_CHECKING:
    import pandas as pd

_CLASSES = {"battery": ("battery", "Battery", "pybamm"), "aircraft": ("aircraft", "Aircraft", "jsbsim")}
"""Module, class and package of each system."""
_RUNS_VERSION, _VERSION = 2, 3  # raise them when the simulated runs, or the rows of a point, change


def make_system(name: str) -> Any:
    """Makes a system.

    Args:
        name: `battery` or `aircraft`.
    """
    module, kind, _ = _CLASSES[name]
    return getattr(importlib.import_module(f"studies.reference_or_source.{module}"), kind)()


def run(settings: Settings, cache: Path, out: Path, systems: Sequence[str], fresh: bool, tell: Callable[[str], None]) -> dict[str, Any]:
    """Runs the study and writes its results; finished stages are read from the cache.

    Args:
        settings: All settings; `reference_or_source` is used.
        cache: Folder of cached stages.
        out: An existing folder for the table, findings and the figure.
        systems: Names of the systems.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.

    Raises:
        InputError: If the simulator of a system is not installed.
    """
    from studies.reference_or_source.figure import FIGURES
    from studies.reference_or_source.summary import KEPT, summarise

    for name in systems:
        make_system(name).check_installed()
    chosen = settings.reference_or_source

    def tables_of(name: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return {"alarms": table_of(settings, stages, name, seed)}

    replicates = seed_by_seed(tables_of, systems, range(chosen.first_seed, chosen.first_seed + chosen.num_seeds))
    tables = collect("replicate", replicates, cache, fresh, tell)
    versions = {package: importlib.metadata.version(package) for name, (_, _, package) in _CLASSES.items() if name in systems}
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "versions": versions})


def table_of(settings: Settings, stages: Stages, name: str, seed: int) -> "pd.DataFrame":
    """The rows of one system and seed; each point of the map is a stage of its own.

    Args:
        settings: All settings; `reference_or_source` is used.
        stages: Runs stages and caches their results.
        name: Name of the system.
        seed: The seed.
    """
    import pandas as pd

    from studies.reference_or_source.cells import points, rows_of

    chosen, system = settings.reference_or_source, make_system(name)
    inside = system.unit_samples // system.window
    known = [max(1, number // inside) for number in chosen.known_windows]
    numbers = {"fit": max(chosen.known_windows), "test": chosen.test_windows, "source": chosen.source_windows}
    numbers |= {"parameters": chosen.parameter_windows, "fault": chosen.fault_windows}
    counts = {part: max(1, number // inside) for part, number in numbers.items()}
    version = importlib.metadata.version(_CLASSES[name][2])

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
            pd.DataFrame(rows_of(system, arrays, point, seed, same)).to_parquet(folder / "rows.parquet")

        about = f"{name} {seed}, {point.axis} {point.level} {point.simulator} {point.units}".replace("  ", " ")
        found.append(pd.read_parquet(stages.run(about, judge, (repr(point), seed, _VERSION), [simulated]) / "rows.parquet"))
    return pd.concat(found, ignore_index=True).assign(system=name, seed=seed)
