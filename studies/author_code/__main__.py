"""`python -m studies.author_code`: is the GAN of this project the author's?"""

import argparse
import importlib.util
import sys
from pathlib import Path

from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.common.errors import InputError
from studies.common.command import add_budget_and_cache

WHERE = "https://github.com/pgfeldman/GAN_brownbag, commit 50f5635, brownbag/OneDGAN2.py"


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Reads the command line without slow imports."""
    parser = Parser(
        prog="python -m studies.author_code",
        description="Runs the author's GAN on the noise of this project.",
        epilog=f"His file is published at {WHERE}.",
    )
    parser.add_argument("--code", type=Path, metavar="PATH", help="his file, OneDGAN2.py")
    add_budget_and_cache(parser)
    parser.add_argument("--seeds", type=int, default=10, metavar="N", help="seeds (default: 10)")
    parser.add_argument(
        "--out", type=Path, default=Path("results/author_code"), metavar="DIR", help="output folder"
    )
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Runs the study and returns the exit code."""
    if options.code is None or not options.code.is_file():
        raise InputError(
            f"Expected the author's file with --code. Received: {options.code}. It is published at "
            f"{WHERE}."
        )
    if options.seeds < 1:
        raise InputError(f"Expected at least one seed. Received: --seeds {options.seeds}.")
    if importlib.util.find_spec("tf_keras") is None:
        raise InputError(
            "Expected legacy Keras. Received: no module tf_keras. Run python -m pip install "
            "tf_keras==2.21.0."
        )
    import pandas as pd

    from enhsim_tf.common.atomic_files import make_folder
    from enhsim_tf.common.stages import default_cache
    from studies.author_code.figure import FIGURES
    from studies.author_code.run import collect, runs
    from studies.author_code.summary import pairs
    from studies.common.command import PUBLISHED
    from studies.common.replicates import save_all
    from studies.readings.run import TABLE

    out = make_folder(options.out)
    cache = options.cache or default_cache()
    planned = runs(options.seeds, min(options.seeds, 5), min(options.seeds, 3))
    table = collect(planned, options.code, options.budget, cache, out, tell)
    ours = pd.read_parquet(PUBLISHED / "readings" / "results" / TABLE)
    about = {"pairs": pairs(table, ours), "budget": options.budget}
    save_all(FIGURES, about, out, "python -m studies.author_code")
    tell(f"table and figure in {out}/")
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. An error of the user is reported as one line, with exit code 2."""
    return run_command(
        lambda: run(parse(arguments)),
        "interrupted; finished runs are kept, and the next run continues after them",
    )


if __name__ == "__main__":
    sys.exit(main())
