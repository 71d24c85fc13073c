"""`python -m studies.robustness`: detectors trained with each kind of noise, over seeds and environments."""

import sys

from studies.common.environments import noise_command

command = noise_command("robustness", "Trains detectors with each kind of noise and counts false alarms and finds.")

if __name__ == "__main__":
    sys.exit(command())
