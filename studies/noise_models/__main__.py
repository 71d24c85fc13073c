"""`python -m studies.noise_models`: every noise model on every family of noise."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command
from studies.common.environments import FAMILIES, environment_option, environments
from studies.noise_models.names import RUNG_NAMES, chosen_rungs, rungs_option


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.noise_models.run import run

    run(settings, options.cache, out, environments(options, FAMILIES), chosen_rungs(options.rungs, tuple(RUNG_NAMES)), options.fresh, tell)


command = Command(
    "noise_models", "Tries noise models on fourteen families of noise.", "ladder", run, [environment_option(FAMILIES), rungs_option()]
)

if __name__ == "__main__":
    sys.exit(command())
