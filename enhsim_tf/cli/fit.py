"""`python -m enhsim_tf fit`: fits a simulator to each channel of telemetry."""

import argparse
import sys

from enhsim_tf.cli.options import cleaning_options, tell_failed
from enhsim_tf.cli.runs import refuse_without_coarse
from enhsim_tf.common.console import tell


def run_fit(options: argparse.Namespace) -> int:
    """Fits a simulator to each channel of the source and returns the exit code.

    Args:
        options: Parsed options of `fit`.
    """
    from enhsim_tf.enhanced_simulator.fit_options import FitOptions

    noise = options.noise.replace("-", " ")
    counts = (options.num_windows, options.epochs)
    enhancer = None if options.enhancer is None else options.enhancer.replace("-", " ")
    if options.coarse is None:
        refuse_without_coarse(options, "coarse_time", "coarse_start", "coarse_column", "delay")
        chosen, run = FitOptions(options.window, *counts, noise, options.held_out, options.seed, enhancer or "best"), None
    else:
        from enhsim_tf.enhanced_simulator.fit_many import CoarseRun
        from enhsim_tf.enhanced_simulator.runs.options import RunOptions

        chosen = RunOptions(options.window, *counts, noise, enhancer, options.delay, options.held_out, options.seed)
        run = CoarseRun(options.coarse, options.coarse_column, options.coarse_time, options.coarse_start)
    from enhsim_tf.common.parallel.engines import parse_workers

    workers = parse_workers(options.workers)
    from enhsim_tf.enhanced_simulator.fit_many import fit_channels  # imported here, because pandas is slow to import
    from enhsim_tf.telemetry.commands import read_commands
    from enhsim_tf.telemetry.sources import read_source

    cleaning = cleaning_options(options, options.window or 32, "missing")
    series = read_source(options.source, options.column, options.time, cleaning)
    is_terminal = sys.stdout.isatty()
    commands = None if run is not None else read_commands(options.source, options.column)
    failed = fit_channels(series, options.out, chosen, cleaning, workers, tell, is_terminal, options.engine, not is_terminal, run, commands)
    return tell_failed(failed)
