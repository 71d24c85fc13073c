"""`python -m studies.battery`: runs all replicates and writes tables, findings, figures and the page."""

import importlib.metadata
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.stages import Stages
from studies.battery import record
from studies.battery.orbits import REGIMES
from studies.battery.simulate import check_installed
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "battery"  # below the folder of the figures


def run(settings: Settings, cache: Path, out: Path, fresh: bool, tell: Callable[[str], None]) -> dict[str, Any]:
    """Runs the study and writes its results; finished stages are read from the cache.

    Args:
        settings: All settings; `battery.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: Output folder for tables, findings and figures.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.

    Raises:
        InputError: If PyBaMM is not installed.
    """
    from studies.battery.figures import FIGURES
    from studies.battery.findings import KEPT, summarise

    check_installed()
    make_folder(out)
    first, number = settings.battery.first_seed, settings.battery.num_seeds

    def tables_of(regime: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return replicate(settings, stages, regime, seed)

    replicates = seed_by_seed(tables_of, REGIMES, range(first, first + number))
    tables = collect("replicate", replicates, cache, fresh, tell)
    about = {"budget": settings.budget, "versions": {"pybamm": importlib.metadata.version("pybamm")}}
    return write_results(tables, KEPT, summarise, FIGURES, out, about)


def replicate(settings: Settings, stages: Stages, regime: str, seed: int) -> "dict[str, pd.DataFrame]":
    """The tables of one seed in one regime.

    Args:
        settings: All settings.
        stages: Runs stages and caches their results.
        regime: A key of `orbits.REGIMES`.
        seed: The seed.
    """
    import pandas as pd

    runs = recorded(settings, stages, regime, seed)
    chosen, found = settings.battery, []
    first, after = None, [name_of(regime, seed)]
    for step, depends in {
        "errors": (chosen.paper_epochs,),
        "detectors": (),
        "labelled": (chosen.fault_orbits,),
        "networks": (chosen.num_iterations,),
    }.items():
        if step == "networks" and seed >= chosen.first_seed + chosen.num_network_seeds:
            continue

        def make(target: Path, step: str = step, before: Path | None = first) -> None:
            from studies.battery import study

            study.STEPS[step](target, record.read(runs), regime, seed, settings, before)

        name = f"battery {step} {regime} {seed}"
        found.append(stages.run(name, make, (regime, seed, *depends), after))
        if first is None:  # the others read what this one has chosen
            first, after = found[0], [*after, name]
    paths: Iterable[Path] = (path for each in found for path in sorted(each.glob("*.parquet")))
    tables: dict[str, list[pd.DataFrame]] = {}
    for path in paths:
        tables.setdefault(path.stem, []).append(pd.read_parquet(path))
    return {name: pd.concat(each, ignore_index=True).assign(regime=regime, seed=seed) for name, each in tables.items()}


def recorded(settings: Settings, stages: Stages, regime: str, seed: int) -> Path:
    """The folder with the recorded runs of a replicate, simulated or from the cache.

    Args:
        settings: All settings; `battery` is looked at.
        stages: Runs stages and caches their results.
        regime: A key of `orbits.REGIMES`.
        seed: Seed of the replicate.

    Raises:
        InputError: If PyBaMM is not installed.
    """
    check_installed()
    chosen = settings.battery
    counts = record.Counts(chosen.fit_orbits, chosen.more_orbits, chosen.test_orbits, chosen.coarse_orbits, chosen.fault_orbits)

    def make(folder: Path) -> None:
        record.record(folder, counts, REGIMES[regime], seed, stages.progress)

    depends = (counts, regime, seed, importlib.metadata.version("pybamm"))
    return stages.run(name_of(regime, seed), make, depends)


def name_of(regime: str, seed: int) -> str:
    """Name of the stage that simulates a replicate."""
    return f"battery {regime} {seed}"
