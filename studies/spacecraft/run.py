"""The cells of the study, one for each channel and seed, and the tables that they fill."""

import argparse
import functools
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.figure import save
from enhsim_tf.common.stages import Stages
from studies.common.replicates import run_study
from studies.common.settings import Settings
from studies.spacecraft.channel import CHANNEL, PICTURE, stretches
from studies.spacecraft.summary import KEPT
from studies.spacecraft.telemanom import LabelledChannel, load_channel, read_labels

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.simulator.simulator import EnhancedSimulator

ENHANCERS = ("network", "ridge")
"""Enhancers of the two simulators that are fitted to each channel: the paper's network, and tuned ridge regression."""


def run(options: argparse.Namespace, settings: Settings, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; see `run_study`.

    Raises:
        InputError: If the folder does not have this layout, a channel is missing, or no channel can be used.
    """
    labels = read_labels(options.data)
    channels = (
        list(labels)
        if options.channels is None
        else [name.strip() for name in options.channels.split(",")]
    )
    unknown = [name for name in channels if name not in labels]
    if unknown:
        raise InputError(
            f"Expected --channels of {', '.join(list(labels)[:8])}. Received: {unknown[0]!r}. Name labelled ones."
        )
    skipped: dict[str, str] = {}

    def tables_of(name: str, seed: int, stages: Stages) -> "Mapping[str, pd.DataFrame]":
        try:
            return tables_of_channel(
                load_channel(options.data, name), settings.of(settings.noise, seed), stages
            )
        except InputError as error:  # a channel that cannot be used
            skipped[name] = str(error)
            tell(f"left out: {error}")
            if len(skipped) == len(channels):
                raise
            return {}

    found = run_study(
        "spacecraft", tables_of, channels, options, settings, out, {"skipped": skipped}
    )
    if set(channels) - set(skipped) >= {CHANNEL}:
        save(
            PICTURE,
            "channel",
            stretches(load_channel(options.data, CHANNEL)),
            out,
            KEPT.command,
            settings.budget == "smoke",
        )
    return found


def tables_of_channel(
    channel: LabelledChannel, settings: Settings, stages: Stages
) -> "dict[str, pd.DataFrame]":
    """Fits both simulators to a channel with one seed, and judges everything on its test part.

    Raises:
        InputError: If the channel cannot be used.
    """
    import pandas as pd

    name = channel.name
    checksums = [
        zlib.crc32(np.ascontiguousarray(part.values)) for part in (channel.train, channel.test)
    ]
    depends = (checksums, settings.spacecraft, settings.seed)
    fits = {}
    for enhancer in ENHANCERS:
        fit = functools.partial(
            _fit, channel=channel, enhancer=enhancer, settings=settings, stages=stages
        )
        fits[enhancer] = stages.run(f"fit {name} {enhancer}", fit, depends, version=3)

    def judge(folder: Path) -> None:
        from enhsim_tf.simulator.simulator import EnhancedSimulator

        simulators = [EnhancedSimulator.load(path / "simulator") for path in fits.values()]
        for table, rows in judge_channel(channel, *simulators, settings, stages).items():
            pd.DataFrame(rows).assign(channel=name, seed=settings.seed).to_parquet(
                folder / f"{table}.parquet"
            )

    folder = stages.run(
        f"judge {name}", judge, depends, after=[f"fit {name} {enhancer}" for enhancer in ENHANCERS]
    )
    return {table: pd.read_parquet(folder / f"{table}.parquet") for table in KEPT.names}


def _fit(
    folder: Path, channel: LabelledChannel, enhancer: str, settings: Settings, stages: Stages
) -> None:
    from enhsim_tf.simulator.fitting import fit
    from enhsim_tf.simulator.options import FitOptions

    chosen, counts = (
        settings.spacecraft,
        {"noise": "residual windows", "held_out": 0.0, "seed": settings.seed, "enhancer": enhancer},
    )
    options = FitOptions(num_windows=chosen.num_windows, epochs=chosen.epochs, **counts)
    simulator, _ = fit(channel.train, options=options, progress=stages.progress)
    if simulator.alignment.simulators[0].is_constant:
        raise InputError(
            f"Expected a periodic channel, because the study compares enhancers of square waves. Received: {channel.name}, "
            "whose coarse simulator is a constant level. Use another channel."
        )
    simulator.save(folder / "simulator")


def judge_channel(
    channel: LabelledChannel,
    network: "EnhancedSimulator",
    ridge: "EnhancedSimulator",
    settings: Settings,
    stages: Stages,
) -> dict[str, list[dict[str, Any]]]:
    """The rows of all tables for a channel to which two simulators are fitted, with the paper's network and with ridge regression."""
    from studies.spacecraft.enhancement import error_rows
    from studies.spacecraft.judging import Judge
    from studies.spacecraft.reference import NETWORK, RIDGE, reference_rows
    from studies.spacecraft.training_data import generators, source_rows

    train, window = channel.train, network.window
    period = max(wave.period_s for wave in network.alignment.simulators[0].waves) / train.interval_s
    judge = Judge(channel, window, period, settings.spacecraft.false_alarm_rate)
    generated = generators(train, network, ridge, settings, stages.progress)
    about = {
        "train_samples": len(train),
        "window": window,
        "num_nominal": int(judge.is_nominal.sum()),
    }
    return {
        "channels": [about],
        "enhancement": error_rows(network, ridge, channel),
        "detectors": source_rows(judge, train, generated, settings)
        + reference_rows(judge, channel, {NETWORK: network, RIDGE: ridge}, settings),
    }
