"""`python -m studies.factorial`: which part of the pipeline lowers false alarms."""

import sys
from argparse import Namespace
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import NOISES


def tables_of(options: Namespace, settings: Any, stages: Any) -> dict[str, Any]:
    """The table of one kind of noise and seed."""
    from studies.factorial.pipelines import Pipelines

    return Pipelines(settings, stages).tables


description = (
    "Combines windows, extraction, enhancer and generator of two pipelines and counts false alarms."
)
command = Command("factorial", description, environments=NOISES, tables_of=tables_of)

if __name__ == "__main__":
    sys.exit(command())
