"""Runs all replicates of the factorial study and writes its table, findings and figure."""

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
    """Runs the study and writes its results; finished parts of replicates are read from the cache.

    Args:
        settings: All settings; `factorial.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: An existing folder for the table, the findings and the figure.
        environments: Kinds of noise.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    from studies.factorial.figure import FIGURES
    from studies.factorial.pipelines import Pipelines
    from studies.factorial.summary import KEPT, summarise
    from studies.robustness.replicate import Replicate

    def tables_of(environment: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return Pipelines(Replicate(settings.of(environment, seed), stages)).tables()

    first = settings.factorial.first_seed
    replicates = seed_by_seed(tables_of, environments, range(first, first + settings.factorial.num_seeds))
    tables = collect("replicate", replicates, cache, fresh, tell)
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget})
