"""`enhsim-tf`, or `python -m enhsim_tf`: telemetry of one's own, from a table to a simulator, training data and scores."""

from enhsim_tf.cli.main import main
from enhsim_tf.common.console import exit_process


def command() -> None:
    """Runs the command and ends the process with its exit code."""
    exit_process(main())


if __name__ == "__main__":
    command()
