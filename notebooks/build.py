"""`python -m notebooks.build 04 05`: executes lessons at full budget and writes each notebook beside its source.

The scripts `NN_name.py` are the sources. Run `python -m enhsim_tf.reproduce` first: a lesson then finds every stage in the cache, and no
progress bar stays in its notebook. If only prose has changed, `jupytext --update --to ipynb NN_name.py` keeps the outputs.
"""

import argparse
import os
import re
import sys
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

from enhsim_tf.common.atomic_files import make_folder, replace_file, sha256
from notebooks.lesson_tools import BUDGET, FULL, ROOT, STATIC

FOLDER = Path(__file__).parent
STAMP = "enhsim_tf"  # the metadata of a notebook that hold its budget and the checksums of the findings that it shows
STUDY = re.compile(r'open_study\("(\w+)"\)')
SOLUTION = re.compile(r"```python\n(.*?)```", re.DOTALL)  # the code of a folded solution
CHECK = "check_answer("  # what a cell calls that checks an answer
TIMEOUT_S = 1_800  # for one cell: in a fresh clone it trains


def sources() -> list[Path]:
    """The sources of the lessons, in the order of their numbers."""
    return sorted(FOLDER.glob("[0-9][0-9]_*.py"))


def read(source: Path) -> nbformat.NotebookNode:
    """A source as a notebook without outputs, always the same for the same source."""
    notebook = jupytext.read(source, fmt="py:percent")
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    _number_cells(notebook)
    return notebook


def _number_cells(notebook: nbformat.NotebookNode) -> None:
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number:02}"


def solve(notebook: nbformat.NotebookNode) -> None:
    """Adds to each check of an answer the code of its folded solution, and the check once more.

    The first solution with code belongs to the first check, and so on.

    Raises:
        ValueError: If there are not as many solutions as checks.
    """
    folded = [
        cell.source for cell in notebook.cells if cell.cell_type == "markdown" and "<details>" in cell.source
    ]
    solutions = [code for source in folded for code in SOLUTION.findall(source)]
    checks = [cell for cell in notebook.cells if cell.cell_type == "code" and CHECK in cell.source]
    if len(solutions) != len(checks):
        raise ValueError(
            f"Expected a folded solution with code for each check. Received: {len(solutions)} for {len(checks)}."
        )
    for code, check in zip(solutions, checks, strict=True):
        at = notebook.cells.index(check) + 1
        added = [nbformat.v4.new_code_cell(text, metadata={"solved": True}) for text in (code, check.source)]
        notebook.cells[at:at] = added
    _number_cells(notebook)


def execute(source: Path, budget: str = FULL, solved: bool = False) -> nbformat.NotebookNode:
    """Executes a source in a kernel of its own, in the folder of the lessons, as Jupyter does.

    Args:
        source: One of `sources()`.
        budget: `full` or `smoke`.
        solved: Whether the exercises are solved, see `solve`.

    Raises:
        nbclient.exceptions.CellExecutionError: If a cell raises.
    """
    notebook = read(source)
    if solved:
        solve(notebook)
    client = NotebookClient(
        notebook,
        timeout=TIMEOUT_S,
        kernel_name="python3",
        resources={"metadata": {"path": str(FOLDER)}},
        record_timing=False,
        coalesce_streams=True,
        extra_arguments=["--IPKernelApp.log_level=ERROR"],
    )
    client.execute(env=os.environ | {BUDGET: budget, STATIC: "1"})
    notebook.metadata["language_info"] = {"name": "python"}  # what the kernel adds differs between machines
    notebook.metadata[STAMP] = {"budget": budget, "findings": findings(source)}
    return notebook


def findings(source: Path) -> dict[str, str]:
    """Checksums of the findings of studies that a lesson opens, by the name of the study."""
    opened = sorted(set(STUDY.findall(source.read_text(encoding="utf-8"))))
    return {name: sha256(ROOT / "studies" / name / "results" / "findings.json") for name in opened}


def faults(source: Path) -> list[str]:
    """Why the notebook beside a source is not this source, executed at full budget; empty if it is."""
    path = source.with_suffix(".ipynb")
    if not path.is_file():
        return ["there is no notebook"]
    notebook, wanted = nbformat.read(path, as_version=4), read(source)
    stamp = notebook.metadata.get(STAMP, {})
    wrong = {
        "its source has changed": [cell.source for cell in notebook.cells]
        != [cell.source for cell in wanted.cells],
        "the findings that it shows have changed": stamp.get("findings") != findings(source),
        "it was not executed at full budget": stamp.get("budget") != FULL,
        "a cell was not executed": not all(
            cell.execution_count for cell in notebook.cells if cell.cell_type == "code"
        ),
    }
    return [reason for reason, is_true in wrong.items() if is_true]


def main(arguments: list[str] | None = None) -> int:
    """Runs the command."""
    known = {source.stem[:2]: source for source in sources()}
    parser = argparse.ArgumentParser(prog="python -m notebooks.build", description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "lessons", nargs="*", metavar="NN", help="numbers of lessons (default: all), for example 04"
    )
    parser.add_argument(
        "--solved", action="store_true", help="with solved exercises, for lecturers; into solved/"
    )
    options = parser.parse_args(arguments)
    if unknown := set(options.lessons) - set(known):
        parser.error(
            f"Expected numbers of lessons: {', '.join(known)}. Received: {', '.join(sorted(unknown))}."
        )
    folder = make_folder(ROOT / "solved") if options.solved else FOLDER
    for number in options.lessons or known:
        notebook = execute(known[number], solved=options.solved)
        with replace_file(folder / known[number].with_suffix(".ipynb").name) as temporary:
            nbformat.write(notebook, temporary)
        print(f"{known[number].stem} written", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
