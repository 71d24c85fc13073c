"""`python -m studies.few_windows`: how few real windows suffice, and from how few a simulator
pays.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import NOISES


def run(options: argparse.Namespace, settings: Any, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings."""
    import pandas as pd

    from studies.common.replicates import run_study
    from studies.few_windows.cells import World

    def tables_of(environment: str, seed: int, stages: Any) -> dict[str, pd.DataFrame]:
        world = World(settings.of(environment, seed))
        return {
            "rows": pd.concat(
                [world.rows(number, stages) for number in settings.few_windows.num_real],
                ignore_index=True,
            )
        }

    return run_study("few_windows", tables_of, options.environments, options, settings, out)


description = "Varies the number of real windows from which detectors and simulators learn."
command = Command("few_windows", description, environments=NOISES, run=run)

if __name__ == "__main__":
    sys.exit(command())
