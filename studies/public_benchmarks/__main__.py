"""`python -m studies.public_benchmarks`: views and peers on public telemetry with labels."""

import sys
from pathlib import Path

from studies.common.command import Command

OPTIONS = {
    "--data": {
        "type": Path,
        "required": True,
        "nargs": "+",
        "metavar": "DIR",
        "help": "folders of SMAP and MSL (train/, test/, labeled_anomalies.csv) or of SKAB",
    }
}
command = Command(
    "public_benchmarks", "Puts `score` beside other detectors on public telemetry.", OPTIONS
)

if __name__ == "__main__":
    sys.exit(command())
