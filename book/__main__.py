"""The command `python -m book`: builds the book as HTML, or refreshes the marked tables of the
pages or the data of the playground.
"""

import argparse
import importlib.util
import shutil
import sys
import tempfile
from pathlib import Path

from enhsim_tf.common.console import run_command

ROOT = Path(__file__).parents[1]
PLAYGROUND = ROOT / "book" / "playground"


def main(arguments: list[str] | None = None) -> int:
    """Runs the command.

    Returns:
        The exit code: 0, 1 if Sphinx warned, or 2 if its packages are not installed or an argument
        cannot be used.
    """
    return run_command(lambda: run(arguments), "interrupted; nothing was written")


def run(arguments: list[str] | None) -> int:
    """Parses the command line and runs the command."""
    parser = argparse.ArgumentParser(
        prog="python -m book",
        description="Builds the book from the notebooks (with their stored outputs), the pages and "
        'the docstrings. It needs `python -m pip install ".[book]"` and no network.',
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=ROOT / "build" / "book",
        help="folder of the pages (default: build/book)",
    )
    parser.add_argument(
        "--tables",
        action="store_true",
        help="refresh the marked tables of README.md and docs/, and build nothing",
    )
    parser.add_argument(
        "--playground",
        action="store_true",
        help="write the data of book/playground from the paper's pipeline, and build nothing",
    )
    parser.add_argument(
        "--summary",
        type=Path,
        metavar="RESULTS",
        help="print the verdicts of a run's results.json as Markdown, and build nothing",
    )
    options = parser.parse_args(arguments)
    if options.summary:
        from book.tables import summary

        print(summary(options.summary))
        return 0
    if options.tables:
        from book.tables import refresh

        print(*refresh(ROOT), sep="\n")
        return 0
    if options.playground:
        print(write_playground())
        return 0
    missing = [
        name
        for name in ("sphinx", "myst_nb", "sphinx_book_theme", "sphinx_external_toc")
        if importlib.util.find_spec(name) is None
    ]
    if missing:
        print(
            f"Expected the packages of the book. Missing: {', '.join(missing)}. "
            'Run `python -m pip install ".[book]"`.',
            file=sys.stderr,
        )
        return 2
    return build(options.out)


def build(out: Path) -> int:
    """Builds the book from the start, because Sphinx does not repeat the warnings of pages that it
    keeps.
    """
    from sphinx.cmd.build import main as sphinx

    if (out / "objects.inv").is_file():  # an earlier book, of which no page may stay behind
        shutil.rmtree(out)
    with tempfile.TemporaryDirectory() as kept:
        code = sphinx(
            [
                "-b",
                "html",
                "-c",
                str(ROOT / "book"),
                "-d",
                kept,
                "-q",
                "-W",
                "--keep-going",
                str(ROOT),
                str(out),
            ]
        )
    shutil.copytree(PLAYGROUND, out / "playground", dirs_exist_ok=True)
    print(out / "index.html")
    return code


def write_playground() -> Path:
    """Writes the data of the playground, for which it trains the paper's networks unless the cache
    has them.
    """
    from book.playground_data import write  # with the networks, TensorFlow
    from enhsim_tf.common.console import tell
    from enhsim_tf.common.stages import Stages, default_cache
    from enhsim_tf.paper.pipeline import Pipeline
    from enhsim_tf.paper.settings import make_settings

    path = PLAYGROUND / "data.js"
    write(Pipeline(make_settings(), Stages(default_cache(), tell=tell, speaks=True)), path)
    return path


if __name__ == "__main__":
    sys.exit(main())
