"""`python -m studies.robustness`: detectors trained with each kind of noise, over seeds and environments."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command
from studies.common.environments import NOISES, environment_option, environments


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.robustness.run import run

    run(settings, options.cache, out, environments(options, NOISES), options.fresh, tell)


command = Command(
    "robustness",
    "Trains detectors with each kind of noise and counts false alarms and finds.",
    "robustness",
    run,
    [environment_option(NOISES)],
)

if __name__ == "__main__":
    sys.exit(command())
