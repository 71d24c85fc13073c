"""`enhsim-tf fit`: fits a simulator to the channels of telemetry."""

import argparse
import functools
import json

from enhsim_tf.cli.options import cleaning_options, refuse_without, tell_failed
from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.common.console import tell
from enhsim_tf.common.parallel.engines import parse_workers
from enhsim_tf.simulator.fit_many import fit_channels
from enhsim_tf.simulator.options import FitOptions, options_from
from enhsim_tf.telemetry.arrays import read_commands
from enhsim_tf.telemetry.sources import read_source


def run_fit(options: argparse.Namespace) -> int:
    """Fits one simulator to all channels of the source, or one to each, and returns the exit code."""
    chosen = options_from(options, FitOptions)
    if options.coarse is None:
        refuse_without(options, "coarse", "coarse_time", "coarse_start", "coarse_column", "delay_s")
    workers = parse_workers(options.workers, options.engine)
    cleaning = cleaning_options(options, options.window or 32, "missing")
    speaks = not options.json
    say = tell if speaks else lambda line: None
    say("reading ...")
    read_run = None
    if options.coarse is not None:
        given = options.coarse, options.coarse_column, options.coarse_time, cleaning.of_run(min_part=2)
        read_run = functools.partial(read_recording, *given, start=options.coarse_start)
    series = read_source(options.source, options.column, options.time, cleaning)
    commands = None if read_run is not None else read_commands(options.source, options.column)
    reports, failed = fit_channels(
        series, options.out, chosen, cleaning, say, options.separately, workers, options.engine, speaks, read_run, commands
    )
    if options.json:
        tell(json.dumps(reports))
    return tell_failed(failed)
