"""`python -m studies.reference_or_source`: when is an enhanced simulator worth having, and for what?"""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command, Option

SYSTEMS = ("battery", "aircraft")


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.reference_or_source.run import run

    run(settings, options.cache, out, SYSTEMS if options.system is None else (options.system,), options.fresh, tell)


_SYSTEM = Option("--system", {"choices": SYSTEMS, "help": "study this system only (default: both)"})
command = Command(
    "reference_or_source", "Compares the uses of a simulator, as a source and as a reference.", "reference_or_source", run, [_SYSTEM]
)

if __name__ == "__main__":
    sys.exit(command())
