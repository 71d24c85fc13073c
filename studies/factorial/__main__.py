"""`python -m studies.factorial`: which part of the pipeline lowers false alarms."""

import argparse
import sys
from pathlib import Path
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import NOISES


def run(options: argparse.Namespace, settings: Any, out: Path) -> dict[str, Any]:
    """Runs the study and returns its findings."""
    from studies.common.replicates import run_study
    from studies.factorial.pipelines import Pipelines
    from studies.robustness.replicate import Replicate

    def tables_of(environment: str, seed: int, stages: Any) -> dict[str, Any]:
        return Pipelines(Replicate(settings.of(environment, seed), stages)).tables()

    return run_study("factorial", tables_of, options.environments, options, settings, out)


description = (
    "Combines windows, extraction, enhancer and generator of two pipelines and counts false alarms."
)
command = Command("factorial", description, environments=NOISES, run=run)

if __name__ == "__main__":
    sys.exit(command())
