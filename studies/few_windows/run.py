"""`python -m studies.few_windows`: how few real windows suffice, and from how few a simulator pays."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.stages import Stages
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "learning_curve"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, out: Path, environments: Sequence[str], rungs: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the experiment and writes its results; finished cells are read from the cache.

    Args:
        settings: All settings; `curve.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: Output folder for tables, findings and figures.
        environments: Kinds of noise.
        rungs: Noise networks of the ladder that are also tried, by name.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    import pandas as pd

    from studies.few_windows.cells import Cell, World
    from studies.few_windows.figures import FIGURES
    from studies.few_windows.findings import KEPT, summarise

    def replicate(environment: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        telemetry = dataclasses.replace(settings.telemetry, noise=environment)
        world = World(dataclasses.replace(settings, telemetry=telemetry, seed=seed))
        return {"rows": pd.concat([Cell(world, num_real).rows(rungs, stages) for num_real in settings.curve.num_real])}

    make_folder(out)
    first = settings.curve.first_seed
    seeds = range(first, first + settings.curve.num_seeds)
    tables = collect("learning curve", seed_by_seed(replicate, environments, seeds), cache, fresh, tell)
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "first_seed": first})
