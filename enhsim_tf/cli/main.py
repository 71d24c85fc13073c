"""The entry point of `python -m enhsim_tf`: parses the options and runs the selected command."""

import argparse
import importlib

from enhsim_tf.cli.arguments import parse
from enhsim_tf.common.console import run_command
from enhsim_tf.common.errors import InputError


def run(options: argparse.Namespace) -> int:
    """Runs the selected command, whose module is imported only now because its imports are slow, and returns its exit code."""
    if options.seed is not None and not 0 <= options.seed < 2**31:
        raise InputError(f"Expected a seed from 0 to before 2**31. Received: --seed {options.seed}.")
    module = importlib.import_module(f"enhsim_tf.cli.{options.command}")
    return getattr(module, f"run_{options.command}")(options)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; None uses the arguments of the process. Invalid input gives one line on stderr and exit code 2."""
    return run_command(lambda: run(parse(arguments)), "interrupted; what was finished is kept")
