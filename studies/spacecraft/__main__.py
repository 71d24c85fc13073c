"""`python -m studies.spacecraft`: detectors on real spacecraft telemetry with labelled anomalies."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command, Option


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.spacecraft.run import run

    chosen = None if options.channels is None else [name.strip() for name in options.channels.split(",")]
    run(settings, options.cache, options.data, out, chosen, options.fresh, tell)


OPTIONS = (
    Option("--data", {"type": Path, "required": True, "metavar": "DIR", "help": "folder with train/, test/ and labeled_anomalies.csv"}),
    Option("--channels", {"metavar": "A,B", "help": "only these channels (default: all)"}),
)
command = Command("spacecraft", "Tests detectors on real telemetry with labelled anomalies.", "labelled", run, OPTIONS)

if __name__ == "__main__":
    sys.exit(command())
