"""`python -m notebooks.build 04 05`: executes lessons at full budget and writes each notebook beside its source.

The scripts `NN_name.py` are the sources. Run `python -m enhsim_tf.reproduce` first: a lesson then finds every stage in the cache, and no
progress bar stays in its notebook. If only prose has changed, `--keep-outputs` writes it without executing anything.
"""

import argparse
import base64
import io
import os
import re
import shutil
import sys
from pathlib import Path
from urllib.parse import unquote

import jupytext
import nbformat
from nbclient import NotebookClient
from PIL import Image

from enhsim_tf.common.atomic_files import make_folder, replace_file, sha256
from enhsim_tf.common.console import run_command
from enhsim_tf.common.errors import InputError
from notebooks.lesson_tools import BUDGET, FULL, ROOT, STATIC

FOLDER = Path(__file__).parent
STAMP = "enhsim_tf"  # the metadata of a notebook that hold its budget and the checksums of the findings that it shows
STUDY = re.compile(r'open_study\("(\w+)"\)')
SOLUTION = re.compile(r"```python\n(.*?)```", re.DOTALL)  # the code of a solution
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
GITHUB = re.compile(r"https://github\.com/([\w.-]+/[\w.-]+?)(?:\.git)?/?")
BRANCH = "lessons"  # which the workflow of the book writes; Colab opens lessons from it
IMAGE = re.compile(r'(<img [^>]*src=)"(.*?)"')  # in a page
TIMEOUT_S = 1_800  # for one cell: in a fresh clone it trains


def sources() -> list[Path]:
    """The sources of the lessons, in the order of their numbers."""
    return sorted(FOLDER.glob("[0-9][0-9]_*.py"))


def badges(address: str, name: str) -> str:
    """Links that open a notebook of a repository on GitHub in Colab and in Binder.

    Args:
        address: Address of the repository, `https://github.com/OWNER/NAME`.
        name: File name of the notebook.

    Raises:
        InputError: If the address is another one.
    """
    match = GITHUB.fullmatch(address)
    if match is None:
        raise InputError(f"Expected https://github.com/OWNER/NAME. Received: {address!r}.")
    repository = match[1]
    colab = f"https://colab.research.google.com/github/{repository}/blob/{BRANCH}/notebooks/{name}"
    binder = f"https://mybinder.org/v2/gh/{repository}/HEAD?labpath=notebooks/{name}"
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


def solutions_of(source: Path) -> list[str]:
    """The code of the solutions of a lesson, in the order of its checks; lessons and the book do not hold them."""
    text = (source.parent / "solutions" / f"{source.stem}.md").read_text(encoding="utf-8")
    return SOLUTION.findall(text)


def solve(notebook: nbformat.NotebookNode, solutions: list[str]) -> None:
    """Adds to each check of an answer the code of its solution, and the check once more.

    Raises:
        ValueError: If there are not as many solutions as checks.
    """
    checks = [cell for cell in notebook.cells if cell.cell_type == "code" and CHECK in cell.source]
    if len(solutions) != len(checks):
        raise ValueError(
            f"Expected a solution with code for each check. Received: {len(solutions)} for {len(checks)}."
        )
    for code, check in zip(solutions, checks, strict=True):
        at = notebook.cells.index(check) + 1
        added = [nbformat.v4.new_code_cell(text, metadata={"solved": True}) for text in (code, check.source)]
        notebook.cells[at:at] = added
    _number_cells(notebook)


def code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The cells of a lesson that are executed; the set-up is none, because it does nothing in a clone."""
    return [cell for cell in notebook.cells if cell.cell_type == "code" and SET_UP not in cell.metadata]


def keep_outputs(source: Path, address: str | None = None) -> nbformat.NotebookNode:
    """The notebook beside a source with the prose that the source has now, and the outputs that it has.

    Args:
        source: One of `sources()`.
        address: As for `read`.

    Raises:
        ValueError: If code has changed.
    """
    stored, wanted = (
        nbformat.read(source.with_suffix(".ipynb"), as_version=4),
        read(source, address),
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
    notebook = read(source)
    if solved:
        solve(notebook, solutions_of(source))
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
        "a cell was not executed": not all(cell.execution_count for cell in code_cells(notebook)),
    }
    return [reason for reason, is_true in wrong.items() if is_true]


def build_slides(out: Path) -> None:
    """Writes the lecture, `slides.py`, as one page for a browser that needs no network: its pictures are inside it.

    A picture of a lesson is named `13_combined.ipynb#2`: the second that the notebook shows. `#1|0.85` is the upper 85 % of the
    first one.
    """
    from nbconvert.filters import markdown2html

    sections: list[str] = []
    for cell in jupytext.read(FOLDER / "slides.py", fmt="py:percent").cells:
        html = IMAGE.sub(_embed, markdown2html(cell.source))
        if cell.metadata["slideshow"]["slide_type"] == "notes":
            sections[-1] += f"<aside>{html}</aside>"
        else:
            sections.append(html)
    body = "\n".join(f"<section>{section}</section>" for section in sections)
    page = (FOLDER / "slides.html").read_text(encoding="utf-8")
    page = page.replace("TITLE", "From a coarse simulation to telemetry").replace("SECTIONS", body)
    with replace_file(out) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _embed(match: re.Match) -> str:
    """The picture that an `<img>` names, inside it."""
    begin, name = match.groups()
    path, _, place = unquote(name).partition("#")
    number, _, share = place.partition("|")
    if number:
        cells = nbformat.read(FOLDER / path, as_version=4).cells
        data = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
        pictures = [each["image/png"] for each in data if "image/png" in each]
        png = base64.b64decode(pictures[int(number) - 1])
    else:
        png = (FOLDER / path).read_bytes()
    if share:
        picture, cropped = Image.open(io.BytesIO(png)), io.BytesIO()
        height = int(float(share) * picture.height)
        picture.crop((0, 0, picture.width, height)).save(cropped, "png", optimize=True)
        png = cropped.getvalue()
    return f'{begin}"data:image/png;base64,{base64.b64encode(png).decode()}"'


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. An error of the user is reported as one line, with exit code 2."""
    return run_command(lambda: run(arguments), "interrupted; written notebooks are whole")


def run(arguments: list[str] | None) -> int:
    """Parses the command line and runs the command."""
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
        "--published",
        metavar="ADDRESS",
        help="execute nothing: with badges and set-up for this repository on GitHub",
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
    if options.solved:
        folder = make_folder(ROOT / "solved")
        shutil.copy(FOLDER / "lesson_tools.py", folder)  # a kernel starts in the folder of its notebook
    for number in options.lessons or known:
        if options.keep_outputs or options.published:
            notebook = keep_outputs(known[number], options.published)
        else:
            notebook = execute(known[number], solved=options.solved)
        with replace_file(folder / known[number].with_suffix(".ipynb").name) as temporary:
            nbformat.write(notebook, temporary)
        print(f"{known[number].stem} written", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
