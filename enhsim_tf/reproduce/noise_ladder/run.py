"""`python -m enhsim_tf.reproduce --experiment noise`: every rung of the noise ladder on every family of the gallery."""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import make_folder, write_json
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import VERSIONS, Stages, Turns

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
    import pandas as pd

    from enhsim_tf.reproduce.figure import save_all
    from enhsim_tf.reproduce.noise_ladder.cells import Cell
    from enhsim_tf.reproduce.noise_ladder.figures import FIGURES
    from enhsim_tf.reproduce.noise_ladder.findings import KEPT, summarise

    folder = make_folder(out)
    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in KEPT.names}
    turns = Turns("noise", settings.ladder.num_seeds * len(families), tell)
    for number in range(settings.ladder.num_seeds):
        for family in families:
            seed = settings.ladder.first_seed + number
            turns.begin(f"{family}, seed {seed}")
            stages = Stages(cache, fresh, tell, speaks=not sys.stdout.isatty())
            telemetry = dataclasses.replace(settings.telemetry, noise=family)
            cell = Cell(dataclasses.replace(settings, telemetry=telemetry, seed=seed), stages)
            for name, found in cell.tables(rungs).items():
                parts[name].append(found)
            turns.end(stages)
            from enhsim_tf.keras_tools.backend import keras

            keras.backend.clear_session()  # frees the memory of the networks
    KEPT.write({name: pd.concat(found, ignore_index=True) for name, found in parts.items()}, folder)
    found = summarise(KEPT.read(folder))
    found |= {"budget": settings.budget, "first_seed": settings.ladder.first_seed, "versions": VERSIONS}
    write_json(folder / "findings.json", found)
    save_all(FIGURES, found, folder, KEPT.command)
    return found
