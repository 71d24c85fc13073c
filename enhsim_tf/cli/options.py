"""Functions shared by several commands: cleaning options, output files, loading, and reporting of failed channels."""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.runs.model import RunModel
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from enhsim_tf.telemetry.cleaning.clean import Cleaning


def for_each(channels: Iterable[str], work: Callable[[str], None]) -> int:
    """Calls a function for each channel and returns the exit code. A channel that fails does not stop the others.

    Args:
        channels: Names of the channels.
        work: Function of a channel's name.

    Raises:
        InputError: If there is only one channel and it fails.
    """
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
    """Prints one line on stderr for each failed channel and returns the exit code.

    Args:
        failed: The reason of each failure, by the channel's name.
    """
    for channel, reason in failed.items():
        print(f"error: {printable(channel)}: {' '.join(reason.splitlines())}", file=sys.stderr)
    return 2 if failed else 0


def counted(number: int, noun: str) -> str:
    """Formats a number with its noun, for example `1 window` or `2,000 windows`."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def cleaning_options(options: argparse.Namespace, min_part: int, labelled: str = "keep") -> "Cleaning":
    """Returns the settings of reading and cleaning given by the options.

    Args:
        options: Parsed options of a command that reads telemetry or runs.
        min_part: Minimum length of a part in samples.
        labelled: Treatment of rows that are labelled anomalous.
    """
    from enhsim_tf.telemetry.cleaning.clean import Cleaning

    bad = "drop" if options.drop_bad else "refuse"
    return Cleaning(
        **{
            name: getattr(options, name)
            for name in ("label_column", "series_column", "value_column", "no_header")
            if hasattr(options, name)
        },
        interval_s=getattr(options, "interval", None),
        decimal=getattr(options, "decimal", None),
        labelled=labelled,
        time_format=options.time_format,
        missing_values=tuple(value for values in options.missing_values for value in values.split(",")),
        timezone=options.timezone,
        on_bad_times=bad,
        on_bad_values=bad,
        max_fill=options.max_fill,
        fill=options.fill,
        min_part=min_part,
    )


def output_paths(out: Path, channels: Iterable[str], suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Returns the output file of each channel.

    Args:
        out: The value of `--out`: a file for one channel, or a folder that gets one file per channel.
        channels: Names of the channels.
        suffixes: Allowed file extensions; the first is used for files in a folder.

    Raises:
        InputError: If one file is given for several channels, or if a file cannot be written.
    """
    from enhsim_tf.common.atomic_files import make_folder
    from enhsim_tf.enhanced_simulator.model_folder import folder_of

    names, is_folder = list(channels), os.path.isdir(out)
    if out.suffix in suffixes and not is_folder:
        if len(names) > 1:
            raise InputError(
                f"Expected a folder for {len(names)} channels ({printable(', '.join(names[:8]))}). Received: --out {out}. Give a folder, or choose one channel."
            )
        make_folder(out.parent)
        return {names[0]: out}
    if out.suffix and not is_folder:
        raise InputError(f"Expected a file that ends in {' or '.join(suffixes)}, or a folder. Received: --out {out}.")
    paths = {name: folder_of(out, name).with_suffix(suffixes[0]) for name in names}
    for path in paths.values():
        if os.path.isdir(path):
            raise InputError(f"Expected to write the file {path}. Received: a folder of that name. Give another --out.")
    make_folder(out)
    return paths


def refuse_same_file(paths: Iterable[Path], source: str | Sequence[str]) -> None:
    """Checks that no output file is an input file.

    Args:
        paths: Output files.
        source: The input, one or several files; it may be no file at all.

    Raises:
        InputError: If one is.
    """
    for path in paths:
        for each in [source] if isinstance(source, str) else source:
            if path.exists() and os.path.exists(each) and path.samefile(each):
                raise InputError(f"Expected --out to differ from the input. Received: {path} for both. Give another --out.")


def model_names(series: Iterable[str], models: Iterable[str]) -> dict[str, str]:
    """Returns the name of the model of each channel that has one, and says which others the source has.

    A single channel and a single model match even if their names differ.

    Args:
        series: Names of the channels.
        models: Names of the fitted channels.

    Raises:
        InputError: If no channel has a model.
    """
    series, models = list(series), list(models)
    if len(series) == len(models) == 1:
        return {series[0]: models[0]}
    found = {name: name for name in series if name in models}
    others = [name for name in series if name not in models]
    if not found:
        known = printable(", ".join(models[:8]))
        raise InputError(f"Expected fitted channels: {known}. Received: {', '.join(others[:8])}. Select the channels with --column.")
    if others:
        tell(f"columns without a fitted simulator, left out: {printable(', '.join(others[:8]))}")
    return found


def events_line(frame: "pd.DataFrame", path: Path) -> str:
    """Says how many events the scores of a channel have, and how many are expected on nominal telemetry.

    Args:
        frame: Scores with the attributes that `scoring.note_alarms` sets.
        path: Path of the scores.
    """
    from enhsim_tf.enhanced_simulator.scoring import events_path

    number, (expected, low, high) = len(frame.attrs["events"]), frame.attrs["false_alarms_per_day"]
    unit = "day" if hasattr(frame.index, "tz") else "86,400 samples"
    return (
        f"{counted(number, 'event')} in {events_path(path)}; on generated nominal telemetry {expected:.3g} false alarms per {unit} "
        f"(95 % interval {low:.3g} to {high:.3g})"
    )


def load(folder: Path) -> "EnhancedSimulator | RunModel":
    """Loads the simulator or run model saved in a folder; TensorFlow is imported only here."""
    from enhsim_tf.enhanced_simulator.saving import is_run_model

    if is_run_model(folder):
        from enhsim_tf.enhanced_simulator.runs.model import RunModel

        return RunModel.load(folder)
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

    return EnhancedSimulator.load(folder)
