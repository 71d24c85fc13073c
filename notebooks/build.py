"""`python -m notebooks.build 04 05`: executes lessons at full budget and writes each notebook beside its source.

The scripts `NN_name.py` are the sources. Run `python -m enhsim_tf.reproduce` first: a lesson then finds every stage in the cache, and no
progress bar stays in its notebook. If only prose has changed, `--keep-outputs` writes it without executing anything.
"""

import argparse
import base64
import os
import re
import shutil
import sys
import tomllib
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
FOLD = {
    "jupyter": {"source_hidden": True},
    "tags": ["hide-input"],
}  # Jupyter and the book fold the code of a cell with it
SET_UP = "set-up"  # metadata of the cell that makes a lesson run outside a clone
SET_UP_CODE = """\
# outside a clone, as in Colab: fetches it, and installs what it requires
import importlib.util
import os
import subprocess
import sys

if not importlib.util.find_spec("lesson_tools"):
    if not os.path.isdir("lessons"):
        subprocess.run(["git", "clone", "--quiet", "--depth", "1", "{address}", "lessons"], check=True)
        install = [sys.executable, "-m", "pip", "install", "--quiet", "--requirement", "lessons/requirements.txt"]
        subprocess.run(install, check=True)
    os.chdir("lessons/notebooks")
    sys.path.insert(0, os.getcwd())"""
IMAGE = re.compile(r'(<img [^>]*src=)"(.*?)"')  # in a page
TIMEOUT_S = 1_800  # for one cell: in a fresh clone it trains


def sources() -> list[Path]:
    """The sources of the lessons, in the order of their numbers."""
    return sorted(FOLDER.glob("[0-9][0-9]_*.py"))


def published_at() -> str | None:
    """The public address of the repository, in `[project.urls]` of `pyproject.toml`; None until it has one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return project.get("urls", {}).get("Repository")


def badges(address: str, name: str) -> str:
    """Links that open a notebook at an address of GitHub in Colab and in Binder."""
    repository = address.removeprefix("https://github.com/").removesuffix("/").removesuffix(".git")
    colab = f"https://colab.research.google.com/github/{repository}/blob/main/notebooks/{name}"
    binder = f"https://mybinder.org/v2/gh/{repository}/main?labpath=notebooks/{name}"
    return (
        f"[![Open in Colab](https://colab.research.google.com/assets/colab-badge.svg)]({colab}) "
        f"[![Open in Binder](https://mybinder.org/badge_logo.svg)]({binder})"
    )


def read(source: Path, address: str | None = None) -> nbformat.NotebookNode:
    """A source as a notebook without outputs, always the same for the same source.

    Args:
        source: One of `sources()`.
        address: Address of the repository; with one, the notebook has badges and a cell that makes it run outside a clone.
    """
    notebook = jupytext.read(source, fmt="py:percent")
    for cell in notebook.cells:
        if cell.cell_type == "code" and CHECK in cell.source:
            cell.metadata.update(FOLD)  # it computes the answer
    if address:
        title, _, rest = notebook.cells[0].source.partition("\n")
        notebook.cells[0].source = f"{title}\n\n{badges(address, source.with_suffix('.ipynb').name)}\n{rest}"
        set_up = nbformat.v4.new_code_cell(SET_UP_CODE.format(address=address), metadata={SET_UP: True})
        notebook.cells.insert(1, set_up)
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


def drop_solutions(notebook: nbformat.NotebookNode) -> None:
    """Removes the folded solutions."""
    notebook.cells = [cell for cell in notebook.cells if "<details>" not in cell.source]


def code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The cells of a lesson that are executed; the set-up is none, because it does nothing in a clone."""
    return [cell for cell in notebook.cells if cell.cell_type == "code" and SET_UP not in cell.metadata]


def keep_outputs(source: Path) -> nbformat.NotebookNode:
    """The notebook beside a source with the prose that the source has now, and the outputs that it has.

    Raises:
        ValueError: If code has changed.
    """
    stored, wanted = (
        nbformat.read(source.with_suffix(".ipynb"), as_version=4),
        read(source, published_at()),
    )
    pairs = list(zip(code_cells(stored), code_cells(wanted)))
    if [cell.source for cell in code_cells(stored)] != [cell.source for cell in code_cells(wanted)]:
        raise ValueError(
            f"Expected only prose to have changed in {source.name}. Received: other code. Execute it."
        )
    for old, new in pairs:
        new.outputs, new.execution_count = old.outputs, old.execution_count
    wanted.metadata[STAMP] = stored.metadata[STAMP]
    return wanted


def execute(source: Path, budget: str = FULL, solved: bool = False) -> nbformat.NotebookNode:
    """Executes a source in a kernel of its own, in the folder of the lessons, as Jupyter does.

    Args:
        source: One of `sources()`.
        budget: `full` or `smoke`.
        solved: Whether the exercises are solved, see `solve`.

    Raises:
        nbclient.exceptions.CellExecutionError: If a cell raises.
    """
    notebook = read(source, published_at())
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
    notebook, wanted = nbformat.read(path, as_version=4), read(source, published_at())
    stamp = notebook.metadata.get(STAMP, {})
    wrong = {
        "its source has changed": [cell.source for cell in notebook.cells]
        != [cell.source for cell in wanted.cells],
        "the findings that it shows have changed": stamp.get("findings") != findings(source),
        "it was not executed at full budget": stamp.get("budget") != FULL,
        "a cell was not executed": not all(cell.execution_count for cell in code_cells(notebook)),
    }
    return [reason for reason, is_true in wrong.items() if is_true]


def build_slides(out: Path) -> None:
    """Writes the lecture, `slides.py`, as one page for a browser, with pictures of lessons and of `figures/` inside it.

    A picture of a lesson is named `13_combined.ipynb#2`: the second that the notebook shows.
    """
    from nbconvert import SlidesExporter

    def embed(match: re.Match) -> str:
        begin, name = match.groups()
        path, _, number = name.partition("#")
        if number:
            cells = nbformat.read(FOLDER / path, as_version=4).cells
            data = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
            png = [each["image/png"] for each in data if "image/png" in each][int(number) - 1]
        else:
            png = base64.b64encode((FOLDER / path).read_bytes()).decode()
        return f'{begin}"data:image/png;base64,{png}"'

    deck = jupytext.read(FOLDER / "slides.py", fmt="py:percent")
    exporter = SlidesExporter(
        reveal_theme="white",
        reveal_transition="none",
        reveal_number="c/t",
        reveal_width="1280",
        reveal_height="720",
    )
    page, _ = exporter.from_notebook_node(
        deck, {"metadata": {"name": "From a coarse simulation to telemetry"}}
    )
    with replace_file(out) as temporary:
        temporary.write_text(IMAGE.sub(embed, page), encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Runs the command."""
    known = {source.stem[:2]: source for source in sources()}
    parser = argparse.ArgumentParser(prog="python -m notebooks.build", description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "lessons", nargs="*", metavar="NN", help="numbers of lessons (default: all), for example 04"
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--keep-outputs", action="store_true", help="execute nothing: only prose has changed")
    kind.add_argument(
        "--solved", action="store_true", help="with solved exercises, for lecturers; into solved/"
    )
    kind.add_argument(
        "--student", action="store_true", help="without solutions, not executed anew; into student/"
    )
    kind.add_argument("--slides", action="store_true", help="the lecture as a page, build/slides.html")
    options = parser.parse_args(arguments)
    if unknown := set(options.lessons) - set(known):
        parser.error(
            f"Expected numbers of lessons: {', '.join(known)}. Received: {', '.join(sorted(unknown))}."
        )
    if options.slides:
        build_slides(make_folder(ROOT / "build") / "slides.html")
        return 0
    folder = FOLDER
    if options.solved or options.student:
        folder = make_folder(ROOT / ("solved" if options.solved else "student"))
        shutil.copy(FOLDER / "lesson_tools.py", folder)  # a kernel starts in the folder of its notebook
    for number in options.lessons or known:
        if options.keep_outputs or options.student:
            notebook = keep_outputs(known[number])
        else:
            notebook = execute(known[number], solved=options.solved)
        if options.student:
            drop_solutions(notebook)
        with replace_file(folder / known[number].with_suffix(".ipynb").name) as temporary:
            nbformat.write(notebook, temporary)
        print(f"{known[number].stem} written", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
