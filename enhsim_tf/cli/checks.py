"""Checks of the options of each command, and of whether their files exist. They come before the
imports of the command, which are slow.
"""

import argparse
import dataclasses

from enhsim_tf.cli.fields import options_from
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.options import flag_of
from enhsim_tf.common.parallel.engines import parse_workers
from enhsim_tf.datasets.options import (
    MOST_EVENTS,
    WITHOUT_SEVERITY,
    InjectOptions,
    split_limits,
)
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.scoring.options import ScoreOptions
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.source_kinds import existing

_CHOSEN = {"score": ScoreOptions, "inject": InjectOptions}  # of others the `FitOptions`
_OF_RUNS = "coarse_time", "coarse_start", "copies", "timezone", "time_format", "missing_values"
_NOT_OF_RUNS = (
    "windows continuous start scenario at number timeeval nominal_share workers engine".split()
)


def check(options: argparse.Namespace) -> argparse.Namespace:
    """Checks the options of a command, and replaces texts by what they say, such as
    `options.scenario` by a list of `ScenarioRange`.

    Raises:
        InputError: If a value is out of range, options contradict each other, or there is no such
            source or simulator.
    """
    command = options.command
    if command != "verify":
        options.chosen = options_from(options, _CHOSEN.get(command, FitOptions))
        more = {"fit": _check_fit, "generate": _check_generate, "inject": _check_inject}
        if command in more:
            more[command](options)
        least = {"fit": getattr(options, "window", None) or 32, "inject": 3}.get(command, 2)
        labelled = "missing" if command in ("fit", "update") else "keep"
        options.cleaning = cleaning_options(options, least, labelled)
    if hasattr(options, "source") and getattr(options, "coarse", None) is not None:
        _refuse(options, "with --coarse, whose run is one part", "part_column")
    for source in (getattr(options, "source", None), getattr(options, "coarse", None)):
        if source is not None:
            existing(source)
    if hasattr(options, "models"):
        from enhsim_tf.simulator.model_folder import models_of  # imports NumPy, so it comes last

        models_of(options.models)
    return options


def _check_fit(options: argparse.Namespace) -> None:
    if options.coarse is None:
        _refuse(
            options, "without --coarse", "coarse_time", "coarse_start", "coarse_column", "delay_s"
        )
    options.workers = parse_workers(options.workers, options.engine)


def _check_inject(options: argparse.Namespace) -> None:
    if set(options.chosen.kinds) <= set(WITHOUT_SEVERITY) and not options.at:
        _refuse(
            options,
            f"with {options.kinds}: of the kinds of several channels, common_shift alone has one",
            "severity",
        )


def _check_generate(options: argparse.Namespace) -> None:
    options.is_large = bool(options.workers or options.engine)
    if options.coarse is not None:
        _refuse(
            options, "with --coarse, because the run gives length, times and labels", *_NOT_OF_RUNS
        )
        return
    _refuse(options, "without --coarse", *_OF_RUNS)
    if options.continuous is None:
        _refuse(options, "without --continuous", "start", "at", "number", "timeeval")
        if options.windows is None:
            raise InputError(
                "Expected --windows or --continuous. Received: neither. Give one of them."
            )
    else:
        _refuse(
            options,
            "with --continuous, which makes one series",
            "nominal_share",
            "workers",
            "engine",
        )
    if not options.scenario:
        _refuse(options, "without --scenario", "nominal_share")
    options.nominal_share = 0.5 if options.nominal_share is None else options.nominal_share
    if not 0 <= options.nominal_share <= 1:
        raise InputError(
            f"Expected a nominal share from 0 to 1. Received: {options.nominal_share}."
        )
    options.workers = parse_workers(options.workers, options.engine)
    from enhsim_tf.datasets.places import parse_scenario  # imports NumPy, so it comes last

    options.scenario = [parse_scenario(text) for text in options.scenario]
    if options.continuous is not None:
        _check_series(options)


def _check_series(options: argparse.Namespace) -> None:
    from enhsim_tf.coarse.degraded import Degraded
    from enhsim_tf.datasets.places import parse_length, parse_place, parse_start

    if options.number is None and (len(options.scenario) > 1 or (options.scenario and options.at)):
        raise InputError(
            "Expected --number, of events at drawn places, with several --scenario in a series, or "
            "with --scenario and --at. Received: none."
        )
    if options.number is not None and not (1 <= options.number <= MOST_EVENTS and options.scenario):
        raise InputError(
            f"Expected --number from 1 to {MOST_EVENTS:,}, with --scenario. Received: --number "
            f"{options.number}."
        )
    for scenario in options.scenario if options.number is not None else ():
        if scenario.channel is not None or scenario.onset[0] < scenario.onset[1]:
            raise InputError(
                "Expected only MODE:SEVERITY with --number, whose events have drawn places in all "
                f"channels. Received: {scenario} with a channel "
                "or a range of onsets. Leave it out."
            )
    options.at = [parse_place(text, 1.0) for text in options.at or ()]
    for place in options.at:
        Degraded(place.kind, place.severity)  # checks both
    options.length = split_limits(options.length or "100")
    options.start = None if options.start is None else parse_start(options.start)
    parse_length(options.continuous)


def _refuse(options: argparse.Namespace, when: str, *names: str) -> None:
    """Refuses options that are given."""
    for name in names:
        if getattr(options, name) not in (None, [], False):
            raise InputError(
                f"Expected no {flag_of(name)} {when}. Received: {flag_of(name)}. Leave it out."
            )


def cleaning_options(
    options: argparse.Namespace, min_part: int, labelled: str = "keep"
) -> Cleaning:
    """Returns the settings of reading and cleaning that the options of a command give, with the
    arguments as `Cleaning` has them.
    """
    given = [value for values in options.missing_values or () for value in values.split(",")]
    cleaning = options_from(options, Cleaning)
    return dataclasses.replace(cleaning, labelled=labelled, missing_values=given, min_part=min_part)
