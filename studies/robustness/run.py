"""Runs all replicates of the study of robustness and writes tables, findings and figures."""

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
    """Runs the study and writes its results; finished replicates are read from the cache.

    Args:
        settings: All settings; `robustness.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: An existing folder for tables, findings and figures.
        environments: Kinds of noise; degraded modes are tested with the first.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.
    """
    from studies.robustness.degraded_modes import DegradedModes
    from studies.robustness.figure import FIGURES
    from studies.robustness.replicate import Replicate
    from studies.robustness.summary import KEPT, summarise

    def tables_of(environment: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        one = Replicate(settings.of(environment, seed), stages)
        return one.tables | ({"degraded": DegradedModes(one).table} if environment == environments[0] else {})

    first = settings.robustness.first_seed
    replicates = seed_by_seed(tables_of, environments, range(first, first + settings.robustness.num_seeds))
    tables = collect("replicate", replicates, cache, fresh, tell)
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget})
