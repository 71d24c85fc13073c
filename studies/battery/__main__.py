"""`python -m studies.battery`: a coarse and a fine simulator of a satellite's battery."""

import sys

from studies.common.command import Command

command = Command(
    "battery", "Enhances a coarse simulator of a battery with the help of a fine one (PyBaMM)."
)

if __name__ == "__main__":
    sys.exit(command())
