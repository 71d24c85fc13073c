"""`enhsim-tf update`: goes on from fitted simulators with newer nominal telemetry."""

import argparse
import json
import os
from pathlib import Path

from enhsim_tf.cli.shared import channels_by_model, for_each, on_one_clock, read_channels, run_for
from enhsim_tf.common.atomic_files import replace_folder, write_json
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting.update import update
from enhsim_tf.simulator.model_folder import MANIFEST, folder_of, models_of, refuse_foreign
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.report import lines_of


def run_update(options: argparse.Namespace) -> int:
    """Updates the simulators of the channels of the source and returns the exit code."""
    models = models_of(options.models)
    out = Path(os.path.abspath(options.out or f"{os.path.abspath(options.models)}-updated"))
    series = read_channels(options)
    channels = channels_by_model(series, models)
    folders = {model: folder_of(out, model) for model in channels}
    for model, folder in folders.items():
        refuse_foreign(folder)
        if (folder / MANIFEST).is_file() and not options.replace:
            raise InputError(
                f"Expected --out without a model of {model}, because update keeps the old one. "
                f"Received: {folder}. "
                "Give another --out, or --replace."
            )
    results = {}

    def write(model: str) -> None:
        telemetry, reports = on_one_clock(channels[model], options.cleaning)
        simulator = EnhancedSimulator.load(models[model])
        run = run_for(simulator, series, options)
        updated, report = update(simulator, telemetry, run, options.held_out, options.seed)
        kept = {
            "update": report.to_dict(),
            "cleaning": {name: cleaning.to_dict() for name, cleaning in reports.items()},
        }
        with replace_folder(folders[model]) as temporary:
            updated.save(temporary)
            write_json(temporary / "report.json", kept)
        results[model] = kept
        if not options.json:
            lines = [*lines_of(list(reports.values())), *report.lines()]
            tell("\n".join([*lines, f"updated simulator and report.json in {folders[model]}/"]))

    code = for_each(channels, write)
    if options.json:
        tell(json.dumps(results))
    return code
