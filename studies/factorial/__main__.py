"""`python -m studies.factorial`: which part of the pipeline lowers false alarms."""

import sys

from studies.common.environments import noise_command

command = noise_command("factorial", "Combines windows, extraction, enhancer and generator of two pipelines and counts false alarms.")

if __name__ == "__main__":
    sys.exit(command())
