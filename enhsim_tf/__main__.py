"""`python -m enhsim_tf`: telemetry of one's own, from a table to a trained simulator, training data and scores."""

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.commands import parse
from enhsim_tf.errors import InputError, printable
from enhsim_tf.terminal import finish, leave, tell

if TYPE_CHECKING:
    from enhsim_tf.cleaning import Cleaning
    from enhsim_tf.enhanced_simulator import EnhancedSimulator


def run(options: argparse.Namespace) -> int:
    """Runs what the options ask for and returns the exit code."""
    if options.seed is not None and not 0 <= options.seed < 2**31:
        raise InputError(f"Expected a seed from 0 to before 2**31. Received: --seed {options.seed}.")
    return {"fit": run_fit, "generate": run_generate, "verify": run_verify, "score": run_score}[options.command](options)


def run_fit(options: argparse.Namespace) -> int:
    """Fits a simulator to each channel of the source."""
    from enhsim_tf.fit_options import FitOptions

    counts = (options.num_windows, options.epochs, options.iterations)
    chosen = FitOptions(options.window, *counts, options.noise, options.held_out, options.seed)
    from enhsim_tf.engines import workers_of

    workers = workers_of(options.workers)
    from enhsim_tf.channels import fit_channels  # pandas takes a while
    from enhsim_tf.sources import read_source

    cleaning = cleaning_of(options, options.window or 64)
    series = read_source(options.source, options.column, options.time, cleaning)
    is_terminal = sys.stdout.isatty()
    failed = fit_channels(series, options.out, chosen, cleaning, workers, tell, is_terminal, options.engine, speaks=not is_terminal)
    return tell_failed(failed)


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data from each channel's simulator."""
    if options.nominal_share is not None and not options.scenarios and (options.continuous is not None or not options.scenario):
        raise InputError("Expected --nominal-share with --windows and --scenario only. Received: it without them. Leave it out.")
    if options.start is not None and options.continuous is None:
        raise InputError(f"Expected --start with --continuous only. Received: --start {options.start} with --windows. Leave it out.")
    if options.workers or options.engine or options.scenarios:
        from enhsim_tf.fleet_command import run_fleet

        return run_fleet(options, tell)
    options.seed = options.seed or 0
    from enhsim_tf.training_sets import (
        num_samples_of,
        parse_length,
        parse_scenario,
        shares_of,
        start_of,
        write_series_labelled,
        write_windows_labelled,
    )

    scenarios = [parse_scenario(text) for text in options.scenario]
    if options.windows is None and options.continuous is None:
        raise InputError("Expected --windows or --continuous. Received: neither.")
    if options.windows is not None and options.windows < 1:
        raise InputError(f"Expected at least one window. Received: --windows {options.windows}.")
    if options.continuous is not None and len(scenarios) > 1:
        raise InputError(f"Expected at most one --scenario with --continuous. Received: {len(scenarios)}. Write a series for each.")
    nominal_share = 0.5 if options.nominal_share is None else options.nominal_share
    shares = shares_of(scenarios, options.windows or 0, nominal_share, options.seed) if options.windows else []
    start = None if options.start is None else start_of(options.start)
    if options.continuous is not None:
        parse_length(options.continuous)
    from enhsim_tf.channels import chosen_of, models_of

    models = chosen_of(models_of(options.models), options.channel)
    paths = outputs_of(options.out, models, (".parquet",))

    def write(channel: str) -> None:
        simulator = load(models[channel])
        if options.continuous is None:
            write_windows_labelled(paths[channel], simulator, shares)
            what = f"{counted(options.windows, 'window')} of {simulator.window} samples"
        else:
            length = num_samples_of(options.continuous, simulator.interval_s)
            scenario = scenarios[0] if scenarios else None
            write_series_labelled(paths[channel], simulator, length, scenario, options.seed, start)
            what = f"{counted(length, 'sample')}, one every {simulator.interval_s:g} s"
        tell(f"{printable(channel)}: {what} in {paths[channel]}")
        if not scenarios:
            return
        from enhsim_tf.trusted_range import TrustedRange

        trusted = TrustedRange(simulator)
        for scenario in scenarios:
            share = trusted.share_outside(scenario)
            tell(
                f"{printable(channel)}: {scenario.mode} at {scenario.severity:g}: {share:.0%} of such windows are beyond what its enhancer learnt from"
            )

    return for_each(models, write)


def run_verify(options: argparse.Namespace) -> int:
    """Checks a large data set."""
    from enhsim_tf.fleet import verify

    return verify(options.folder, tell)


def run_score(options: argparse.Namespace) -> int:
    """Scores each channel of the source that has a simulator."""
    from enhsim_tf import detectors
    from enhsim_tf.scoring import ScoreOptions, score_channel, write_scores

    detector = {name.casefold().replace(" ", "-"): name for name in detectors.DETECTORS}[options.detector]
    chosen = ScoreOptions(detector, options.windows, options.false_alarm_rate, options.seed)
    cleaning = cleaning_of(options, 2)
    from enhsim_tf.channels import models_of
    from enhsim_tf.cleaning import clean
    from enhsim_tf.sources import read_source

    models = models_of(options.models)
    series = read_source(options.source, options.column, options.time, cleaning)
    if len(models) == 1 and len(series) == 1:  # one of each belong together, whatever they are called
        models = dict(zip(series, models.values(), strict=True))
    unknown = [name for name in series if name not in models]
    if unknown:
        known = ", ".join(list(models)[:8])
        raise InputError(
            f"Expected channels that were fitted: {printable(known)}. Received: {unknown[0]!r}. Name those to be scored with --column."
        )
    paths = outputs_of(options.out, series, (".parquet", ".csv"))
    for path in paths.values():
        if path.exists() and os.path.exists(options.source) and path.samefile(options.source):
            raise InputError(f"Expected another --out than the source. Received: {path} for both. Name another.")

    def write(channel: str) -> None:
        cleaned = clean(series[channel], cleaning)
        frame = score_channel(load(models[channel]), cleaned.parts, chosen)
        write_scores(paths[channel], frame)
        tell("\n".join(cleaned.report.lines()))
        left, num_flags = int(frame["score"].isna().sum()), int(frame["flag"].sum())
        scored = len(frame) - left
        tell(
            f"{printable(channel)}: {num_flags:,} of {counted(scored, 'scored sample')} ({num_flags / scored:.1%}) flagged by {chosen.detector}, "
            f"set to flag {chosen.false_alarm_rate:.1%} of generated nominal ones"
            + (f"; {counted(left, 'sample')} not scored, in pieces shorter than a window" if left else "")
            + f"; in {paths[channel]}"
        )

    return for_each(series, write)


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
    from enhsim_tf.cleaning import Cleaning

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
    from enhsim_tf.channels import folder_of
    from enhsim_tf.files import make_folder

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
    from enhsim_tf.enhanced_simulator import EnhancedSimulator

    return EnhancedSimulator.load(folder)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; a user's mistake is one line and exit code 2."""
    return finish(lambda: run(parse(arguments)), "interrupted; what was finished is kept")


if __name__ == "__main__":
    leave(main())
