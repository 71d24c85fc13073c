"""`python -m studies.spacecraft`: detectors on real spacecraft telemetry with labelled anomalies."""

import sys
from pathlib import Path

from studies.common.command import Command

OPTIONS = {
    "--data": {
        "type": Path,
        "required": True,
        "metavar": "DIR",
        "help": "folder with train/, test/ and labeled_anomalies.csv",
    },
    "--channels": {"metavar": "A,B", "help": "only these channels (default: all)"},
}
command = Command(
    "spacecraft", "Tests detectors on real telemetry with labelled anomalies.", OPTIONS
)

if __name__ == "__main__":
    sys.exit(command())
