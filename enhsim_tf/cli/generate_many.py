"""`python -m enhsim_tf generate` with `--workers`, `--engine` or `--scenarios`: what the options mean for a large data set."""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel.engines import workers_of
from enhsim_tf.datasets.generate import generate_fleet
from enhsim_tf.datasets.labelled_windows import parse_scenario
from enhsim_tf.datasets.plan import Plan, plan_of
from enhsim_tf.datasets.scenario_file import Mix, ModelShare, mix_of, read_mix
from enhsim_tf.enhanced_simulator.model_folder import chosen_of, folder_of, models_of


def run_fleet(options: argparse.Namespace, tell: Callable[[str], None]) -> int:
    """Makes the data sets that the options ask for, one a channel or one of a family of models; returns the exit code.

    Args:
        options: Those of `generate`.
        tell: Called with each line.
    """
    workers = workers_of(options.workers)
    plans = plans_of(options)  # all of them are checked before the first is made
    for out, plan in plans.items():
        generate_fleet(out, plan, workers, options.engine or "local", tell)
    return 0


def plans_of(options: argparse.Namespace) -> dict[Path, Plan]:
    """The data sets by their folders."""
    if options.continuous is not None:
        raise InputError("Expected --windows with --workers, --engine or --scenarios. Received: --continuous.")
    if options.scenarios is None:
        mix = mix_of([parse_scenario(text) for text in options.scenario], 0.5 if options.nominal_share is None else options.nominal_share)
    elif options.scenario or options.nominal_share is not None:
        raise InputError("Expected scenarios in one place. Received: --scenarios with --scenario or --nominal-share. Put all in the file.")
    else:
        mix = read_mix(options.scenarios)
    num_windows = _one("windows", mix.num_windows, options.windows)
    seed = _one("seed", mix.seed, options.seed, 0)
    if mix.models:
        if options.channel:
            raise InputError("Expected models in one place. Received: --channel, and a scenario file that names models.")
        return {options.out: plan_of(mix, options.models, seed, num_windows)}
    models = chosen_of(models_of(options.models), options.channel)
    plans = {}
    for name, folder in models.items():
        out = options.out if len(models) == 1 else folder_of(options.out, name)
        plans[out] = plan_of(_named(mix, name), folder, seed, num_windows)
    return plans


def _one(what: str, in_file: int | None, given: int | None, default: int | None = None) -> int:
    """A number that the file or the command line gives; not two numbers."""
    if in_file is not None and given is not None and in_file != given:
        raise InputError(f"Expected {what} in one place. Received: {in_file:,} in the scenario file and --{what} {given:,}.")
    found = given if in_file is None else in_file
    if found is None and default is None:
        raise InputError(f"Expected how many {what}. Received: neither --{what} nor {what} in a scenario file.")
    return default if found is None else found


def _named(mix: Mix, name: str) -> Mix:
    return dataclasses.replace(mix, models=(ModelShare(name, ".", 1.0),))
