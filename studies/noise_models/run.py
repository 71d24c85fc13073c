"""Runs the study of noise models and writes tables, findings and the figure."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd


def run(
    settings: Settings, cache: Path, out: Path, families: Sequence[str], model: str | None, fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the study and writes its results; finished models are read from the cache.

    Args:
        settings: All settings; `noise_models.num_seeds` says how many seeds.
        cache: Folder of cached stages.
        out: An existing folder for tables, findings and the figure.
        families: Names of the families of noise.
        model: Name of the only noise model to try, or None for all. Tables in the output folder keep their other rows.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.

    Raises:
        InputError: If there is no model of that name.
    """
    from studies.noise_models.cells import MODELS, REAL, Cell
    from studies.noise_models.figure import FIGURES
    from studies.noise_models.summary import KEPT, summarise

    if model not in (None, *MODELS):
        raise InputError(f"Expected --model among {', '.join(MODELS)}. Received: {model!r}.")

    def tables_of(family: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        return Cell(settings.of(family, seed), stages).tables((REAL, *MODELS) if model is None else (model,))

    first = settings.noise_models.first_seed
    tables = collect("noise", seed_by_seed(tables_of, families, range(first, first + settings.noise_models.num_seeds)), cache, fresh, tell)
    if model is not None:
        tables = {name: _joined(old, tables[name]) for name, old in KEPT.read(out).items()}
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget})


def _joined(old: "pd.DataFrame", new: "pd.DataFrame") -> "pd.DataFrame":
    """Replaces the rows of the same families, seeds and models."""
    import pandas as pd

    keys = ["family", "seed", "model"]
    known = old.set_index(keys).index.isin(new.set_index(keys).index)
    return pd.concat([old[~known], new], ignore_index=True)
