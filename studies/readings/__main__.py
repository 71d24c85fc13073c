"""`python -m studies.readings`: do the verdicts on the paper hold over readings, seeds and
roundings?
"""

import argparse
import sys
from pathlib import Path

from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.common.errors import InputError
from studies.common.command import add_budget_and_cache


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Reads the command line without slow imports."""
    parser = Parser(
        prog="python -m studies.readings",
        description="Runs the paper over readings, seeds and roundings.",
    )
    add_budget_and_cache(parser)
    parser.add_argument(
        "--column-seeds",
        type=int,
        default=10,
        metavar="N",
        help="seeds of the base and of the author's configuration (default: 10)",
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
        help="this is another processor than that of the runs in DIR",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("results/readings"), metavar="DIR", help="output folder"
    )
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Runs the study and returns the exit code."""
    if min(options.column_seeds, options.other_seeds) < 1:
        raise InputError("Expected at least one seed of each reading. Received: 0 or fewer.")
    from enhsim_tf.common.atomic_files import make_folder, write_json
    from enhsim_tf.common.stages import default_cache
    from enhsim_tf.paper.report import PUBLISHED
    from studies.common.replicates import save_all
    from studies.readings.figure import FIGURES
    from studies.readings.run import collect, runs
    from studies.readings.summary import publish, shares

    out = make_folder(options.out)
    planned = runs(options.column_seeds, options.other_seeds, options.another_processor)
    table = collect(planned, options.budget, options.cache or default_cache(), out, tell)
    published = publish(table)
    write_json(out / PUBLISHED.name, published)
    about = {"shares": shares(table), "basis": published["basis"], "budget": options.budget}
    save_all(FIGURES, about, out, "python -m studies.readings")
    tell(
        f"table, {PUBLISHED.name} and figure in {out}/; a maintainer copies {PUBLISHED.name} to "
        f"{PUBLISHED.parent.name}/"
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
