"""The entry point of `python -m enhsim_tf`: parses the options and runs the selected command."""

import argparse

from enhsim_tf.cli.arguments import parse
from enhsim_tf.cli.fit import run_fit
from enhsim_tf.cli.generate import run_generate
from enhsim_tf.cli.inject import run_inject
from enhsim_tf.cli.score import run_score
from enhsim_tf.cli.update import run_update
from enhsim_tf.cli.verify import run_verify
from enhsim_tf.common.console import run_command
from enhsim_tf.common.errors import InputError


def run(options: argparse.Namespace) -> int:
    """Runs the selected command and returns its exit code."""
    if options.seed is not None and not 0 <= options.seed < 2**31:
        raise InputError(f"Expected a seed from 0 to before 2**31. Received: --seed {options.seed}.")
    commands = {
        "fit": run_fit,
        "generate": run_generate,
        "verify": run_verify,
        "score": run_score,
        "update": run_update,
        "inject": run_inject,
    }
    return commands[options.command](options)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; None uses the arguments of the process. Invalid input gives one line on stderr and exit code 2."""
    return run_command(lambda: run(parse(arguments)), "interrupted; what was finished is kept")
