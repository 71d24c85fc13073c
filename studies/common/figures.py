"""Saves the figures of a study from its findings."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.figure import Figure, save


def save_all(
    figures: Mapping[str, Figure], found: Mapping[str, Any], folder: str | os.PathLike, command: str, names: Sequence[str] = ()
) -> list[Path]:
    """Draws the figures of an experiment from its findings and writes them, as `save` does.

    Args:
        figures: The experiment's figures by name.
        found: Its findings.
        folder: An existing folder.
        command: The command of the experiment, for the captions.
        names: Names of the figures; empty for all.

    Returns:
        The paths of the files.
    """
    caption = experiment_caption(found, command)
    return [path for name in names or figures for path in save(name, found, folder, caption, found["budget"] == "smoke", figures=figures)]


def experiment_caption(found: Mapping[str, Any], command: str) -> str:
    """The caption line of the figures of an experiment: its `seeds`, its `budget` and its command."""
    seeds = found["seeds"]
    is_gapless = seeds[-1] - seeds[0] == len(seeds) - 1
    several = f"{seeds[0]} to {seeds[-1]}" if is_gapless else ", ".join(map(str, seeds))
    ran = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {several}"
    return f"{ran} · {found['budget']} budget · {command}"


def in_seeds(seeds: Sequence[int]) -> str:
    """The number of seeds as text."""
    return "one seed" if len(seeds) == 1 else f"{len(seeds)} seeds"


def in_list(names: Sequence[str]) -> str:
    """Joins names with commas, and the last one with "and"."""
    names = list(names)
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
