"""The cells of the study, one for each regime and seed, and the tables that they fill."""

import importlib.metadata
from collections.abc import Callable
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

TABLES = ("errors", "choice", "trust", "speed", "runs", "alarms")


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
    from studies.battery.figure import FIGURES
    from studies.battery.summary import KEPT, summarise

    check_installed()
    first, number = settings.battery.first_seed, settings.battery.num_seeds

    def tables_of(regime: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return tables_of_cell(settings, stages, regime, seed)

    replicates = seed_by_seed(tables_of, REGIMES, range(first, first + number))
    tables = collect("replicate", replicates, cache, fresh, tell)
    about = {"budget": settings.budget, "versions": {"pybamm": importlib.metadata.version("pybamm")}}
    return write_results(tables, KEPT, summarise, FIGURES, make_folder(out), about)


def tables_of_cell(settings: Settings, stages: Stages, regime: str, seed: int) -> "dict[str, pd.DataFrame]":
    """Simulates the runs of one seed in one regime, and judges enhancers and detectors on them.

    Args:
        settings: All settings; `battery` is used.
        stages: Runs stages and caches their results.
        regime: A key of `orbits.REGIMES`.
        seed: The seed.

    Returns:
        The tables of `TABLES` by name.
    """
    import pandas as pd

    chosen = settings.battery
    counts = {part: getattr(chosen, f"{part}_orbits") for part in record.PARTS}
    with_networks = seed < chosen.first_seed + chosen.num_network_seeds

    def simulate(folder: Path) -> None:
        record.record(folder, counts, REGIMES[regime], seed, stages.progress)

    simulated = f"battery {regime} {seed}"
    runs = stages.run(simulated, simulate, (counts, regime, seed, importlib.metadata.version("pybamm")))

    def judge(folder: Path) -> None:
        for name, rows in judge_cell(record.read(runs), regime, seed, settings, with_networks).items():
            pd.DataFrame(rows).assign(regime=regime, seed=seed).to_parquet(folder / f"{name}.parquet")

    depends = (regime, seed, chosen.paper_epochs, chosen.fault_orbits, with_networks)
    judged = stages.run(f"battery judged {regime} {seed}", judge, depends, [simulated])
    return {name: pd.read_parquet(judged / f"{name}.parquet") for name in TABLES}


def judge_cell(
    recorded: record.Recorded, regime: str, seed: int, settings: Settings, with_networks: bool
) -> dict[str, list[dict[str, Any]]]:
    """The rows of all tables for recorded runs.

    Args:
        recorded: The runs.
        regime: A key of `orbits.REGIMES`.
        seed: The seed.
        settings: All settings; `battery` is used.
        with_networks: Whether autoencoders are among the detectors.
    """
    from studies.battery import errors
    from studies.battery.classifiers import classifier_rows, simulate_faults
    from studies.battery.detectors import Judge
    from studies.battery.speed import speed_rows
    from studies.battery.windows import pair_windows

    pairs = pair_windows(recorded, "fit", errors.NUM_WINDOWS, seed)
    enhancers = errors.fit_enhancers(pairs, tuple(errors.ENHANCERS), seed, settings.battery.paper_epochs)
    choice = errors.choice_rows(pairs, seed)
    judge = Judge(recorded, pairs, next(row["candidate"] for row in choice if row["is_chosen"]), seed)
    faults = simulate_faults(settings.battery.fault_orbits, REGIMES[regime], seed)
    reduced = recorded.about["reduced"]
    return {
        "errors": errors.error_rows(recorded, enhancers, seed),
        "choice": choice,
        "trust": errors.trust_rows(recorded, pairs),
        "speed": speed_rows(recorded, enhancers, REGIMES[regime], seed),
        "runs": [
            {"num_runs": recorded.about["num_runs"], "num_reduced": len(reduced), "most_reductions": max(reduced.values(), default=0)}
        ],
        "alarms": judge.source_rows(with_networks) + judge.reference_rows() + classifier_rows(judge, faults),
    }
