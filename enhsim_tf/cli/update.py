"""`enhsim-tf update`: goes on from fitted simulators with newer nominal telemetry."""

import argparse
import json
import os
from pathlib import Path

from enhsim_tf.cli.options import channels_by_model, cleaned_channels, for_each, run_for
from enhsim_tf.common.atomic_files import replace_folder, write_json
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.model_folder import MANIFEST, folder_of, models_of, refuse_foreign
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.updating import update
from enhsim_tf.telemetry.cleaning.report import lines_of
from enhsim_tf.telemetry.sources import read_source


def run_update(options: argparse.Namespace) -> int:
    """Updates the simulators of the channels of the source and returns the exit code."""
    models, cleaning = models_of(options.models), options.cleaning
    out = Path(os.path.abspath(options.out or f"{os.path.abspath(options.models)}-updated"))
    series = read_source(options.source, options.column, options.time, cleaning)
    channels = channels_by_model(series, models)
    folders = {model: folder_of(out, model) for model in channels}
    for model, folder in folders.items():
        refuse_foreign(folder)
        if (folder / MANIFEST).is_file() and not options.replace:
            raise InputError(
                f"Expected --out without a model of {model}, because update keeps the old one. Received: {folder}. "
                "Give another --out, or --replace."
            )
    found = {}

    def write(model: str) -> None:
        telemetry, cleaned = cleaned_channels(series, channels[model], cleaning)
        simulator = EnhancedSimulator.load(models[model])
        run = run_for(simulator, series, options, cleaning)
        updated, report = update(simulator, telemetry, run, options.held_out, options.seed)
        kept = {
            "update": report.to_dict(),
            "cleaning": {name: each.report.to_dict() for name, each in cleaned.items()},
        }
        with replace_folder(folders[model]) as temporary:
            updated.save(temporary)
            write_json(temporary / "report.json", kept)
        found[model] = kept
        if not options.json:
            lines = lines_of([each.report for each in cleaned.values()])
            tell(
                "\n".join(
                    [
                        *lines,
                        *report.lines(),
                        f"updated simulator and report.json in {folders[model]}/",
                    ]
                )
            )

    code = for_each(channels, write)
    if options.json:
        tell(json.dumps(found))
    return code
