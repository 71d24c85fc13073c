"""What several commands share: options of cleaning, output files, loading, and one line for each channel that failed."""

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.common.errors import InputError, printable

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from enhsim_tf.telemetry.cleaning.clean import Cleaning


def for_each(channels: Iterable[str], work: Callable[[str], None]) -> int:
    """Does the work for each channel; one that cannot be used does not stop the others. Returns the exit code."""
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
    """A line for each channel that could not be used; returns the exit code."""
    for channel, reason in failed.items():
        print(f"error: {printable(channel)}: {' '.join(reason.splitlines())}", file=sys.stderr)
    return 2 if failed else 0


def counted(number: int, noun: str) -> str:
    """A number with its noun: 1 window, 2,000 windows."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def cleaning_of(options: argparse.Namespace, min_part: int) -> "Cleaning":
    """The options of cleaning."""
    from enhsim_tf.telemetry.cleaning.clean import Cleaning

    bad = "drop" if options.drop_bad else "refuse"
    return Cleaning(
        interval_s=options.interval,
        timezone=options.timezone,
        on_bad_times=bad,
        on_bad_values=bad,
        max_fill=options.max_fill,
        min_part=min_part,
    )


def outputs_of(out: Path, channels: Iterable[str], suffixes: tuple[str, ...]) -> dict[str, Path]:
    """A file for each channel: the one that was named, or one a channel in the folder that was named.

    Args:
        out: What was named.
        channels: Names of the channels.
        suffixes: Of the files that can be written; the first where a folder was named.

    Raises:
        InputError: If one file was named for several channels, or it cannot be written.
    """
    from enhsim_tf.common.atomic_files import make_folder
    from enhsim_tf.enhanced_simulator.model_folder import folder_of

    names, is_folder = list(channels), os.path.isdir(out)
    if out.suffix in suffixes and not is_folder:
        if len(names) > 1:
            raise InputError(f"Expected a folder for {len(names)} channels. Received: --out {out}. Name a folder, or one channel.")
        make_folder(out.parent)
        return {names[0]: out}
    if out.suffix and not is_folder:
        raise InputError(f"Expected a file that ends in {' or '.join(suffixes)}, or a folder. Received: --out {out}.")
    paths = {name: folder_of(out, name).with_suffix(suffixes[0]) for name in names}
    for path in paths.values():
        if os.path.isdir(path):
            raise InputError(f"Expected to write the file {path}. Received: a folder of that name. Name another --out.")
    make_folder(out)
    return paths


def load(folder: Path) -> "EnhancedSimulator":
    """The simulator of a folder."""
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

    return EnhancedSimulator.load(folder)
