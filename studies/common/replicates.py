"""The frame that studies share: replicates in turn, and the tables, findings and figures of all of
them.
"""

import argparse
import importlib
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.common.console import tell
from enhsim_tf.common.figure import Figure, save
from enhsim_tf.common.stages import VERSIONS, Stages
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd


def run_study(
    study: str,
    tables_of: "Callable[[str, int, Stages], Mapping[str, pd.DataFrame]]",
    names: Iterable[str],
    options: argparse.Namespace,
    settings: Settings,
    out: Path,
    about: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Runs a study and writes its tables, and the findings and figures that are computed from the
    written tables.

    All names with one seed come before the next seed, so that an interrupted run is complete for
    its first seeds.

    Args:
        study: Name of the study, of its folder with the modules `summary` and `figure`, and of its
            group of settings, whose `first_seed` and `num_seeds` say with which seeds.
        tables_of: Computes the tables of one replicate, for a name, a seed and stages; none if the
            replicate is left out.
        names: What is computed with each seed, for example environments.
        options: The command line, with `cache` and `fresh`.
        settings: All settings.
        out: An existing folder.
        about: What the findings also hold; versions of packages are joined with those of all
            studies.

    Returns:
        The findings.
    """
    import pandas as pd

    summary, figure = (
        importlib.import_module(f"studies.{study}.{name}") for name in ("summary", "figure")
    )
    group = getattr(settings, study)
    names = tuple(names)
    parts = {}
    began = time.monotonic()
    replicates = [
        (name, group.first_seed + number) for number in range(group.num_seeds) for name in names
    ]
    for number, (name, seed) in enumerate(replicates, 1):
        tell(f"replicate {number} of {len(replicates)}: {name}, seed {seed}")
        stages = Stages(options.cache, options.fresh, tell, speaks=not sys.stdout.isatty())
        for each, table in tables_of(name, seed, stages).items():
            parts.setdefault(each, []).append(table)
        tell(f"{number} of {len(replicates)} replicates in {time.monotonic() - began:.0f} s")
        if "keras" in sys.modules:  # frees the memory of the replicate's networks
            from enhsim_tf.common.backend import keras

            keras.backend.clear_session()
    summary.KEPT.write(
        {name: pd.concat(tables, ignore_index=True) for name, tables in parts.items()}, out
    )
    about = about or {}
    found = summary.summarise(summary.KEPT.read(out))
    found |= {"budget": settings.budget, **about, "versions": VERSIONS | about.get("versions", {})}
    write_json(out / "findings.json", found)
    save_all(figure.FIGURES, found, out, summary.KEPT.command)
    return found


def save_all(
    figures: Mapping[str, Figure], found: Mapping[str, Any], folder: Path, command: str
) -> list[Path]:
    """Draws the figures of a study by name from its findings, with its command as the caption, and
    returns the files in the folder.
    """
    is_smoke = found["budget"] == "smoke"
    return [
        path
        for name, figure in figures.items()
        for path in save(figure, name, found, folder, command, is_smoke)
    ]
