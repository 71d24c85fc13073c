"""`python -m studies.factorial`: which part of the pipeline lowers false alarms."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command
from studies.common.environments import NOISES, environment_option, environments


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.factorial.run import run

    run(settings, options.cache, out, environments(options, NOISES), options.fresh, tell)


command = Command(
    "factorial",
    "Combines windows, extraction, enhancer and generator of two pipelines and counts false alarms.",
    "factorial",
    run,
    [environment_option(NOISES)],
)

if __name__ == "__main__":
    sys.exit(command())
