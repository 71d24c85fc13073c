"""`python -m studies.readings`: do the verdicts on the paper hold over readings, seeds and roundings?"""

import argparse
import sys
from pathlib import Path

from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.common.errors import InputError


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Reads the command line without slow imports."""
    parser = Parser(
        prog="python -m studies.readings",
        description="Runs the paper over readings, seeds and roundings.",
    )
    parser.add_argument(
        "--budget",
        choices=("smoke", "full"),
        default="full",
        help="size of the runs (default: full, which takes hours)",
    )
    parser.add_argument(
        "--reference-seeds",
        type=int,
        default=10,
        metavar="N",
        help="seeds of the reference (default: 10)",
    )
    parser.add_argument(
        "--other-seeds",
        type=int,
        default=5,
        metavar="N",
        help="seeds of every other reading (default: 5)",
    )
    parser.add_argument(
        "--another-processor",
        action="store_true",
        help="only the reference, on another processor than the runs of DIR",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("results/readings"), metavar="DIR", help="output folder"
    )
    parser.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="folder of cached stages (default: .cache in a checkout)",
    )
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Runs the study and returns the exit code."""
    if min(options.reference_seeds, options.other_seeds) < 1:
        raise InputError("Expected at least one seed of each reading. Received: 0 or fewer.")
    from enhsim_tf.common.atomic_files import make_folder, write_json
    from enhsim_tf.common.stages import default_cache
    from enhsim_tf.paper.report import PUBLISHED
    from studies.common.replicates import save_all
    from studies.readings.figure import FIGURES
    from studies.readings.run import collect, runs
    from studies.readings.summary import publish, shares, verdicts

    out, planned = (
        make_folder(options.out),
        runs(options.reference_seeds, options.other_seeds, options.another_processor),
    )
    table = collect(planned, options.budget, options.cache or default_cache(), out, tell)
    write_json(out / PUBLISHED.name, publish(table))
    save_all(
        FIGURES,
        {"shares": shares(verdicts(table)), "budget": options.budget},
        out,
        "python -m studies.readings",
    )
    tell(
        f"table, {PUBLISHED.name} and figure in {out}/; a maintainer copies {PUBLISHED.name} to {PUBLISHED.parent.name}/"
    )
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. An error of the user is reported as one line, with exit code 2."""
    return run_command(
        lambda: run(parse(arguments)),
        "interrupted; finished runs are kept, and the next run continues after them",
    )


if __name__ == "__main__":
    sys.exit(main())
