"""`python -m enhsim_tf.reproduce --experiment robustness`: runs all replicates and writes tables, findings, figures and the report."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder, write_json
from enhsim_tf.reproduce.robustness.negative_controls import judge_controls
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import VERSIONS, Stages, Turns

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "robustness"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, out: Path, environments: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the experiment and writes its results; finished replicates are read from the cache.

    Args:
        settings: All settings; `robustness.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: Output folder for tables, findings and figures.
        environments: Names of the environments.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    from enhsim_tf.reproduce.figure import save_all
    from enhsim_tf.reproduce.robustness.figures import FIGURES
    from enhsim_tf.reproduce.robustness.findings import KEPT, summarise

    folder = make_folder(out)
    tables = collect(settings, cache, environments, fresh, tell)
    KEPT.write(tables, folder)
    found = summarise(KEPT.read(folder))
    found |= {"budget": settings.budget, "first_seed": settings.robustness.first_seed, "versions": VERSIONS}
    write_json(folder / "findings.json", found)
    save_all(FIGURES, found, folder, KEPT.command)
    return found


def collect(
    settings: Settings, cache: Path, environments: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> "dict[str, pd.DataFrame]":
    """The tables of all replicates. Replicates run seed by seed, so an interrupted run has all environments of the first seeds.

    Args:
        settings: All settings.
        cache: Folder of cached stages.
        environments: Names of the environments; degraded modes are tested in the first.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.
    """
    import pandas as pd

    from enhsim_tf.reproduce.robustness.degraded_modes import DegradedModes
    from enhsim_tf.reproduce.robustness.replicate import replicate

    parts: dict[str, list[pd.DataFrame]] = {}
    is_terminal, turns = sys.stdout.isatty(), Turns("replicate", settings.robustness.num_seeds * len(environments), tell)
    for number in range(settings.robustness.num_seeds):
        for environment in environments:
            turns.begin(f"{environment}, seed {settings.robustness.first_seed + number}")
            stages = Stages(cache, fresh, tell, speaks=not is_terminal)
            one = replicate(settings, stages, environment, number, int(is_terminal))
            tables = one.tables | (DegradedModes(one).tables if environment == environments[0] else {})
            for name, table in tables.items():
                parts.setdefault(name, []).append(table)
            turns.end(stages)
            from enhsim_tf.keras_tools.backend import keras

            keras.backend.clear_session()  # frees the memory of the replicate's networks
    return {name: pd.concat(each, ignore_index=True) for name, each in parts.items()} | {
        "controls": _controls(settings, cache, fresh, tell)
    }


def _controls(settings: Settings, cache: Path, fresh: bool, tell: Callable[[str], None]) -> "pd.DataFrame":
    """The measures of realism for noises with a known error; one process and no network."""
    import pandas as pd

    chosen = settings.robustness
    numbers = (chosen.num_windows, settings.telemetry.window, chosen.num_resplits, chosen.first_seed)

    stages = Stages(cache, fresh, tell, speaks=not sys.stdout.isatty())

    def make(folder: Path) -> None:
        judge_controls(*numbers, stages.progress).to_parquet(folder / "controls.parquet")

    folder = stages.run("controls", make, ("reproduce.robustness.negative_controls",), numbers)
    return pd.read_parquet(folder / "controls.parquet")
