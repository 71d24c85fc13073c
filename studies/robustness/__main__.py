"""`python -m studies.robustness`: detectors trained with each kind of noise, over seeds and
environments.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import NOISES


def run(options: argparse.Namespace, settings: Any, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings; degraded modes are tested with the first kind of
    noise.
    """
    from studies.common.replicates import run_study
    from studies.robustness.degraded_modes import DegradedModes
    from studies.robustness.replicate import Replicate

    def tables_of(environment: str, seed: int, stages: Any) -> dict[str, Any]:
        one = Replicate(settings.of(environment, seed), stages)
        return one.tables | (
            {"degraded": DegradedModes(one).table} if environment == options.environments[0] else {}
        )

    return run_study("robustness", tables_of, options.environments, options, settings, out)


description = "Trains detectors with each kind of noise and counts false alarms and finds."
command = Command("robustness", description, environments=NOISES, run=run)

if __name__ == "__main__":
    sys.exit(command())
