"""`enhsim-tf`, or `python -m enhsim_tf`: telemetry of one's own, from a table to a simulator,
training data and scores.
"""

import importlib
import os
import sys
from typing import NoReturn

from enhsim_tf.cli.arguments import parse
from enhsim_tf.cli.checks import check
from enhsim_tf.common.atomic_files import removing_empty
from enhsim_tf.common.console import be_quiet, run_command


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; None uses the arguments of the process. Invalid input gives one line on
    stderr and exit code 2.
    """

    def run() -> int:
        options = check(parse(arguments))
        be_quiet(getattr(options, "quiet", False))
        # only now, because its imports are slow
        module = importlib.import_module(f"enhsim_tf.cli.{options.command}")
        with removing_empty(getattr(options, "out", None)):
            return getattr(module, f"run_{options.command}")(options)

    return run_command(run, "interrupted; what was finished is kept")


def command() -> NoReturn:
    """Runs the command and ends the process with its exit code."""
    exit_process(main())


def exit_process(code: int) -> NoReturn:
    """Ends the process of a command. With Ray loaded beside TensorFlow, it skips the interpreter's
    shutdown, which sometimes crashes.
    """
    if "ray" not in sys.modules:
        sys.exit(code)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(code)


if __name__ == "__main__":
    command()
