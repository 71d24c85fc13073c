"""The caption line of a figure: what was run, and the command that draws the figure again."""

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.reproduce.settings import LOCATION

if TYPE_CHECKING:
    from enhsim_tf.reproduce.paper.pipeline import Experiment


def figure_caption(name: str, experiment: "Experiment") -> str:
    """The caption line of a figure, with every option that differs from its default and affects the figure.

    Args:
        name: One of `paper.figures.FIGURES`.
        experiment: What its arrays come from.
    """
    settings, source, options = experiment.settings, experiment.source, []
    if source is not None:
        options += ["--telemetry", _as_typed(source.path)]
        options += [] if source.column is None else ["--column", source.column]
        options += [] if source.time is None else ["--time", source.time]
    if location := str(getattr(experiment, "location", "")):  # only for stores other than the default
        options += ["--store", "influxdb" if location == LOCATION else location]
    options += [] if settings.budget == "full" else ["--budget", settings.budget]
    options += ["--seed", str(settings.seed)] if settings.seed else []
    options += ["--only", name.split("_")[0]]
    return f"seed {settings.seed} · {settings.budget} budget · {shlex.join(['python', '-m', 'enhsim_tf.reproduce', *options])}"


def _as_typed(path: Path) -> str:
    """A path relative to the current folder if it lies in that folder, so that no absolute path of the machine appears in the figure."""
    here = Path(os.path.abspath(path))  # without following links: the name is the user's
    return str(here.relative_to(Path.cwd())) if here.is_relative_to(Path.cwd()) else str(path)
