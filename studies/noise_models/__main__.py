"""`python -m studies.noise_models`: every noise model on every family of noise."""

import argparse
import sys
from pathlib import Path
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import GALLERY


def run(options: argparse.Namespace, settings: Any, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings."""
    from studies.common.replicates import run_study
    from studies.noise_models.cells import Cell

    def tables_of(family: str, seed: int, stages: Any) -> dict[str, Any]:
        return Cell(settings.of(family, seed), stages).tables()

    return run_study("noise_models", tables_of, options.environments, options, settings, out)


description = "Tries noise models on fourteen families of noise."
command = Command("noise_models", description, environments=GALLERY, run=run)

if __name__ == "__main__":
    sys.exit(command())
