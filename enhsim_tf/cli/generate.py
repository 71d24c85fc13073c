"""`enhsim-tf generate`: generates labelled training data with fitted simulators."""

import argparse
from pathlib import Path

import numpy as np

from enhsim_tf.cli.shared import for_each, output_paths, read_run, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import counted, printable
from enhsim_tf.datasets.generate import generate_data_set
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
from enhsim_tf.datasets.labelled_series import draw_schedule, series_index, series_labelled
from enhsim_tf.datasets.labelled_windows import make_plan, write_windows
from enhsim_tf.datasets.places import length_limits, parse_num_samples
from enhsim_tf.scoring.trusted_range import TrustedRange
from enhsim_tf.simulator.model_folder import chosen_of, folder_of, models_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.placing import PlacedEvent


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data with the simulator of each channel and returns the exit
    code.
    """
    is_series = options.continuous is not None
    models = chosen_of(models_of(options.models), options.channel)
    if options.is_large:
        paths = {
            name: options.out if len(models) == 1 else folder_of(options.out, name)
            for name in models
        }
    else:
        suffixes = (
            (".csv",) if options.timeeval else (".parquet", ".csv") if is_series else (".parquet",)
        )
        paths = output_paths(options.out, models, suffixes)
    refuse_same_file(paths.values(), options.coarse or ())

    def generate(name: str) -> None:
        simulator = EnhancedSimulator.load(models[name])
        if options.coarse is not None:
            what = _write_copies(options, name, simulator, paths[name])
        elif is_series:
            what = _write_series(options, simulator, paths[name])
        else:
            plan = make_plan(
                simulator,
                models[name],
                options.scenario,
                options.nominal_share,
                options.windows,
                options.seed,
            )
            what = f"{counted(plan.num_windows, 'window')} of {plan.window} samples"
            if options.is_large:
                what += f" in {counted(plan.num_shards, 'shard')}"
                generate_data_set(
                    paths[name], plan, options.workers, options.engine or "local", tell
                )
            else:
                write_windows(paths[name], plan, simulator)
        tell(f"{printable(name)}: {what} in {paths[name]}")
        trusted = TrustedRange(simulator) if options.scenario else None
        rng = np.random.default_rng(options.seed)
        for scenario in options.scenario:
            share = trusted.share_outside(*(scenario.draw(rng) for _ in range(200)))
            tell(
                f"{printable(name)}: {scenario}: {share:.0%} of such windows are outside its "
                "enhancer's training range"
            )

    return for_each(models, generate)


def _write_series(options: argparse.Namespace, simulator: EnhancedSimulator, path: Path) -> str:
    """Writes a labelled series and returns what is said of it."""
    interval_s = simulator.interval_s
    rng = np.random.default_rng([options.seed, 3])
    scenario = None
    schedule = []
    length = parse_num_samples(options.continuous, interval_s)
    if options.at or options.number:
        index = series_index(length, interval_s, options.start)
        lengths = length_limits(options.length, interval_s)
        given = [
            PlacedEvent(place.kind, place.severity, *place.samples(index, interval_s))
            for place in options.at
        ]
        schedule = draw_schedule(
            simulator, length, given, options.scenario, options.number or 0, lengths, rng
        )
    elif options.scenario:
        scenario = options.scenario[0].draw(rng)
    frame = series_labelled(simulator, length, scenario, options.seed, options.start, schedule)
    write_table(path, frame, simulator.channels if options.timeeval else ())
    what = f"{counted(length, 'sample')}, one every {interval_s:g} s"
    what += f", with {counted(len(schedule), 'event')}" if schedule else ""
    what += f", {int(frame['mask'].sum()):,} of them changed" if schedule or scenario else ""
    return what


def _write_copies(
    options: argparse.Namespace, name: str, model: EnhancedSimulator, path: Path
) -> str:
    """Writes copies of a recorded run of the user's own simulator and returns what is said of
    them.
    """
    copies = 1 if options.copies is None else options.copies
    run = read_run(options, model.alignment.columns, options.cleaning, model.interval_s)
    num_rows = write_copies(path, model, run, copies, options.seed)
    lines = [*run.notes, *coverage_lines(model, run)]
    delay_s = model.alignment.delay_s
    if delay_s:
        lines.append(f"times are those of the telemetry, {delay_s:g} s after those of the run")
    for line in lines:
        tell(f"{printable(name)}: {line}")
    samples = counted(num_rows // copies, "sample")
    return f"{counted(copies, 'copy')} of {samples}, one every {model.interval_s:g} s,"
