"""`enhsim-tf generate --coarse`: copies of a recorded run of the user's own simulator."""

import argparse

from enhsim_tf.cli.options import cleaning_options, counted, for_each, load, output_paths, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable

_OTHERS = "windows continuous start scenario at number gap timeeval nominal_share workers engine scenarios".split()


def generate_copies(options: argparse.Namespace) -> int:
    """Generates copies of a recorded run with each model and returns the exit code.

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
    from enhsim_tf.coarse_simulator.recording_files import read_recording
    from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
    from enhsim_tf.simulator.model_folder import chosen_of, models_of

    models = chosen_of(models_of(options.models), options.channel)
    paths = output_paths(options.out, models, (".parquet",))
    refuse_same_file(paths.values(), options.coarse)
    cleaning = cleaning_options(options, 2)

    def write(name: str) -> None:
        model = load(models[name])
        runs = model.recorded_runs()
        run = read_recording(options.coarse, runs.columns, options.coarse_time, cleaning, model.interval_s, options.coarse_start)
        num_rows = write_copies(paths[name], model, run, copies, options.seed or 0)
        said = printable(name)
        for line in (*run.notes, *coverage_lines(model, run)):
            tell(f"{said}: {line}")
        if runs.delay_s:
            tell(f"{said}: times are those of the telemetry, {runs.delay_s:g} s after those of the run")
        samples = counted(num_rows // copies, "sample")
        noun = "copy" if copies == 1 else "copies"
        tell(f"{said}: {copies:,} {noun} of {samples}, one every {model.interval_s:g} s, in {paths[name]}")

    return for_each(models, write)
