"""`python -m studies.battery`: a coarse and a fine simulator of a satellite's battery."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.battery.run import run

    run(settings, options.cache, out, options.fresh, tell)


command = Command("battery", "Enhances a coarse simulator of a battery with the help of a fine one (PyBaMM).", "battery", run)

if __name__ == "__main__":
    sys.exit(command())
