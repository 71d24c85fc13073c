"""`python -m enhsim_tf update`: goes on from fitted simulators with newer nominal telemetry."""

import argparse
import os
from pathlib import Path

from enhsim_tf.cli.options import cleaning_options, for_each, load, model_names
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable


def run_update(options: argparse.Namespace) -> int:
    """Updates the simulator of each channel of the source and returns the exit code.

    Args:
        options: Parsed options of `update`.
    """
    from enhsim_tf.common.atomic_files import make_folder, replace_folder, write_json
    from enhsim_tf.enhanced_simulator.model_folder import folder_of, models_of, refuse_foreign
    from enhsim_tf.enhanced_simulator.update_options import UpdateOptions

    chosen = UpdateOptions(options.epochs, options.num_windows, options.held_out, options.seed)
    models = models_of(options.models)
    out = Path(os.path.abspath(options.out or f"{os.path.abspath(options.models)}-updated"))
    cleaning = cleaning_options(options, 2, "missing")
    from enhsim_tf.telemetry.cleaning.clean import clean
    from enhsim_tf.telemetry.sources import read_source

    series = read_source(options.source, options.column, options.time, cleaning)
    names = model_names(series, models)
    series = {name: series[name] for name in names}
    folders = {name: folder_of(out, names[name]) for name in series}
    for name, folder in folders.items():
        refuse_foreign(folder)
        is_there = folder.is_dir() and any(folder.iterdir())
        if is_there and not options.replace:
            raise InputError(
                f"Expected --out without a model of {printable(names[name])}, because update keeps the old one. Received: {folder}. "
                "Give another --out, or --replace."
            )
    from enhsim_tf.enhanced_simulator.updating import update_simulator

    def write(channel: str) -> None:
        cleaned = clean(series[channel], cleaning)
        updated, report = update_simulator(load(models[names[channel]]), cleaned.parts, chosen)
        make_folder(out)
        with replace_folder(folders[channel]) as temporary:
            updated.save(temporary)
            write_json(temporary / "report.json", {"update": report.to_dict(), "cleaning": cleaned.report.to_dict()})
        tell("\n".join([*cleaned.report.lines(), *report.lines(), f"updated simulator and report.json in {folders[channel]}/"]))

    return for_each(series, write)
