"""`enhsim-tf generate`: generates labelled training data with fitted simulators."""

import argparse
from pathlib import Path

import numpy as np

from enhsim_tf.cli.options import for_each, output_paths, refuse_same_file
from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, counted, printable
from enhsim_tf.datasets.generate import generate_data_set
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
from enhsim_tf.datasets.labelled_windows import draw_schedule, series_index, series_labelled, write_windows_labelled
from enhsim_tf.datasets.mix import make_mix, read_mix
from enhsim_tf.datasets.places import length_limits, parse_num_samples
from enhsim_tf.datasets.plan import Plan, make_plan
from enhsim_tf.simulator.model_folder import chosen_of, folder_of, models_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.trusted_range import TrustedRange
from enhsim_tf.telemetry.placing import PlacedEvent


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data with the simulator of each channel and returns the exit code."""
    if options.coarse is not None:
        return _generate_copies(options)
    if options.is_large:
        for out, plan in _plans_of(options).items():  # all plans are checked before the first one is made
            generate_data_set(out, plan, options.workers, options.engine or "local", tell)
        return 0
    is_series, models = options.continuous is not None, chosen_of(models_of(options.models), options.channel)
    suffixes = (".csv",) if options.timeeval else (".parquet", ".csv") if is_series else (".parquet",)
    paths, write = output_paths(options.out, models, suffixes), _write_series if is_series else _write_windows

    def generate(name: str) -> None:
        simulator = EnhancedSimulator.load(models[name])
        for line in write(options, simulator, paths[name]):
            tell(f"{printable(name)}: {line}")
        trusted = TrustedRange(simulator) if options.scenario else None
        for scenario in options.scenario:
            share = f"{trusted.share_outside(scenario):.0%} of such windows are outside its enhancer's training range"
            tell(f"{printable(name)}: {scenario.mode} at {scenario.severity:g}: {share}")

    return for_each(models, generate)


def _write_windows(options: argparse.Namespace, simulator: EnhancedSimulator, path: Path) -> list[str]:
    """Writes labelled windows and returns what is said of them."""
    unchanged = write_windows_labelled(path, simulator, options.shares)
    lines = [f"{counted(options.windows, 'window')} of {simulator.window} samples in {path}"]
    for scenario, number in unchanged.items():
        if number:
            which = f"{scenario.mode} at {scenario.severity:g}"
            lines.append(f"{which} changes nothing in {counted(number, 'window')}, which are labelled nominal")
    return lines


def _write_series(options: argparse.Namespace, simulator: EnhancedSimulator, path: Path) -> list[str]:
    """Writes a labelled series and returns what is said of it."""
    interval_s, seed, scenario, schedule = simulator.interval_s, options.seed or 0, None, []
    length = parse_num_samples(options.continuous, interval_s)
    if options.at or options.number:
        index, lengths = series_index(length, interval_s, options.start), length_limits(options.length, interval_s)
        given = [PlacedEvent(place.kind, place.severity, *place.samples(index, interval_s)) for place in options.at]
        rng = np.random.default_rng([seed, 3])
        schedule = draw_schedule(simulator, length, given, options.scenario, options.number or 0, lengths, rng)
    elif options.scenario:
        (scenario,) = options.scenario
    frame = series_labelled(simulator, length, scenario, seed, options.start, schedule)
    write_table(path, frame, simulator.channels if options.timeeval else ())
    what = f"{counted(length, 'sample')}, one every {interval_s:g} s"
    what += f", with {counted(len(schedule), 'event')}" if schedule else ""
    what += f", {int(frame['mask'].sum()):,} of them changed" if schedule or scenario else ""
    return [f"{what} in {path}"]


def _generate_copies(options: argparse.Namespace) -> int:
    """Generates copies of a recorded run of the user's own simulator with each model."""
    copies = 1 if options.copies is None else options.copies
    models = chosen_of(models_of(options.models), options.channel)
    paths = output_paths(options.out, models, (".parquet",))
    refuse_same_file(paths.values(), options.coarse)

    def write(name: str) -> None:
        model = EnhancedSimulator.load(models[name])
        runs = model.recorded_runs()
        run = read_recording(options.coarse, runs.columns, options.coarse_time, options.cleaning, model.interval_s, options.coarse_start)
        num_rows = write_copies(paths[name], model, run, copies, options.seed or 0)
        lines = [*run.notes, *coverage_lines(model, run)]
        if runs.delay_s:
            lines.append(f"times are those of the telemetry, {runs.delay_s:g} s after those of the run")
        samples = counted(num_rows // copies, "sample")
        for line in [*lines, f"{counted(copies, 'copy')} of {samples}, one every {model.interval_s:g} s, in {paths[name]}"]:
            tell(f"{printable(name)}: {line}")

    return for_each(models, write)


def _plans_of(options: argparse.Namespace) -> dict[Path, Plan]:
    """Returns the plan of the data set of each model, by its output folder."""
    mix = make_mix(options.scenario, options.nominal_share) if options.scenarios is None else read_mix(options.scenarios)
    seed, num_windows = (given if given is not None else kept for given, kept in ((options.seed, mix.seed), (options.windows, mix.windows)))
    if num_windows is None:
        raise InputError(f"Expected a number of windows. Received: none in {options.scenarios}. Give --windows.")
    models = chosen_of(models_of(options.models), options.channel)
    outs = {name: options.out if len(models) == 1 else folder_of(options.out, name) for name in models}
    return {outs[name]: make_plan(mix, folder, seed or 0, num_windows) for name, folder in models.items()}
