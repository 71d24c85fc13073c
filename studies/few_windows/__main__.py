"""`python -m studies.few_windows`: how few real windows suffice, and from how few a simulator
pays.
"""

import sys
from argparse import Namespace
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import NOISES


def tables_of(options: Namespace, settings: Any, stages: Any) -> dict[str, Any]:
    """The table of one kind of noise and seed."""
    from studies.few_windows.cells import World

    return World(settings).tables(stages)


description = "Varies the number of real windows from which detectors and simulators learn."
command = Command("few_windows", description, environments=NOISES, tables_of=tables_of)

if __name__ == "__main__":
    sys.exit(command())
