"""`python -m studies.robustness`: runs all replicates and writes tables, findings, figures and the report."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.stages import Stages
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings
from studies.robustness.negative_controls import judge_controls

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
        environments: Names of the environments; degraded modes are tested in the first.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    from studies.robustness.degraded_modes import DegradedModes
    from studies.robustness.figures import FIGURES
    from studies.robustness.findings import KEPT, summarise
    from studies.robustness.replicate import replicate

    def tables_of(environment: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        one = replicate(settings, stages, environment, seed - first, int(sys.stdout.isatty()))
        return one.tables | (DegradedModes(one).tables if environment == environments[0] else {})

    make_folder(out)
    chosen, first = settings.robustness, settings.robustness.first_seed
    replicates = seed_by_seed(tables_of, environments, range(first, first + chosen.num_seeds))
    tables = collect("replicate", replicates, cache, fresh, tell) | {"controls": _controls(settings, cache, fresh, tell)}
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "first_seed": first})


def _controls(settings: Settings, cache: Path, fresh: bool, tell: Callable[[str], None]) -> "pd.DataFrame":
    """The measures of realism for noises with a known error; one process and no network."""
    import pandas as pd

    chosen = settings.robustness
    numbers = (chosen.num_windows, settings.telemetry.window, chosen.num_resplits, chosen.first_seed)

    stages = Stages(cache, fresh, tell, speaks=not sys.stdout.isatty())

    def make(folder: Path) -> None:
        judge_controls(*numbers, stages.progress).to_parquet(folder / "controls.parquet")

    folder = stages.run("controls", make, numbers)
    return pd.read_parquet(folder / "controls.parquet")
