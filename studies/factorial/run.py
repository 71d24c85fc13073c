"""`python -m studies.factorial`: computes the cells, and writes their table, the findings and the figure.

A finished cell is a group of rows in the table `cells.csv` and is not computed again, so an interrupted run continues where it stopped.
"""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder, replace_file, write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import VERSIONS, Stages, Turns
from studies.common.settings import Settings
from studies.factorial.cells import CELLS, PUBLISHED, rounds

if TYPE_CHECKING:
    import pandas as pd

    from studies.factorial.pipelines import Pipelines

FOLDER, TABLE = "factorial", "cells.csv"
COMMAND = "python -m studies.factorial"
KEYS, VALUES = ["environment", "seed", "cell", "detector"], ["alarms", "windows", "recall", "recall_at_real_rate"]


def run(
    settings: Settings, cache: Path, out: Path, environments: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Computes the cells that are missing in the table, in the order of `cells.rounds`, and writes the results.

    Args:
        settings: All settings; `factorial.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: Output folder for the table, the findings and the figure.
        environments: Names of the environments.
        fresh: Whether to compute every cell again.
        tell: Called with a line about each cell.

    Returns:
        The findings.
    """
    import pandas as pd

    folder, seeds = make_folder(out), [settings.robustness.first_seed + number for number in range(settings.factorial.num_seeds)]
    path = folder / TABLE
    done = read_cells(path) if path.is_file() and not fresh else pd.DataFrame(columns=[*KEYS, *VALUES])
    if settings.budget == "full" and not fresh:
        done = _joined(done, published(folder.parent / "robustness"), seeds, environments)
    order = [(part, seed, environment) for parts in rounds() for seed in seeds for part in parts for environment in environments]
    turns = Turns("step", len(order), tell)
    for part, seed, environment in order:
        turns.begin(f"{environment}, seed {seed}, {len(part)} cells")
        stages = Stages(cache, fresh, tell)
        finished = set(done[(done["environment"] == environment) & (done["seed"] == seed)]["cell"])
        missing = [name for name in part if name not in finished]
        if missing:
            for name, rows in evaluated(pipelines(settings, stages, environment, seed), missing):
                done = pd.concat([done, rows]) if len(done) else rows
                write_cells(done, path)
                tell(f"  {name:55} false alarms {rows['alarms'].sum() / rows['windows'].sum():.1%}")
        turns.end(stages)
    return write_findings(folder, settings.budget)


def pipelines(settings: Settings, stages: Stages, environment: str, seed: int) -> "Pipelines":
    """The pipelines of one replicate. Networks of the replicate before it are removed from memory."""
    from enhsim_tf.keras_tools.backend import keras
    from studies.factorial.pipelines import Pipelines
    from studies.robustness.replicate import Replicate

    keras.backend.clear_session()
    telemetry = dataclasses.replace(settings.telemetry, noise=environment)
    return Pipelines(Replicate(dataclasses.replace(settings, telemetry=telemetry, seed=seed), stages))


def evaluated(one: "Pipelines", names: Sequence[str]) -> Iterator[tuple[str, "pd.DataFrame"]]:
    """Trains the detectors on each cell and measures them on real telemetry.

    Args:
        one: The pipelines of a replicate.
        names: Names of cells and references.

    Yields:
        The name, and a row for each detector.
    """
    import pandas as pd

    from enhsim_tf.detection.evaluation import evaluate_arm
    from enhsim_tf.detection.registry import DETECTORS
    from studies.factorial.pipelines import THRESHOLD, TRAINING
    from studies.robustness.replicate import QUICK_DETECTORS

    trial = dataclasses.replace(one.replicate.trial(), trace=None, labels=None)
    detectors = {name: DETECTORS[name] for name in QUICK_DETECTORS}
    for name in names:
        training, held_out = (one.arm(CELLS.get(name, name), purpose) for purpose in (TRAINING, THRESHOLD))
        judged = {key: pd.DataFrame(rows) for key, rows in evaluate_arm(training, held_out, trial, detectors, one.seed).items()}
        rows = collected(judged["alarms"], judged["recall"], ["detector"])
        yield name, rows.assign(environment=one.settings.telemetry.noise, seed=one.seed, cell=name)[[*KEYS, *VALUES]]


def collected(alarms: "pd.DataFrame", recall: "pd.DataFrame", keys: Sequence[str]) -> "pd.DataFrame":
    """One row for each group of keys: alarms and windows over all blocks, recall as means over kinds and severities.

    Args:
        alarms: The table `alarms` of `evaluation.evaluate_arm`.
        recall: The table `recall`.
        keys: Columns that name a detector of an arm.
    """
    counts = alarms.groupby(list(keys), sort=False)[["alarms", "windows"]].sum()
    means = recall.groupby(list(keys), sort=False)[["recall", "recall_at_real_rate"]].mean()
    return counts.join(means).reset_index()


def published(folder: Path) -> "pd.DataFrame | None":
    """The cells that the experiment on robustness has already computed, or None if its tables are not in the folder."""
    import pandas as pd

    from studies.robustness.replicate import QUICK_DETECTORS

    keys, tables = ["environment", "seed", "arm", "detector"], []
    for name in ("alarms", "recall"):
        if not (folder / f"{name}.parquet").is_file():
            return None
        table = pd.read_parquet(folder / f"{name}.parquet").astype({"environment": str, "arm": str, "detector": str})
        tables.append(table[table["arm"].isin(list(PUBLISHED)) & table["detector"].isin(QUICK_DETECTORS)])
    rows = collected(*tables, keys)
    return rows.assign(cell=rows["arm"].map(PUBLISHED))[[*KEYS, *VALUES]]


def _joined(done: "pd.DataFrame", more: "pd.DataFrame | None", seeds: Sequence[int], environments: Sequence[str]) -> "pd.DataFrame":
    """Rows of further cells after those that are there already."""
    import pandas as pd

    if more is None:
        return done
    more = more[more["seed"].isin(seeds) & more["environment"].isin(environments)]
    every = pd.concat([done, more]) if len(done) else more
    return every.drop_duplicates(KEYS, keep="first")


def read_cells(path: Path) -> "pd.DataFrame":
    """Reads the table of finished cells.

    Raises:
        InputError: If the file is missing or is not such a table.
    """
    import pandas as pd

    if not path.is_file():
        raise InputError(f"Expected the table of the factorial experiment. Received: no {path}. Run {COMMAND}.")
    table = pd.read_csv(path)
    if list(table.columns) != [*KEYS, *VALUES] or table.duplicated(KEYS).any() or table.isna().any(axis=None):
        raise InputError(
            f"Expected the columns {', '.join([*KEYS, *VALUES])}, each row once. Received: another table in {path}. Remove it."
        )
    return table


def write_cells(table: "pd.DataFrame", path: Path) -> None:
    """Writes the table of finished cells, sorted, with recall rounded to four decimals."""
    with replace_file(path) as temporary:
        table.sort_values(KEYS).round(4).to_csv(temporary, index=False, lineterminator="\n")


def write_findings(folder: Path, budget: str) -> dict[str, Any]:
    """Computes the findings from the table in a folder, and writes them; and the figure, if a comparison is complete.

    Args:
        folder: Holds the table, with all cells or with those that an interrupted run has finished.
        budget: Budget of the run.

    Raises:
        InputError: If the references are missing in the table.
    """
    from studies.common.figures import save_all
    from studies.factorial.figures import FIGURES
    from studies.factorial.findings import summarise

    found = summarise(read_cells(folder / TABLE)) | {"budget": budget, "versions": VERSIONS}
    write_json(folder / "findings.json", found)
    if found["shares"]:
        save_all(FIGURES, found, folder, COMMAND)
    return found
