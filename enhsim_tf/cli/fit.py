"""`enhsim-tf fit`: fits a simulator to the channels of telemetry."""

import argparse
import functools
import json

from enhsim_tf.cli.options import tell_failed
from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.common.console import tell
from enhsim_tf.simulator.fit_many import fit_channels
from enhsim_tf.telemetry.sources import read_source


def run_fit(options: argparse.Namespace) -> int:
    """Fits one simulator to all channels of the source, or one to each, and returns the exit code."""
    cleaning, speaks = options.cleaning, not options.json
    say = tell if speaks else lambda line: None
    say("reading ...")
    read_run = None
    if options.coarse is not None:
        given = options.coarse, options.coarse_column, options.coarse_time, cleaning.of_run(min_part=2)
        read_run = functools.partial(read_recording, *given, start=options.coarse_start)
    series = read_source(options.source, options.column, options.time, cleaning)
    commands = None if read_run is not None else series.commands
    where = options.separately, options.workers, options.engine
    reports, failed = fit_channels(series, options.out, options.chosen, cleaning, say, *where, speaks, read_run, commands)
    if options.json:
        tell(json.dumps(reports))
    return tell_failed(failed)
