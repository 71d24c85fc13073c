"""`python -m enhsim_tf.reproduce --experiment noise`: every rung of the noise ladder on every family of the gallery."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.reproduce.replicates import collect, seed_by_seed, write_results
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import Stages

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "noise"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, out: Path, families: Sequence[str], rungs: Sequence[str], fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the experiment and writes its results; finished rungs are read from the cache, and rows of former seeds in `out` are kept.

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
    from enhsim_tf.reproduce.noise_ladder.cells import Cell
    from enhsim_tf.reproduce.noise_ladder.figures import FIGURES
    from enhsim_tf.reproduce.noise_ladder.findings import KEPT, summarise

    def replicate(family: str, seed: int, stages: Stages) -> "Mapping[str, pd.DataFrame]":
        telemetry = dataclasses.replace(settings.telemetry, noise=family)
        return Cell(dataclasses.replace(settings, telemetry=telemetry, seed=seed), stages).tables(rungs)

    make_folder(out)
    first = settings.ladder.first_seed
    seeds = range(first, first + settings.ladder.num_seeds)
    tables = collect("noise", seed_by_seed(replicate, families, seeds), cache, fresh, tell)
    tables = KEPT.with_earlier_seeds(tables, out, first)
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "first_seed": first})


def lines(found: dict[str, Any]) -> list[str]:
    """A line for each family: the noise model that is chosen, and the false alarms of each."""
    rates = {
        name: ", ".join(f"{rung} {values['alarms']:.1%}" for rung, values in about["rungs"].items())
        for name, about in found["families"].items()
    }
    chosen = {name: ", ".join(dict.fromkeys(each["chosen"] for each in about["choices"])) for name, about in found["families"].items()}
    return [f"{name:18} ({about['half']}) chosen: {chosen[name]}; false alarms: {rates[name]}" for name, about in found["families"].items()]
