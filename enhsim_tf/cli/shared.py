"""Functions shared by several commands: output files, loading, and reporting of failed channels."""

import argparse
import collections
import contextlib
import dataclasses
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from enhsim_tf.coarse.recording_files import read_recording
from enhsim_tf.common.atomic_files import make_folder, remove_leftovers
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable, spoken
from enhsim_tf.simulator.model_folder import channels_of, folder_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean_all
from enhsim_tf.telemetry.cleaning.raw import RawChannel
from enhsim_tf.telemetry.cleaning.report import Finding, Report
from enhsim_tf.telemetry.joining import join_channels
from enhsim_tf.telemetry.reading.channels import Channels
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import read_source


def for_each(channels: Iterable[str], work: Callable[[str], None]) -> int:
    """Calls a function for each channel and returns the exit code. If one of several channels
    fails, the others go on.
    """
    channels = list(channels)
    failed: dict[str, Exception] = {}
    for channel in channels:
        with failing([channel], failed):
            work(channel)
    if len(channels) == 1 and failed:
        raise failed[channels[0]]
    return tell_failed(failed)


@contextlib.contextmanager
def failing(channels: Iterable[str], failed: dict[str, Exception]) -> Iterator[None]:
    """Keeps the error by which a block fails for channels, so that others go on; lack of memory or
    disk space is raised at once.
    """
    try:
        yield
    except (OSError, MemoryError):
        raise
    # a defect of this package, if it is no InputError: `tell_failed` raises it
    except Exception as error:  # noqa: BLE001
        # the traceback as text: it gets lost between processes, and keeps arrays alive
        error.add_note(traceback.format_exc())
        failed |= dict.fromkeys(channels, error.with_traceback(None))


def tell_failed(failed: Mapping[str, Exception]) -> int:
    """Prints one line on stderr for each reason, with the channels that failed for it, and returns
    the exit code. Reasons that differ only in the name of the channel are one. The first defect of
    this package is raised after that.
    """
    reasons = {
        channel: str(error) for channel, error in failed.items() if isinstance(error, InputError)
    }
    alike: dict[str, list[str]] = {}
    often = collections.Counter(reasons.values())
    for channel, reason in reasons.items():
        key = reason if often[reason] > 1 else reason.replace(channel, "")
        alike.setdefault(key, []).append(channel)
    for channels in alike.values():
        reason = " ".join(reasons[channels[0]].splitlines())
        print(f"error: {spoken(channels)}: {reason}", file=sys.stderr)
    for channel in failed.keys() - reasons:
        raise failed[channel]
    return 2 if failed else 0


def read_channels(options: argparse.Namespace) -> Channels:
    """Reads the source of a command."""
    return read_source(options.source, options.column, options.time, options.cleaning)


def output_paths(out: Path, channels: Iterable[str], suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Returns the output file of each channel.

    Args:
        out: The value of `--out`: a file for one channel, or a folder that gets one file per
            channel.
        channels: Names of the channels.
        suffixes: Allowed file extensions; the first is used for files in a folder.
    """
    names = list(channels)
    is_folder = os.path.isdir(out)
    if out.suffix in suffixes and not is_folder:
        if len(names) > 1:
            raise InputError(
                f"Expected a folder for {len(names)} files ({printable('; '.join(names[:8]))}). "
                f"Received: --out {out}. Give a folder, or choose "
                "one with --column (of `generate`, with --channel)."
            )
        make_folder(out.parent)
        remove_leftovers(out.parent)
        return {names[0]: out}
    if out.suffix and not is_folder:
        raise InputError(
            f"Expected a file that ends in {' or '.join(suffixes)}, or a folder. Received: --out "
            f"{out}."
        )
    paths = {name: folder_of(out, name).with_suffix(suffixes[0]) for name in names}
    make_folder(out)
    remove_leftovers(out)  # of commands that were killed
    return paths


def refuse_same_file(paths: Iterable[Path], source: str | Sequence[str]) -> None:
    """Checks that no output file is an input file. The source is one or several files, or no file
    at all.
    """
    for path in paths:
        for file in [source] if isinstance(source, str) else source:
            if path.exists() and os.path.exists(file) and path.samefile(file):
                raise InputError(
                    f"Expected --out to differ from the input. Received: {path} for both. Give "
                    "another --out."
                )


def channels_by_model(
    series: Channels, models: Mapping[str, Path], some_suffice: bool = False
) -> dict[str, dict[str, RawChannel]]:
    """Returns, for each model whose channels a source has, these channels by their names in the
    model; says which columns are left.

    A single channel and a single model of one channel match even if their names differ. If
    `some_suffice`, one of the channels of a model is enough.
    """
    wanted = {name: channels_of(folder) for name, folder in models.items()}
    if len(series) == len(wanted) == 1 and len(next(iter(wanted.values()))) == 1:
        ((name, (channel,)),) = wanted.items()
        return {name: {channel: next(iter(series.values()))}}
    shared = {
        name: [channel for channel in channels if channel in series]
        for name, channels in wanted.items()
    }
    matched = {
        name: {channel: series[channel] for channel in channels}
        for name, channels in shared.items()
        if len(channels) >= (1 if some_suffice else len(wanted[name]))
    }
    used = {channel for channels in matched.values() for channel in channels}
    if not matched:
        known = printable("; ".join(", ".join(channels) for channels in list(wanted.values())[:8]))
        raise InputError(
            f"Expected fitted channels: {known}. Received: {', '.join(list(series)[:8])}. "
            "Give telemetry with these columns."
        )
    others = [name for name in series if name not in used]
    if others:
        tell(f"columns without a fitted simulator, left out: {printable(', '.join(others[:8]))}")
    return matched


def cleaned_channels(
    channels: Mapping[str, RawChannel], cleaning: Cleaning, failed: dict[str, Exception] | None
) -> tuple[list[Telemetry], dict[str, Report]]:
    """Cleans channels, and brings those with enough common time onto one clock; returns a series
    for each such group, and the reports of cleaning. A channel that cannot be used goes into
    `failed` with the error, if it is given.
    """
    cleaned = clean_all(channels, cleaning, failed=failed)
    telemetry = {name: each.telemetry for name, each in cleaned.items()}
    reports = {name: each.report for name, each in cleaned.items()}
    groups = join_channels(telemetry) if telemetry else []
    for group in groups:
        for name in group.columns:
            if left := len(telemetry[name]) - len(group):
                said = f"samples at which another channel has none: {left:,}"
                findings = (*reports[name].findings, Finding("other channels", left, said))
                reports[name] = dataclasses.replace(reports[name], findings=findings)
    return groups, reports


def on_one_clock(
    channels: Mapping[str, RawChannel],
    cleaning: Cleaning,
    failed: dict[str, Exception] | None = None,
) -> tuple[Telemetry, dict[str, Report]]:
    """The same as `cleaned_channels` for channels that have to be one group."""
    groups, reports = cleaned_channels(channels, cleaning, failed)
    if not groups:
        raise next(iter(failed.values()))
    if len(groups) > 1:
        raise InputError(
            f"Expected the channels {', '.join(channels)[:120]} at the same times. Received: "
            f"{len(groups)} groups without enough common time. "
            "Give telemetry of the same time."
        )
    return groups[0], reports


def run_for(
    simulator: EnhancedSimulator, series: Channels, options: argparse.Namespace
) -> Telemetry | None:
    """Returns the run of `--coarse` for a simulator and the channels of a source; None if it is not
    given.
    """
    if options.coarse is None:
        return None
    columns = simulator.alignment.columns
    try:
        return read_run(options, columns, options.cleaning.of_run(), simulator.interval_s)
    except InputError as error:
        if columns is None or series.table is None or not set(columns) <= set(series.table):
            raise
        raise InputError(
            f"{error} Perhaps {options.source}, which has the columns of the run, is the run. "
            "Swap the two."
        ) from None


def read_run(
    options: argparse.Namespace,
    columns: Sequence[str] | None,
    cleaning: Cleaning,
    interval_s: float | None,
) -> Telemetry:
    """Reads the recorded run of `--coarse`, see `read_recording`."""
    return read_recording(
        options.coarse, columns, options.coarse_time, cleaning, interval_s, options.coarse_start
    )
