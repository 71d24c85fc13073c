"""`python -m enhsim_tf fit`: fits a simulator to each channel of telemetry."""

import argparse
import sys

from enhsim_tf.cli.options import cleaning_options, tell_failed
from enhsim_tf.common.console import tell


def run_fit(options: argparse.Namespace) -> int:
    """Fits a simulator to each channel of the source and returns the exit code.

    Args:
        options: Parsed options of `fit`.
    """
    from enhsim_tf.enhanced_simulator.fit_options import FitOptions

    counts = (options.num_windows, options.epochs, options.iterations)
    chosen = FitOptions(options.window, *counts, options.noise, options.held_out, options.seed)
    from enhsim_tf.common.parallel.engines import parse_workers

    workers = parse_workers(options.workers)
    from enhsim_tf.enhanced_simulator.fit_many import fit_channels  # imported here, because pandas is slow to import
    from enhsim_tf.telemetry.sources import read_source

    cleaning = cleaning_options(options, options.window or 64)
    series = read_source(options.source, options.column, options.time, cleaning)
    is_terminal = sys.stdout.isatty()
    failed = fit_channels(series, options.out, chosen, cleaning, workers, tell, is_terminal, options.engine, speaks=not is_terminal)
    return tell_failed(failed)
