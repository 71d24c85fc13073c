"""`python -m enhsim_tf generate` with `--workers`, `--engine` or `--scenarios`: generates large data sets."""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel.engines import parse_workers
from enhsim_tf.datasets.generate import generate_data_set
from enhsim_tf.datasets.labelled_windows import parse_scenario
from enhsim_tf.datasets.mix import Mix, ModelShare, make_mix
from enhsim_tf.datasets.plan import Plan, make_plan
from enhsim_tf.simulator.model_folder import chosen_of, folder_of, models_of


def run_generate_many(options: argparse.Namespace, tell: Callable[[str], None]) -> int:
    """Generates one data set per channel, or one data set from several models, and returns the exit code.

    Args:
        options: Parsed options of `generate`.
        tell: Function that is called with each line of output.
    """
    workers = parse_workers(options.workers, options.engine)
    plans = make_plans(options)  # all plans are checked before the first data set is generated
    for out, plan in plans.items():
        generate_data_set(out, plan, workers, options.engine or "local", tell)
    return 0


def make_plans(options: argparse.Namespace) -> dict[Path, Plan]:
    """Returns the plan of each data set, by its output folder.

    Args:
        options: Parsed options of `generate`.

    Raises:
        InputError: If options contradict each other or the scenario file, or if a model cannot be used.
    """
    if options.continuous is not None:
        raise InputError("Expected --windows with --workers, --engine or --scenarios. Received: --continuous.")
    if options.scenarios is None:
        mix = make_mix([parse_scenario(text) for text in options.scenario], 0.5 if options.nominal_share is None else options.nominal_share)
    elif options.scenario or options.nominal_share is not None:
        raise InputError(
            "Expected scenarios in one place. Received: --scenarios with --scenario or --nominal-share. Put them all in the file."
        )
    else:
        from enhsim_tf.datasets.scenario_file import read_mix  # loads pydantic

        mix = read_mix(options.scenarios)
    num_windows = _one("windows", mix.num_windows, options.windows)
    seed = _one("seed", mix.seed, options.seed, 0)
    if mix.models:
        if options.channel:
            raise InputError(
                "Expected models in one place. Received: --channel, and a scenario file that names models. Leave out --channel."
            )
        return {options.out: make_plan(mix, options.models, seed, num_windows)}
    models = chosen_of(models_of(options.models), options.channel)
    plans = {}
    for name, folder in models.items():
        out = options.out if len(models) == 1 else folder_of(options.out, name)
        plans[out] = make_plan(_named(mix, name), folder, seed, num_windows)
    return plans


def _one(what: str, in_file: int | None, given: int | None, default: int | None = None) -> int:
    """Returns a number that is given in the scenario file or on the command line, but not as two different numbers."""
    if in_file is not None and given is not None and in_file != given:
        raise InputError(f"Expected {what} in one place. Received: {in_file:,} in the scenario file and --{what} {given:,}.")
    found = given if in_file is None else in_file
    if found is None and default is None:
        raise InputError(f"Expected a number of {what}. Received: neither --{what} nor {what} in a scenario file. Give one of them.")
    return default if found is None else found


def _named(mix: Mix, name: str) -> Mix:
    return dataclasses.replace(mix, models=(ModelShare(name, ".", 1.0),))
