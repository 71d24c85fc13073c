"""`enhsim-tf generate`: generates labelled training data with fitted simulators."""

import argparse
from typing import TYPE_CHECKING

from enhsim_tf.cli.options import counted, for_each, load, output_paths, refuse_without_coarse
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable

if TYPE_CHECKING:
    from enhsim_tf.coarse_simulator.degraded import Degraded, ScheduledMode
    from enhsim_tf.datasets.places import Place
    from enhsim_tf.simulator.simulator import EnhancedSimulator


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data with the simulator of each channel and returns the exit code.

    Args:
        options: Parsed options of `generate`.
    """
    if options.coarse is not None:
        from enhsim_tf.cli.copies import generate_copies

        return generate_copies(options)
    refuse_without_coarse(options, "coarse_time", "coarse_start", "copies", "timezone", "time_format", "missing_values")
    if options.nominal_share is not None and not options.scenarios and (options.continuous is not None or not options.scenario):
        raise InputError(
            "Expected --nominal-share only together with --windows and --scenario. Received: --nominal-share without them. Leave it out."
        )
    if options.start is not None and options.continuous is None:
        raise InputError(
            f"Expected --start only together with --continuous. Received: --start {options.start} with --windows. Leave it out."
        )
    placing = [name for name in ("at", "number", "gap", "timeeval") if getattr(options, name)]
    if placing and options.continuous is None:
        raise InputError(f"Expected --{placing[0]} only together with --continuous. Received: --{placing[0]} without it. Leave it out.")
    if options.workers or options.engine or options.scenarios:
        from enhsim_tf.cli.generate_many import run_generate_many

        return run_generate_many(options, tell)
    options.seed = options.seed or 0
    from enhsim_tf.coarse_simulator.degraded import Degraded
    from enhsim_tf.datasets.labelled_windows import (
        divide_windows,
        parse_length,
        parse_num_samples,
        parse_scenario,
        parse_start,
        write_series_labelled,
        write_windows_labelled,
    )
    from enhsim_tf.datasets.mix import make_mix
    from enhsim_tf.datasets.places import parse_place, split_limits

    scenarios = [parse_scenario(text) for text in options.scenario]
    if options.windows is None and options.continuous is None:
        raise InputError("Expected --windows or --continuous. Received: neither.")
    if options.windows is not None and options.windows < 1:
        raise InputError(f"Expected at least one window. Received: --windows {options.windows}.")
    is_scheduled = bool(options.at) or options.number is not None
    if options.continuous is not None and len(scenarios) > 1 and options.number is None:
        raise InputError(
            f"Expected at most one --scenario with --continuous, unless --number gives events at drawn places. Received: {len(scenarios)}."
        )
    if options.number is not None and not (1 <= options.number <= 10_000 and scenarios):
        raise InputError(f"Expected --number from 1 to 10,000, with --scenario. Received: --number {options.number}.")
    if options.at and scenarios and options.number is None:
        raise InputError(
            "Expected --number with --at and --scenario. Received: none. Leave out --scenario, or say how many events to draw."
        )
    places = [parse_place(text) for text in options.at]
    for place in places:
        Degraded(place.kind, 1.0 if place.severity is None else place.severity)
    split_limits("length", options.length)
    nominal_share = 0.5 if options.nominal_share is None else options.nominal_share
    shares = divide_windows(make_mix(scenarios, nominal_share), options.windows, options.seed) if options.windows else []
    start = None if options.start is None else parse_start(options.start)
    if options.continuous is not None:
        parse_length(options.continuous)
    from enhsim_tf.simulator.model_folder import chosen_of, models_of

    models = chosen_of(models_of(options.models), options.channel)
    suffixes = (".csv",) if options.timeeval else (".parquet",) if options.continuous is None else (".parquet", ".csv")
    paths = output_paths(options.out, models, suffixes)

    def write(channel: str) -> None:
        simulator = load(models[channel])
        if options.continuous is None:
            unchanged = write_windows_labelled(paths[channel], simulator, shares)
            what = f"{counted(options.windows, 'window')} of {simulator.window} samples"
        else:
            length = parse_num_samples(options.continuous, simulator.interval_s)
            scenario = scenarios[0] if scenarios and not is_scheduled else None
            schedule, unchanged = _schedule_of(options, simulator, length, places, scenarios) if is_scheduled else [], {}
            num_changed = write_series_labelled(
                paths[channel], simulator, length, scenario, options.seed, start, schedule, options.timeeval
            )
            what = f"{counted(length, 'sample')}, one every {simulator.interval_s:g} s"
            what += f", with {counted(len(schedule), 'event')}" if schedule else ""
            what += f", {num_changed:,} of them changed" if schedule or scenario else ""
        tell(f"{printable(channel)}: {what} in {paths[channel]}")
        for scenario, number in unchanged.items():
            if number:
                tell(
                    f"{printable(channel)}: {scenario.mode} at {scenario.severity:g} changes nothing in {counted(number, 'window')}, "
                    "which are labelled nominal"
                )
        if not scenarios:
            return
        from enhsim_tf.simulator.trusted_range import TrustedRange

        trusted = TrustedRange(simulator)
        for scenario in scenarios:
            share = trusted.share_outside(scenario)
            tell(
                f"{printable(channel)}: {scenario.mode} at {scenario.severity:g}: {share:.0%} of such windows are outside its enhancer's training range"
            )

    return for_each(models, write)


def _schedule_of(
    options: argparse.Namespace, simulator: "EnhancedSimulator", length: int, places: "list[Place]", modes: "list[Degraded]"
) -> "list[ScheduledMode]":
    """Returns the events of a series at the places that are given, and at drawn ones."""
    import numpy as np
    import pandas as pd

    from enhsim_tf.coarse_simulator.degraded import ScheduledMode
    from enhsim_tf.datasets.labelled_windows import parse_start
    from enhsim_tf.datasets.places import length_limits, split_limits
    from enhsim_tf.datasets.schedule import draw_schedule

    index = pd.RangeIndex(length)
    if options.start is not None:
        since = np.round(simulator.interval_s * 1e9 * np.arange(length)).astype(np.int64)
        index = pd.DatetimeIndex(parse_start(options.start) + pd.to_timedelta(since, unit="ns"))
    given = [
        ScheduledMode(place.kind, 1.0 if place.severity is None else place.severity, *place.samples(index, simulator.interval_s))
        for place in places
    ]
    lengths = length_limits(split_limits("length", options.length), simulator.interval_s)
    rng = np.random.default_rng([options.seed, 3])
    return draw_schedule(simulator, length, given, modes, options.number or 0, lengths, options.gap, rng)
