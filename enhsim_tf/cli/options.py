"""Functions shared by several commands: output files, loading, and reporting of failed channels."""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable, spoken
from enhsim_tf.simulator.joint import join_channels
from enhsim_tf.simulator.model_folder import channels_of, folder_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.clean import Cleaned, Cleaning, clean
from enhsim_tf.telemetry.reading.channels import Channels


def for_each(channels: Iterable[str], work: Callable[[str], None]) -> int:
    """Calls a function for each channel and returns the exit code. If one of several channels fails, the others go on."""
    channels, failed = list(channels), {}
    for channel in channels:
        try:
            work(channel)
        except InputError as error:
            if len(channels) == 1:
                raise
            failed[channel] = str(error)
    return tell_failed(failed)


def tell_failed(failed: dict[str, str]) -> int:
    """Prints one line on stderr for each reason, with the channels that failed for it, and returns the exit code."""
    for reason in dict.fromkeys(failed.values()):
        channels = [channel for channel, each in failed.items() if each == reason]
        print(f"error: {spoken(channels)}: {' '.join(reason.splitlines())}", file=sys.stderr)
    return 2 if failed else 0


def output_paths(out: Path, channels: Iterable[str], suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Returns the output file of each channel.

    Args:
        out: The value of `--out`: a file for one channel, or a folder that gets one file per channel.
        channels: Names of the channels.
        suffixes: Allowed file extensions; the first is used for files in a folder.
    """
    names, is_folder = list(channels), os.path.isdir(out)
    if out.suffix in suffixes and not is_folder:
        if len(names) > 1:
            raise InputError(
                f"Expected a folder for {len(names)} files ({printable('; '.join(names[:8]))}). Received: --out {out}. Give a folder, or choose "
                "one with --column (of `generate`, with --channel)."
            )
        make_folder(out.parent)
        return {names[0]: out}
    if out.suffix and not is_folder:
        raise InputError(
            f"Expected a file that ends in {' or '.join(suffixes)}, or a folder. Received: --out {out}."
        )
    paths = {name: folder_of(out, name).with_suffix(suffixes[0]) for name in names}
    make_folder(out)
    return paths


def refuse_same_file(paths: Iterable[Path], source: str | Sequence[str]) -> None:
    """Checks that no output file is an input file. The source is one or several files, or no file at all."""
    for path in paths:
        for each in [source] if isinstance(source, str) else source:
            if path.exists() and os.path.exists(each) and path.samefile(each):
                raise InputError(
                    f"Expected --out to differ from the input. Received: {path} for both. Give another --out."
                )


def channels_by_model(
    series: Iterable[str], models: Mapping[str, Path]
) -> dict[str, dict[str, str]]:
    """Returns, for each model whose channels a source has, the name in the source of each of its channels; says which columns are left.

    A single channel and a single model of one channel match even if their names differ.
    """
    series = list(series)
    wanted = {name: channels_of(folder) for name, folder in models.items()}
    if len(series) == len(wanted) == 1 and len(next(iter(wanted.values()))) == 1:
        ((name, (channel,)),) = wanted.items()
        return {name: {channel: series[0]}}
    found = {
        name: {channel: channel for channel in channels}
        for name, channels in wanted.items()
        if set(channels) <= set(series)
    }
    used = {channel for channels in found.values() for channel in channels}
    if not found:
        known = printable("; ".join(", ".join(channels) for channels in list(wanted.values())[:8]))
        raise InputError(
            f"Expected fitted channels: {known}. Received: {', '.join(series[:8])}. Give telemetry with these columns."
        )
    others = [name for name in series if name not in used]
    if others:
        tell(f"columns without a fitted simulator, left out: {printable(', '.join(others[:8]))}")
    return found


def cleaned_channels(
    series: Mapping[str, pd.Series], names: Mapping[str, str], cleaning: Cleaning
) -> tuple[Recording, dict[str, Cleaned]]:
    """Cleans channels, whose names in the source are given, brings them onto one clock, and returns what was cleaned."""
    cleaned = {channel: clean(series[name], cleaning) for channel, name in names.items()}
    joined = join_channels({channel: each.parts for channel, each in cleaned.items()})
    if len(joined) > 1:
        raise InputError(
            f"Expected the channels {', '.join(names)[:120]} at the same times. Received: {len(joined)} groups without enough common time. "
            "Give telemetry of the same time."
        )
    return joined[0], cleaned


def run_for(
    simulator: EnhancedSimulator, series: Channels, options: argparse.Namespace, cleaning: Cleaning
) -> Recording | None:
    """Returns the coarse run that a simulator needs: the commands beside the telemetry, or the run of `--coarse`; None for waves."""
    if not simulator.is_run_model:
        if options.coarse is not None:
            simulator.recorded_runs()
        return None
    commands = simulator.alignment.commands
    if commands is not None and options.coarse is None:
        if series.commands is None:
            raise InputError(
                f"Expected an array with commands, as in the fit. Received: none beside {next(iter(series))} in {options.source}. "
                "Give such an array, and no other column than 0."
            )
        return commands.recording(series.commands)
    if options.coarse is None:
        raise InputError(
            f"Expected --coarse, the run of the same time, because the simulator was fitted to runs of {simulator.alignment.name}. Received: none."
        )
    columns = simulator.alignment.columns
    try:
        return read_recording(
            options.coarse,
            columns,
            options.coarse_time,
            cleaning.of_run(),
            simulator.interval_s,
            options.coarse_start,
        )
    except InputError as error:
        if series.table is None or not set(columns) <= set(series.table):
            raise
        raise InputError(
            f"{error} Perhaps {options.source}, which has the columns of the run, is the run. Swap the two."
        ) from None
