"""`python -m studies.noise_models`: every rung of the noise ladder on every family of the gallery."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.stages import Stages
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "noise"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, out: Path, families: Sequence[str], rungs: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the experiment and writes its results; finished rungs are read from the cache.

    Args:
        settings: All settings; `ladder.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: Output folder for tables, findings and figures.
        families: Names of the families of the gallery.
        rungs: Names of the rungs of the noise ladder.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    from studies.noise_models.cells import Cell
    from studies.noise_models.figures import FIGURES
    from studies.noise_models.findings import KEPT, summarise

    def replicate(family: str, seed: int, stages: Stages) -> "Mapping[str, pd.DataFrame]":
        telemetry = dataclasses.replace(settings.telemetry, noise=family)
        return Cell(dataclasses.replace(settings, telemetry=telemetry, seed=seed), stages).tables(rungs)

    make_folder(out)
    first = settings.ladder.first_seed
    seeds = range(first, first + settings.ladder.num_seeds)
    tables = collect("noise", seed_by_seed(replicate, families, seeds), cache, fresh, tell)
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "first_seed": first})
