"""`python -m studies.reference_or_source`: when is an enhanced simulator worth having, and for what?"""

import sys

from studies.common.command import Command

OPTIONS = {
    "--system": {
        "choices": ("battery", "aircraft"),
        "help": "study this system only (default: both)",
    }
}
command = Command(
    "reference_or_source",
    "Compares the uses of a simulator, as a source and as a reference.",
    OPTIONS,
)

if __name__ == "__main__":
    sys.exit(command())
