"""`python -m studies.few_windows`: how few real windows suffice, and from how few a simulator pays."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command
from studies.common.environments import NOISES, environment_option, environments


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.few_windows.run import run

    run(settings, options.cache, out, environments(options, NOISES), options.fresh, tell)


command = Command(
    "few_windows",
    "Varies the number of real windows from which detectors and simulators learn.",
    "few_windows",
    run,
    [environment_option(NOISES)],
)

if __name__ == "__main__":
    sys.exit(command())
