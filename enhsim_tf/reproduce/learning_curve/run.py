"""`python -m enhsim_tf.reproduce --experiment learning-curve`: how few real windows suffice, and from how few a simulator pays."""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import make_folder, write_json
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import VERSIONS, Stages, Turns

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

    from enhsim_tf.reproduce.figure import save_all
    from enhsim_tf.reproduce.learning_curve.cells import Cell, World
    from enhsim_tf.reproduce.learning_curve.figures import FIGURES
    from enhsim_tf.reproduce.learning_curve.findings import KEPT, summarise

    folder, frames = make_folder(out), []
    turns = Turns("learning curve", settings.curve.num_seeds * len(environments), tell)
    for number in range(settings.curve.num_seeds):
        for environment in environments:
            seed = settings.curve.first_seed + number
            turns.begin(f"{environment}, seed {seed}")
            stages = Stages(cache, fresh, tell, speaks=not sys.stdout.isatty())
            telemetry = dataclasses.replace(settings.telemetry, noise=environment)
            world = World(dataclasses.replace(settings, telemetry=telemetry, seed=seed))
            frames += [Cell(world, num_real).rows(rungs, stages) for num_real in settings.curve.num_real]
            turns.end(stages)
            from enhsim_tf.keras_tools.backend import keras

            keras.backend.clear_session()  # frees the memory of the networks
    KEPT.write({"rows": pd.concat(frames, ignore_index=True)}, folder)
    found = summarise(KEPT.read(folder))
    found |= {"budget": settings.budget, "first_seed": settings.curve.first_seed, "versions": VERSIONS}
    write_json(folder / "findings.json", found)
    save_all(FIGURES, found, folder, KEPT.command)
    return found
