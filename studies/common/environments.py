"""The kinds of noise that studies run with, by name, without slow imports."""

import argparse
import importlib
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command, Option

NOISES = ("white", "autoregressive", "heteroscedastic", "shot")
FAMILIES = (
    *NOISES, "fractional", "bernoulli", "one_over_f", "interference", "telegraph", "quantised", "bursts", "heavy_tails", "loudness",
    "signal_dependent",
)  # fmt: skip


def environment_option(names: tuple[str, ...]) -> Option:
    """The option `--environment` of a study with these kinds of noise."""
    return Option("--environment", {"choices": names, "help": "run with this kind of noise only (default: all)"})


def environments(options: argparse.Namespace, names: tuple[str, ...]) -> tuple[str, ...]:
    """The kinds of noise that `--environment` asks for."""
    return names if options.environment is None else (options.environment,)


def noise_command(study: str, description: str) -> Command:
    """The command of a study that runs with each of `NOISES` and has no further options; its function is `run` of `studies.STUDY.run`.

    Args:
        study: Name of the study, of its folder and of its group of settings.
        description: What the study does, in a sentence.
    """

    def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
        module = importlib.import_module(f"studies.{study}.run")
        module.run(settings, options.cache, out, environments(options, NOISES), options.fresh, tell)

    return Command(study, description, study, run, [environment_option(NOISES)])
