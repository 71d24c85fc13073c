"""The frame that experiments share: replicates in turn, tables of all of them, and the files that are written from the tables."""

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder, write_json
from enhsim_tf.reproduce.stages import VERSIONS, Stages, Turns
from enhsim_tf.reproduce.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

Replicate = Callable[[Stages], "Mapping[str, pd.DataFrame]"]
"""Computes the tables of one replicate. It returns no table if the replicate is left out."""


def collect(
    what: str, replicates: Sequence[tuple[str, Replicate]], cache: Path, fresh: bool, tell: Callable[[str], None]
) -> "dict[str, pd.DataFrame]":
    """Computes replicates in turn and joins their tables.

    Args:
        what: What a replicate is, in the singular.
        replicates: Name and function of each replicate, in the order in which they are computed.
        cache: Folder of cached stages.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each replicate and stage.
    """
    import pandas as pd

    parts: dict[str, list[pd.DataFrame]] = {}
    turns = Turns(what, len(replicates), tell)
    for name, replicate in replicates:
        turns.begin(name)
        stages = Stages(cache, fresh, tell, speaks=not sys.stdout.isatty())
        for each, table in replicate(stages).items():
            parts.setdefault(each, []).append(table)
        turns.end(stages)
        from enhsim_tf.keras_tools.backend import keras

        keras.backend.clear_session()  # frees the memory of the replicate's networks
    return {name: pd.concat(tables, ignore_index=True) for name, tables in parts.items()}


def write_results(
    tables: "Mapping[str, pd.DataFrame]",
    kept: KeptTables,
    summarise: "Callable[[dict[str, pd.DataFrame]], dict[str, Any]]",
    figures: Mapping[str, Any],
    folder: Path,
    about: Mapping[str, Any],
) -> dict[str, Any]:
    """Writes the tables of an experiment, and the findings and figures that are computed from the written tables.

    Args:
        tables: The tables by name.
        kept: How they are written.
        summarise: Computes the findings.
        figures: The figures by name.
        folder: Output folder.
        about: What the findings also hold; versions of packages are joined with those of all experiments.

    Returns:
        The findings.
    """
    from enhsim_tf.reproduce.figure import save_all

    make_folder(folder)
    kept.write(tables, folder)
    found = summarise(kept.read(folder))
    found |= {**about, "versions": VERSIONS | about.get("versions", {})}
    write_json(folder / "findings.json", found)
    save_all(figures, found, folder, kept.command)
    return found
