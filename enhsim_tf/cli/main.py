"""The command `python -m enhsim_tf`: reads the options and runs the command that they name."""

import argparse
from typing import TYPE_CHECKING

from enhsim_tf.cli.arguments import parse
from enhsim_tf.common.console import finish
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    pass


from enhsim_tf.cli.fit import run_fit
from enhsim_tf.cli.generate import run_generate
from enhsim_tf.cli.score import run_score
from enhsim_tf.cli.verify import run_verify


def run(options: argparse.Namespace) -> int:
    """Runs what the options ask for and returns the exit code."""
    if options.seed is not None and not 0 <= options.seed < 2**31:
        raise InputError(f"Expected a seed from 0 to before 2**31. Received: --seed {options.seed}.")
    return {"fit": run_fit, "generate": run_generate, "verify": run_verify, "score": run_score}[options.command](options)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; a user's mistake is one line and exit code 2."""
    return finish(lambda: run(parse(arguments)), "interrupted; what was finished is kept")
