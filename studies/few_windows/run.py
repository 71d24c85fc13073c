"""Runs the study of few windows and writes table, findings and figure."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.stages import Stages
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd


def run(
    settings: Settings, cache: Path, out: Path, environments: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the study and writes its results; finished cells are read from the cache.

    Args:
        settings: All settings; `few_windows.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: An existing folder for table, findings and figure.
        environments: Kinds of noise.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    import pandas as pd

    from studies.few_windows.cells import Cell, World
    from studies.few_windows.figure import FIGURES
    from studies.few_windows.summary import KEPT, summarise

    def tables_of(environment: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        world = World(settings.of(environment, seed))
        return {"rows": pd.concat([Cell(world, number).rows(stages) for number in settings.few_windows.num_real], ignore_index=True)}

    first = settings.few_windows.first_seed
    replicates = seed_by_seed(tables_of, environments, range(first, first + settings.few_windows.num_seeds))
    tables = collect("few windows", replicates, cache, fresh, tell)
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget})
