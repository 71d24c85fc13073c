"""The option `--coarse` of the commands: recorded runs of the user's own simulator."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.cli.options import cleaning_options, counted, events_line, for_each, output_paths, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.coarse_simulator.recording import Recording
    from enhsim_tf.enhanced_simulator.runs.model import RunModel
    from enhsim_tf.enhanced_simulator.scoring import ScoreOptions
    from enhsim_tf.telemetry.cleaning.clean import Cleaning

_OTHERS = "windows continuous start scenario at number gap timeeval nominal_share workers engine scenarios".split()


def refuse_without_coarse(options: argparse.Namespace, *names: str) -> None:
    """Refuses options that have a meaning only with `--coarse`.

    Args:
        options: Parsed options, without `--coarse`.
        *names: Names of the options.

    Raises:
        InputError: If one of them is given.
    """
    for name in names:
        if getattr(options, name) not in (None, []):
            word = name.replace("_", "-")
            raise InputError(
                f"Expected --{word} only together with --coarse. Received: --{word} without it. Leave it out, or give --coarse."
            )


def generate_copies(options: argparse.Namespace) -> int:
    """Generates copies of a recorded run with the model of each channel and returns the exit code.

    Args:
        options: Parsed options of `generate`.
    """
    for name in _OTHERS:
        if getattr(options, name) not in (None, [], False):
            word = name.replace("_", "-")
            raise InputError(
                f"Expected --{word} without --coarse, or --coarse without it. Received: both. The run gives length, times and labels."
            )
    copies = 1 if options.copies is None else options.copies
    if copies < 1:
        raise InputError(f"Expected at least one copy. Received: --copies {copies}.")
    from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
    from enhsim_tf.enhanced_simulator.model_folder import chosen_of, models_of

    models = chosen_of(models_of(options.models), options.channel)
    paths = output_paths(options.out, models, (".parquet",))
    refuse_same_file(paths.values(), options.coarse)
    cleaning = cleaning_options(options, 2)

    def write(channel: str) -> None:
        model = load_run_model(models[channel])
        run = _run_of(options.coarse, model, options, cleaning)
        num_rows = write_copies(paths[channel], model, run, copies, options.seed or 0)
        name = printable(channel)
        for line in (*run.notes, *coverage_lines(model, run)):
            tell(f"{name}: {line}")
        if model.delay_s:
            tell(f"{name}: times are those of the telemetry, {model.delay_s:g} s after those of the run")
        samples = counted(num_rows // copies, "sample")
        noun = "copy" if copies == 1 else "copies"
        tell(f"{name}: {copies:,} {noun} of {samples}, one every {model.interval_s:g} s, in {paths[channel]}")

    return for_each(models, write)


def score_runs(
    options: argparse.Namespace,
    series: Mapping[str, "pd.Series"],
    models: Mapping[str, Path],
    paths: Mapping[str, Path],
    chosen: "ScoreOptions",
    cleaning: "Cleaning",
) -> int:
    """Scores each channel by its difference from the enhanced run of the same time, and returns the exit code.

    Args:
        options: Parsed options of `score`.
        series: Raw channels by name.
        models: Folder of each channel's model.
        paths: Output file of each channel.
        chosen: Settings of the scoring.
        cleaning: Settings of the cleaning.
    """
    from enhsim_tf.enhanced_simulator.runs.scoring import score_run
    from enhsim_tf.enhanced_simulator.scoring import write_scores
    from enhsim_tf.telemetry.cleaning.clean import clean

    coarse = options.coarse or options.source  # a model of commands reads them from the telemetry itself
    refuse_same_file(paths.values(), coarse)
    of_run = cleaning.of_run()

    def write(channel: str) -> None:
        cleaned = clean(series[channel], cleaning)
        model = load_run_model(models[channel])
        run = _run_of(coarse, model, options, of_run)
        frame = score_run(model, cleaned.parts, run, chosen)
        write_scores(paths[channel], frame)
        name = printable(channel)
        tell("\n".join([*cleaned.report.lines(), *(f"{name}: {note}" for note in run.notes)]))
        left, num_flags = int(frame["score"].isna().sum()), int(frame["flag"].sum())
        scored, outside = len(frame) - left, float((frame["out_of_range"] > 1).sum())
        tell(
            f"{name}: {num_flags:,} of {counted(scored, 'scored sample')} ({num_flags / scored:.1%}) flagged by {chosen.detector} on the difference "
            f"from the enhanced run, set to flag {frame.attrs['expected_false_alarm_rate']:.1%} of generated noise"
            + (
                f"; {counted(left, 'sample')} not scored, without a coarse run of the same time or in stretches shorter than a window"
                if left
                else ""
            )
            + (f"; {outside / scored:.1%} of them outside the training range" if outside else "")
            + f"; in {paths[channel]}"
        )
        tell(f"{name}: {events_line(frame, paths[channel])}")

    return for_each(series, write)


def _run_of(source: str, model: "RunModel", options: argparse.Namespace, cleaning: "Cleaning") -> "Recording":
    """Reads the coarse run that a model needs: the commands of the file for a model of commands, otherwise a recorded run."""
    from enhsim_tf.coarse_simulator.recording_files import read_recording
    from enhsim_tf.enhanced_simulator.runs.commands import is_of_commands, recording_of

    if is_of_commands(model):
        return recording_of(model, source)
    return read_recording(source, model.columns, options.coarse_time, cleaning, model.interval_s, options.coarse_start)


def load_run_model(folder: Path):  # noqa: ANN201  its type imports TensorFlow
    """Loads the run model saved in a folder; TensorFlow is imported only here."""
    from enhsim_tf.enhanced_simulator.saving import RUNS_FORMAT, check_saved

    check_saved(folder, RUNS_FORMAT)  # before TensorFlow is imported
    from enhsim_tf.enhanced_simulator.runs.model import RunModel

    return RunModel.load(folder)
