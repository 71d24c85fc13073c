"""The cells of the study, one for each channel and seed, and the tables that they fill."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages
from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.settings import Settings
from studies.spacecraft.telemanom import LabelledChannel, load_channel, read_labels

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.simulator.simulator import EnhancedSimulator

TABLES = ("channels", "enhancement", "detectors")
SIMULATORS = {"network": "the paper's network", "ridge": "tuned ridge regression"}
"""Enhancers of the two simulators that are fitted to each channel."""


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
    from studies.spacecraft.figure import FIGURES
    from studies.spacecraft.summary import KEPT, summarise

    skipped: dict[str, str] = {}

    def tables_of(name: str, seed: int, stages: Stages) -> "Mapping[str, pd.DataFrame]":
        try:
            return tables_of_channel(load_channel(data, name), settings.of(settings.noise, seed), stages)
        except InputError as error:  # a channel that cannot be used
            skipped[name] = str(error)
            tell(f"left out: {error}")
            return {}

    chosen = list(channels or labels)
    seeds = range(settings.seed, settings.seed + settings.labelled.num_seeds)
    tables = collect("channel", seed_by_seed(tables_of, chosen, seeds), cache, fresh, tell)
    if not tables:
        raise InputError(f"Expected a channel that can be used. Received: none of {len(chosen)} in {data}. The first: {skipped[chosen[0]]}")
    return write_results(tables, KEPT, summarise, FIGURES, make_folder(out), {"budget": settings.budget, "skipped": skipped})


def tables_of_channel(channel: LabelledChannel, settings: Settings, stages: Stages) -> "dict[str, pd.DataFrame]":
    """Fits both simulators to a channel with one seed, and judges everything on its test part.

    Args:
        channel: The channel with its labels.
        settings: All settings; `labelled` and `seed` are used.
        stages: Runs stages and caches their results.

    Returns:
        The tables of `TABLES` by name.

    Raises:
        InputError: If the channel cannot be used.
    """
    import pandas as pd

    name = channel.labels.channel
    checksums = [zlib.crc32(np.ascontiguousarray(part.values)) for part in (channel.train, channel.test)]
    depends = (checksums, settings.labelled, settings.seed)
    fits = {
        enhancer: stages.run(f"fit {name} {enhancer}", lambda folder, each=enhancer: _fit(folder, channel, each, settings, stages), depends)
        for enhancer in SIMULATORS
    }

    def judge(folder: Path) -> None:
        from enhsim_tf.simulator.simulator import EnhancedSimulator

        simulators = {enhancer: EnhancedSimulator.load(path / "simulator") for enhancer, path in fits.items()}
        for table, rows in judge_channel(channel, simulators, settings, stages).items():
            pd.DataFrame(rows).assign(channel=name, seed=settings.seed).to_parquet(folder / f"{table}.parquet")

    folder = stages.run(f"judge {name}", judge, depends, after=[f"fit {name} {enhancer}" for enhancer in SIMULATORS])
    return {table: pd.read_parquet(folder / f"{table}.parquet") for table in TABLES}


def _fit(folder: Path, channel: LabelledChannel, enhancer: str, settings: Settings, stages: Stages) -> None:
    from enhsim_tf.simulator.fitting import fit
    from enhsim_tf.simulator.options import FitOptions

    chosen = settings.labelled
    options = FitOptions(
        num_windows=chosen.num_windows,
        epochs=chosen.epochs,
        noise="residual windows",
        held_out=0.0,
        seed=settings.seed,
        enhancer=enhancer,
    )
    simulator, _ = fit(channel.train, options=options, progress=stages.progress)
    if simulator.alignment.simulators[0].is_constant:
        raise InputError(
            f"Expected a periodic channel, because the study compares enhancers of square waves. Received: {channel.labels.channel}, "
            "whose coarse simulator is a constant level. Use another channel."
        )
    simulator.save(folder / "simulator")


def judge_channel(
    channel: LabelledChannel, simulators: "Mapping[str, EnhancedSimulator]", settings: Settings, stages: Stages
) -> dict[str, list[dict[str, Any]]]:
    """The rows of all tables for a channel whose simulators, by `SIMULATORS`, are fitted."""
    from studies.spacecraft.enhancement import error_rows
    from studies.spacecraft.judging import Judge
    from studies.spacecraft.reference import NETWORK, RIDGE, reference_rows
    from studies.spacecraft.training_data import generators, real_windows, source_rows

    network, ridge = simulators["network"], simulators["ridge"]
    chosen, train, window = settings.labelled, channel.train, network.window
    period = max(wave.period_s for wave in network.alignment.simulators[0].waves) / train.interval_s
    judge = Judge(channel, window, period, chosen.false_alarm_rate)
    real = real_windows(train, window, chosen.num_arm_windows)
    generated = generators(train, network, ridge, settings, stages.progress)
    rows = source_rows(judge, real, generated, settings, stages.tell)
    rows += reference_rows(judge, channel, {NETWORK: network, RIDGE: ridge}, settings)
    about = {"samples": len(channel.test), "train_samples": len(train), "window": window, "period": period}
    return {
        "channels": [about | {"num_nominal": int(judge.is_nominal.sum())}],
        "enhancement": error_rows(network, ridge, channel, chosen.num_windows),
        "detectors": rows,
    }
