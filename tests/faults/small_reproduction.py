"""A small version of the reproduction as a command, into which `python -m tests.faults` injects faults.

`python tests/faults/small_reproduction.py --cache DIR --out DIR` is `python -m enhsim_tf.reproduce --budget smoke` with small networks,
two of the figures and the claims that need no detector and no clock: the same stages, cache and outputs, in a third of the time.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from enhsim_tf import reproduce  # noqa: E402

SMALL = ("window=100", "num_samples=20000", "hidden_units=32", "filters=16", "rows=60")
KEPT_CLAIMS, KEPT_FIGURES = ("C1", "C4", "C5", "C9"), ("fig04_enhanced_simulation", "fig12_accuracy_loss")


def main():
    read = reproduce.read_settings

    def read_and_reduce(options):  # in the command, so that an interrupt hits it while it works
        from enhsim_tf.paper import claims, figures

        claims.CLAIMS = tuple(claim for claim in claims.CLAIMS if claim.id in KEPT_CLAIMS)
        for name in figures.FIGURES.keys() - KEPT_FIGURES:
            del figures.FIGURES[name]
        return read(options)

    reproduce.read_settings = read_and_reduce
    return reproduce.main(["--budget", "smoke", *(word for each in SMALL for word in ("--set", each)), *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
