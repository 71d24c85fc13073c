"""The command `python -m benchmarks`: runs the benchmarks, prints each row and writes `results.json`."""

import argparse
import sys
from pathlib import Path

GROUPS = ("enhancer", "gan", "generation", "tool", "starting")
RESULTS = Path(__file__).parent / "results.json"


def main(arguments: list[str] | None = None) -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Speed of enhsim_tf, compared with other implementations and with the limits of the machine. "
        "`python -m book --tables` then takes the results into docs/speed.md.",
    )
    parser.add_argument("--quick", action="store_true", help="tiny networks, few repetitions: shows that everything runs, measures nothing")
    parser.add_argument("--only", choices=GROUPS, nargs="+", default=GROUPS, help="measure only these")
    parser.add_argument("--out", type=Path, default=RESULTS, help="the results (default: results.json beside this program)")
    options = parser.parse_args(arguments)
    if options.out == RESULTS and (options.quick or options.only != GROUPS):
        parser.error("--quick and --only need another --out: results.json holds a whole measurement")

    from benchmarks import rows
    from benchmarks.machine import machine
    from benchmarks.report import line_of
    from enhsim_tf.common.atomic_files import write_json

    budget, found = rows.QUICK if options.quick else rows.Budget(), []
    for name in options.only:
        for row in getattr(rows, name)(budget):
            found.append(row)
            print(line_of(row), flush=True)
    write_json(options.out, {"machine": machine(), "rows": found})
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
