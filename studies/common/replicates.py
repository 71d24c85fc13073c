"""The frame that studies share: replicates in turn, tables of all of them, and the files that are written from the tables."""

import argparse
import functools
import importlib
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.common.console import tell
from enhsim_tf.common.stages import VERSIONS, Stages
from studies.common.settings import Settings
from studies.common.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

Replicate = Callable[[Stages], "Mapping[str, pd.DataFrame]"]
"""Computes the tables of one replicate. It returns no table if the replicate is left out."""


def seed_by_seed(
    replicate: "Callable[[str, int, Stages], Mapping[str, pd.DataFrame]]", names: Iterable[str], seeds: Iterable[int]
) -> list[tuple[str, Replicate]]:
    """Replicates for `collect`, all names with one seed before the next seed, so that an interrupted run is complete for its first seeds.

    Args:
        replicate: Computes the tables for a name, a seed and stages.
        names: What is computed with each seed, for example environments.
        seeds: The seeds.
    """
    names = tuple(names)
    return [(f"{name}, seed {seed}", functools.partial(replicate, name, seed)) for seed in seeds for name in names]


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
    began, total = time.monotonic(), len(replicates)
    for number, (name, replicate) in enumerate(replicates, 1):
        tell(f"{what} {number} of {total}: {name}")
        stages = Stages(cache, fresh, tell, speaks=not sys.stdout.isatty())
        for each, table in replicate(stages).items():
            parts.setdefault(each, []).append(table)
        tell(f"{number} of {total} {what}s in {time.monotonic() - began:.0f} s")
        from enhsim_tf.common.backend import keras

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
    """Writes the tables of a study, and the findings and figures that are computed from the written tables.

    Args:
        tables: The tables by name.
        kept: How they are written.
        summarise: Computes the findings.
        figures: The figures by name.
        folder: An existing folder.
        about: What the findings also hold; versions of packages are joined with those of all studies.

    Returns:
        The findings.
    """
    from studies.common.figures import save_all

    kept.write(tables, folder)
    found = summarise(kept.read(folder))
    found |= {**about, "versions": VERSIONS | about.get("versions", {})}
    write_json(folder / "findings.json", found)
    save_all(figures, found, folder, kept.command)
    return found


def run_study(
    study: str,
    replicate: "Callable[[str, int, Stages], Mapping[str, pd.DataFrame]]",
    names: Iterable[str],
    options: argparse.Namespace,
    settings: Settings,
    out: Path,
    about: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Runs a study seed by seed and writes its tables, with the findings and figures of its modules `summary` and `figure`.

    Args:
        study: Name of the study, of its folder and of its group of settings, whose `first_seed` and `num_seeds` say with which seeds.
        replicate: Computes the tables for a name, a seed and stages.
        names: What is computed with each seed, for example environments.
        options: The command line, with `cache` and `fresh`.
        settings: All settings.
        out: An existing folder.
        about: As for `write_results`.

    Returns:
        The findings.
    """
    group = getattr(settings, study)
    seeds = range(group.first_seed, group.first_seed + group.num_seeds)
    summary, figure = (importlib.import_module(f"studies.{study}.{name}") for name in ("summary", "figure"))
    tables = collect("replicate", seed_by_seed(replicate, names, seeds), options.cache, options.fresh, tell)
    return write_results(tables, summary.KEPT, summary.summarise, figure.FIGURES, out, {"budget": settings.budget, **(about or {})})
