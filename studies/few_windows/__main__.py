"""`python -m studies.few_windows`: how few real windows suffice, and from how few a simulator pays."""

import sys

from studies.common.environments import noise_command

command = noise_command("few_windows", "Varies the number of real windows from which detectors and simulators learn.")

if __name__ == "__main__":
    sys.exit(command())
