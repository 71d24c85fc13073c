"""The command `python -m book`: builds the book as HTML and checks it. Warnings of Sphinx are errors."""

import argparse
import importlib.util
import shutil
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parent


def main(arguments: list[str] | None = None) -> int:
    """Runs the command.

    Returns:
        The exit code: 0, 1 if Sphinx warned or the check of the pages found something, or 2 if Sphinx is not installed.
    """
    parser = argparse.ArgumentParser(
        prog="python -m book",
        description="Builds the book from the notebooks (with their stored outputs), the pages of docs/ and the docstrings, "
        'and checks its links. It needs `python -m pip install ".[book]"` and no network.',
    )
    parser.add_argument("--out", type=Path, default=FOLDER.parent / "build" / "book", help="folder of the pages (default: build/book)")
    parser.add_argument("--tables", action="store_true", help="refresh the marked tables of README.md and docs/, and build nothing")
    options = parser.parse_args(arguments)
    if options.tables:
        from book.tables import refresh

        print(*refresh(FOLDER.parent), sep="\n")
        return 0
    missing = [name for name in ("sphinx", "myst_nb", "sphinx_book_theme") if importlib.util.find_spec(name) is None]
    if missing:
        print(f'Expected the packages of the book. Missing: {", ".join(missing)}. Run `python -m pip install ".[book]"`.', file=sys.stderr)
        return 2
    return build(options.out)


def build(out: Path) -> int:
    """Builds the book from the start, because Sphinx does not repeat the warnings of pages that it keeps, and checks it."""
    from sphinx.cmd.build import main as sphinx

    from book.html_check import problems

    if (out / "objects.inv").is_file():  # an earlier book, of which no page may stay behind
        shutil.rmtree(out)
    with tempfile.TemporaryDirectory() as kept:
        code = sphinx(["-b", "html", "-c", str(FOLDER), "-d", kept, "-q", "-W", str(FOLDER.parent), str(out)])
    found = list(problems(out)) if out.is_dir() else []
    for line in found:
        print(line, file=sys.stderr)
    print(out / "index.html")
    return 1 if code or found else 0


if __name__ == "__main__":
    sys.exit(main())
