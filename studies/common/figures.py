"""Saves the figures of a study from its findings."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.figure import Figure, save


def save_all(
    figures: Mapping[str, Figure], found: Mapping[str, Any], folder: str | os.PathLike, command: str, names: Sequence[str] = ()
) -> list[Path]:
    """Draws the figures of a study from its findings and writes them, as `save` does.

    Args:
        figures: The study's figures by name.
        found: Its findings.
        folder: An existing folder.
        command: The command of the study, which is the caption.
        names: Names of the figures; empty for all.

    Returns:
        The paths of the files.
    """
    return [path for name in names or figures for path in save(name, found, folder, command, found["budget"] == "smoke", figures=figures)]
