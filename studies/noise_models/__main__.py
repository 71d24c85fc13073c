"""`python -m studies.noise_models`: every noise model on every family of noise."""

import argparse
import sys
from pathlib import Path
from typing import Any

from enhsim_tf.common.console import tell
from studies.common.command import Command, Option
from studies.common.environments import FAMILIES, environment_option, environments


def run(options: argparse.Namespace, settings: Any, out: Path) -> None:
    """Runs the study."""
    from studies.noise_models.run import run

    run(settings, options.cache, out, environments(options, FAMILIES), options.model, options.fresh, tell)


_MODEL = Option("--model", {"help": "try this noise model only; the rows of other models in the output folder are kept (default: all)"})
command = Command(
    "noise_models", "Tries noise models on fourteen families of noise.", "noise_models", run, [environment_option(FAMILIES), _MODEL]
)

if __name__ == "__main__":
    sys.exit(command())
