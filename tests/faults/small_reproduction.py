"""A small version of the reproduction as a command, into which `python -m tests.faults` injects faults.

`python -m tests.faults.small_reproduction --cache DIR --out DIR` is `python -m enhsim_tf.reproduce --budget smoke --arrays` with two of
the figures and the claims that need no detector and no clock: the same stages, cache and outputs, in a third of the time.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from enhsim_tf.reproduce import __main__ as command  # noqa: E402

KEPT_CLAIMS, KEPT_FIGURES = ("C1", "C4", "C5", "C9"), ("fig04_enhanced_simulation", "fig12_accuracy_loss")


def main():
    check = command.check

    def check_in_small(options):  # the command's first step, so that an interrupt hits it while it works
        from enhsim_tf.reproduce.paper import claims, figures

        claims.CLAIMS = tuple(claim for claim in claims.CLAIMS if claim.id in KEPT_CLAIMS)
        figures.FIGURES = {name: figures.FIGURES[name] for name in KEPT_FIGURES}
        check(options)

    command.check = check_in_small
    return command.main(["--budget", "smoke", "--arrays", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
