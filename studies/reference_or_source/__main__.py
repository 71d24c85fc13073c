"""`python -m studies.reference_or_source`: when is an enhanced simulator worth having, and for
what?
"""

import sys
from pathlib import Path

from studies.common.command import Command

OPTIONS = {
    "--system": {
        "choices": ("battery", "aircraft", "cells"),
        "help": "study this system only (default: all)",
    },
    "--data": {
        "type": Path,
        "metavar": "FOLDER",
        "help": "NASA's battery data set: B0005.csv, B0029.mat and their like",
    },
}
command = Command(
    "reference_or_source",
    "Compares the uses of a simulator, as a source and as a reference.",
    OPTIONS,
)

if __name__ == "__main__":
    sys.exit(command())
