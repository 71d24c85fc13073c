"""`python -m studies.spacecraft --data FOLDER`: runs all channels and writes tables, findings, figures and the report."""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages
from enhsim_tf.telemetry.telemanom import load_channel, read_labels
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "labelled"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, data: Path, out: Path, channels: Sequence[str] | None, fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the study and writes its results; channels that were finished with a seed are read from the cache.

    Args:
        settings: All settings.
        cache: Folder of cached stages.
        data: Folder with `train/`, `test/` and `labeled_anomalies.csv`.
        out: Output folder for tables, findings and figures.
        channels: Names of the channels; None for all in the folder.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.

    Raises:
        InputError: If the folder does not have this layout, a channel is missing, or no channel can be used.
    """
    labels = read_labels(data)
    unknown = [name for name in channels or () if name not in labels]
    if unknown:
        raise InputError(f"Expected --channels of {', '.join(list(labels)[:8])}. Received: {unknown[0]!r}. Name labelled ones.")
    from studies.spacecraft.figures import FIGURES
    from studies.spacecraft.findings import KEPT, summarise
    from studies.spacecraft.study import ChannelStudy

    make_folder(out)
    skipped: dict[str, str] = {}

    def tables_of(name: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        try:
            return ChannelStudy(load_channel(data, name), dataclasses.replace(settings, seed=seed), stages, int(sys.stdout.isatty())).tables
        except InputError as error:  # a channel that cannot be used
            skipped[name] = str(error)
            tell(f"left out: {error}")
            return {}

    chosen = list(channels or labels)
    seeds = range(settings.seed, settings.seed + settings.labelled.num_seeds)
    tables = collect("channel", seed_by_seed(tables_of, chosen, seeds), cache, fresh, tell)
    if not tables:
        raise InputError(f"Expected a channel that can be used. Received: none of {len(chosen)} in {data}. The first: {skipped[chosen[0]]}")
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "skipped": skipped})
