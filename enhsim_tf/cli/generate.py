"""`python -m enhsim_tf generate`: generates labelled training data with fitted simulators."""

import argparse

from enhsim_tf.cli.options import counted, for_each, load, output_paths
from enhsim_tf.cli.runs import refuse_without_coarse
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data with the simulator of each channel and returns the exit code.

    Args:
        options: Parsed options of `generate`.
    """
    if options.coarse is not None:
        from enhsim_tf.cli.runs import generate_copies

        return generate_copies(options)
    refuse_without_coarse(options, "coarse_time", "copies", "timezone")
    if options.nominal_share is not None and not options.scenarios and (options.continuous is not None or not options.scenario):
        raise InputError(
            "Expected --nominal-share only together with --windows and --scenario. Received: --nominal-share without them. Leave it out."
        )
    if options.start is not None and options.continuous is None:
        raise InputError(
            f"Expected --start only together with --continuous. Received: --start {options.start} with --windows. Leave it out."
        )
    if options.workers or options.engine or options.scenarios:
        from enhsim_tf.cli.generate_many import run_generate_many

        return run_generate_many(options, tell)
    options.seed = options.seed or 0
    from enhsim_tf.datasets.labelled_windows import (
        divide_windows,
        parse_length,
        parse_num_samples,
        parse_scenario,
        parse_start,
        write_series_labelled,
        write_windows_labelled,
    )
    from enhsim_tf.datasets.scenario_file import make_mix

    scenarios = [parse_scenario(text) for text in options.scenario]
    if options.windows is None and options.continuous is None:
        raise InputError("Expected --windows or --continuous. Received: neither.")
    if options.windows is not None and options.windows < 1:
        raise InputError(f"Expected at least one window. Received: --windows {options.windows}.")
    if options.continuous is not None and len(scenarios) > 1:
        raise InputError(f"Expected at most one --scenario with --continuous. Received: {len(scenarios)}. Write one series for each.")
    nominal_share = 0.5 if options.nominal_share is None else options.nominal_share
    shares = divide_windows(make_mix(scenarios, nominal_share), options.windows, options.seed) if options.windows else []
    start = None if options.start is None else parse_start(options.start)
    if options.continuous is not None:
        parse_length(options.continuous)
    from enhsim_tf.enhanced_simulator.model_folder import chosen_of, models_of

    models = chosen_of(models_of(options.models), options.channel)
    paths = output_paths(options.out, models, (".parquet",))

    def write(channel: str) -> None:
        simulator = load(models[channel])
        if options.continuous is None:
            write_windows_labelled(paths[channel], simulator, shares)
            what = f"{counted(options.windows, 'window')} of {simulator.window} samples"
        else:
            length = parse_num_samples(options.continuous, simulator.interval_s)
            scenario = scenarios[0] if scenarios else None
            write_series_labelled(paths[channel], simulator, length, scenario, options.seed, start)
            what = f"{counted(length, 'sample')}, one every {simulator.interval_s:g} s"
        tell(f"{printable(channel)}: {what} in {paths[channel]}")
        if not scenarios:
            return
        from enhsim_tf.enhanced_simulator.trusted_range import TrustedRange

        trusted = TrustedRange(simulator)
        for scenario in scenarios:
            share = trusted.share_outside(scenario)
            tell(
                f"{printable(channel)}: {scenario.mode} at {scenario.severity:g}: {share:.0%} of such windows are outside its enhancer's training range"
            )

    return for_each(models, write)
