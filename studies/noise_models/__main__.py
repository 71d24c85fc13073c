"""`python -m studies.noise_models`: every noise model on every family of noise."""

import sys
from argparse import Namespace
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import GALLERY


def tables_of(options: Namespace, settings: Any, stages: Any) -> dict[str, Any]:
    """The tables of one family of noise and seed."""
    from studies.noise_models.cells import Cell

    return Cell(settings, stages).tables


description = "Tries noise models on fourteen families of noise."
command = Command("noise_models", description, environments=GALLERY, tables_of=tables_of)

if __name__ == "__main__":
    sys.exit(command())
