"""`python -m studies.robustness`: detectors trained with each kind of noise, over seeds and
environments.
"""

import sys
from argparse import Namespace
from typing import Any

from studies.common.command import Command
from studies.common.noise_processes import NOISES


def tables_of(options: Namespace, settings: Any, stages: Any) -> dict[str, Any]:
    """The tables of one kind of noise and seed; degraded modes are tested with the first kind of
    noise.
    """
    from studies.robustness.degraded_modes import DegradedModes

    one = DegradedModes(settings, stages)
    is_first = settings.noise == options.environments[0]
    return one.tables | ({"degraded": one.degraded} if is_first else {})


description = "Trains detectors with each kind of noise and counts false alarms and finds."
command = Command("robustness", description, environments=NOISES, tables_of=tables_of)

if __name__ == "__main__":
    sys.exit(command())
