"""`enhsim-tf generate`: generates labelled training data with fitted simulators."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from enhsim_tf.cli.options import cleaning_options, counted, for_each, output_paths, refuse_same_file, refuse_without
from enhsim_tf.coarse_simulator.degraded import Degraded, ScheduledMode
from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.common.parallel.engines import parse_workers
from enhsim_tf.datasets.generate import generate_data_set
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
from enhsim_tf.datasets.labelled_windows import divide_windows, draw_schedule, series_index, series_labelled, write_windows_labelled
from enhsim_tf.datasets.mix import make_mix, read_mix
from enhsim_tf.datasets.places import length_limits, parse_length, parse_num_samples, parse_place, parse_scenario, parse_start, split_limits
from enhsim_tf.datasets.plan import Plan, make_plan
from enhsim_tf.simulator.model_folder import chosen_of, folder_of, models_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.trusted_range import TrustedRange

_NOT_OF_RUNS = "windows continuous start scenario at number gap timeeval nominal_share workers engine scenarios".split()


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data with the simulator of each channel and returns the exit code."""
    if options.coarse is not None:
        return _generate_copies(options)
    refuse_without(options, "coarse", "coarse_time", "coarse_start", "copies", "timezone", "time_format", "missing_values")
    if options.continuous is None:
        refuse_without(options, "continuous", "start", "at", "number", "gap", "timeeval")
    if options.nominal_share is not None:
        if not options.scenarios and (options.continuous is not None or not options.scenario):
            raise InputError(
                "Expected --nominal-share only together with --windows and --scenario. Received: --nominal-share without them. Leave it out."
            )
        if not 0 <= options.nominal_share <= 1:
            raise InputError(f"Expected a nominal share from 0 to 1. Received: {options.nominal_share}.")
    if options.workers or options.engine or options.scenarios:
        return _generate_many(options)
    if options.windows is None and options.continuous is None:
        raise InputError("Expected --windows or --continuous. Received: neither.")
    scenarios, is_series = [parse_scenario(text) for text in options.scenario], options.continuous is not None
    write = (_series_writer if is_series else _windows_writer)(options, scenarios, options.seed or 0)
    models = chosen_of(models_of(options.models), options.channel)
    paths = output_paths(options.out, models, (".csv",) if options.timeeval else (".parquet", ".csv") if is_series else (".parquet",))

    def generate(channel: str) -> None:
        simulator = EnhancedSimulator.load(models[channel])
        for line in write(simulator, paths[channel]):
            tell(f"{printable(channel)}: {line}")
        trusted = TrustedRange(simulator) if scenarios else None
        for scenario in scenarios:
            share = f"{trusted.share_outside(scenario):.0%} of such windows are outside its enhancer's training range"
            tell(f"{printable(channel)}: {scenario.mode} at {scenario.severity:g}: {share}")

    return for_each(models, generate)


Writer = Callable[[EnhancedSimulator, Path], list[str]]  # writes a file with a simulator and returns what is said of it


def _windows_writer(options: argparse.Namespace, scenarios: Sequence[Degraded], seed: int) -> Writer:
    if options.windows < 1:
        raise InputError(f"Expected at least one window. Received: --windows {options.windows}.")
    shares = divide_windows(scenarios, _nominal_share(options), options.windows, seed)

    def write(simulator: EnhancedSimulator, path: Path) -> list[str]:
        unchanged = write_windows_labelled(path, simulator, shares)
        lines = [f"{counted(options.windows, 'window')} of {simulator.window} samples in {path}"]
        for scenario, number in unchanged.items():
            if number:
                which = f"{scenario.mode} at {scenario.severity:g}"
                lines.append(f"{which} changes nothing in {counted(number, 'window')}, which are labelled nominal")
        return lines

    return write


def _series_writer(options: argparse.Namespace, scenarios: Sequence[Degraded], seed: int) -> Writer:
    if options.number is None and (len(scenarios) > 1 or (scenarios and options.at)):
        raise InputError(
            "Expected --number, of events at drawn places, with several --scenario in a series, or with --scenario and --at. Received: none."
        )
    if options.number is not None and not (1 <= options.number <= 10_000 and scenarios):
        raise InputError(f"Expected --number from 1 to 10,000, with --scenario. Received: --number {options.number}.")
    places = [parse_place(text, 1.0) for text in options.at]
    for place in places:
        Degraded(place.kind, place.severity)  # checks both
    limits, start = split_limits("length", options.length), None if options.start is None else parse_start(options.start)
    parse_length(options.continuous)

    def write(simulator: EnhancedSimulator, path: Path) -> list[str]:
        interval_s, scenario, schedule = simulator.interval_s, scenarios[0] if scenarios else None, []
        length = parse_num_samples(options.continuous, interval_s)
        if places or options.number:
            index = series_index(length, interval_s, start)
            given = [ScheduledMode(place.kind, place.severity, *place.samples(index, interval_s)) for place in places]
            lengths, rng, scenario = length_limits(limits, interval_s), np.random.default_rng([seed, 3]), None
            schedule = draw_schedule(simulator, length, given, scenarios, options.number or 0, lengths, options.gap, rng)
        frame = series_labelled(simulator, length, scenario, seed, start, schedule)
        write_table(path, frame, simulator.channels if options.timeeval else ())
        what = f"{counted(length, 'sample')}, one every {interval_s:g} s"
        what += f", with {counted(len(schedule), 'event')}" if schedule else ""
        what += f", {int(frame['mask'].sum()):,} of them changed" if schedule or scenario else ""
        return [f"{what} in {path}"]

    return write


def _nominal_share(options: argparse.Namespace) -> float:
    return 0.5 if options.nominal_share is None else options.nominal_share


def _generate_copies(options: argparse.Namespace) -> int:
    """Generates copies of a recorded run of the user's own simulator with each model."""
    for name in _NOT_OF_RUNS:
        if getattr(options, name) not in (None, [], False):
            word = name.replace("_", "-")
            raise InputError(
                f"Expected --{word} without --coarse, or --coarse without it. Received: both. The run gives length, times and labels."
            )
    copies = 1 if options.copies is None else options.copies
    models = chosen_of(models_of(options.models), options.channel)
    paths = output_paths(options.out, models, (".parquet",))
    refuse_same_file(paths.values(), options.coarse)
    cleaning = cleaning_options(options, 2)

    def write(name: str) -> None:
        model = EnhancedSimulator.load(models[name])
        runs = model.recorded_runs()
        run = read_recording(options.coarse, runs.columns, options.coarse_time, cleaning, model.interval_s, options.coarse_start)
        num_rows = write_copies(paths[name], model, run, copies, options.seed or 0)
        lines = [*run.notes, *coverage_lines(model, run)]
        if runs.delay_s:
            lines.append(f"times are those of the telemetry, {runs.delay_s:g} s after those of the run")
        noun, samples = "copy" if copies == 1 else "copies", counted(num_rows // copies, "sample")
        for line in [*lines, f"{copies:,} {noun} of {samples}, one every {model.interval_s:g} s, in {paths[name]}"]:
            tell(f"{printable(name)}: {line}")

    return for_each(models, write)


def _generate_many(options: argparse.Namespace) -> int:
    """Generates one large data set per channel, or one from several models. All plans are checked before the first one is made."""
    workers = parse_workers(options.workers, options.engine)
    for out, plan in _plans_of(options).items():
        generate_data_set(out, plan, workers, options.engine or "local", tell)
    return 0


def _plans_of(options: argparse.Namespace) -> dict[Path, Plan]:
    """Returns the plan of each data set, by its output folder."""
    if options.continuous is not None:
        raise InputError("Expected --windows with --workers, --engine or --scenarios. Received: --continuous.")
    if options.scenarios is None:
        mix = make_mix([parse_scenario(text) for text in options.scenario], _nominal_share(options))
    elif options.scenario or options.nominal_share is not None:
        raise InputError(
            "Expected scenarios in one place. Received: --scenarios with --scenario or --nominal-share. Put them all in the file."
        )
    else:
        mix = read_mix(options.scenarios)
    num_windows = _one("windows", mix.windows, options.windows)
    seed = _one("seed", mix.seed, options.seed, 0)
    if mix.models:
        if options.channel:
            raise InputError(
                "Expected models in one place. Received: --channel, and a scenario file that names models. Leave out --channel."
            )
        return {options.out: make_plan(mix, options.models, seed, num_windows)}
    models = chosen_of(models_of(options.models), options.channel)
    outs = {name: options.out if len(models) == 1 else folder_of(options.out, name) for name in models}
    return {outs[name]: make_plan(mix, folder, seed, num_windows, name) for name, folder in models.items()}


def _one(what: str, in_file: int | None, given: int | None, default: int | None = None) -> int:
    """Returns a number that is given in the scenario file or on the command line, but not as two different numbers."""
    if in_file is not None and given is not None and in_file != given:
        raise InputError(f"Expected {what} in one place. Received: {in_file:,} in the scenario file and --{what} {given:,}.")
    found = next((each for each in (in_file, given, default) if each is not None), None)
    if found is None:
        raise InputError(f"Expected a number of {what}. Received: neither --{what} nor {what} in a scenario file. Give one of them.")
    return found
