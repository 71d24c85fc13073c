"""`python -m notebooks.build`: executes the sources `NN_name.py` and writes `NN_name.ipynb` beside them.

Each notebook is stamped with the checksums of its source and of the findings that it shows, and the budget it ran at.
`--check` executes nothing and says which notebooks are no longer what these are; exit code 1 if there is one.
`--prose` takes new prose into executed notebooks whose code is unchanged, and executes nothing either.
"""

import argparse
import json
import os
import re
import sys
import time
from pathlib import Path

import jupytext
import nbclient
import nbformat
from jupyter_client.manager import KernelManager

from enhsim_tf.common.atomic_files import make_folder, replace_file, sha256
from notebooks.lesson_tools import STATIC, TIMES

FOLDER = Path(__file__).parent
STAMP = "enhsim_tf"  # the notebook's metadata that hold its stamp
MAX_BYTES = 1_000_000
FINDINGS = {
    "open_findings(": "robustness",
    "open_labelled(": "labelled",
    "open_residual(": "labelled/residual.csv",
    "open_curve(": "learning_curve",
    "open_battery(": "battery",
    "open_factorial(": "factorial",
    "open_noise(": "noise",
}  # what a source calls, and whose findings it shows: those of an experiment, or one of its tables
SOLUTION = re.compile(r"```python\n(.*?)```", re.DOTALL)  # the code of a folded solution
CHECK = "check_answer("  # what a cell calls that checks an answer
TIMEOUT_S = 1_800  # for one cell: a fresh clone trains in it


def sources() -> list[Path]:
    """The notebooks' sources, in the order of their numbers."""
    return sorted(FOLDER.glob("[0-9][0-9]_*.py"))


def read(source: Path) -> nbformat.NotebookNode:
    """A source as a notebook without outputs, always the same for the same source."""
    notebook = jupytext.read(source, fmt="py:percent")
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number:02}"
    return notebook


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
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number:02}"


def execute(
    source: Path,
    budget: str,
    cache: Path | None = None,
    kernel: KernelManager | None = None,
    solved: bool = False,
) -> nbformat.NotebookNode:
    """Executes a source in a kernel, in the folder of the notebooks as Jupyter does, and stamps it.

    Args:
        source: One of `sources()`.
        budget: `full` or `smoke`.
        cache: Where finished stages are kept; None keeps them where `reproduce` does.
        kernel: A kernel that goes on to live, with what it has imported; it was started, if at all, for this budget and
            cache. The notebook finds no name of an earlier one. None: a kernel of the notebook's own.
        solved: Whether the exercises are solved, see `solve`.

    Raises:
        nbclient.exceptions.CellExecutionError: If a cell raises.
    """
    notebook = read(source)
    if solved:
        solve(notebook)
    found = os.pathsep.join(path for path in (str(FOLDER.parent), os.environ.get("PYTHONPATH")) if path)
    environment = os.environ | {"ENHSIM_TF_BUDGET": budget, STATIC: "1", "PYTHONPATH": found}
    environment |= {} if cache is None else {"ENHSIM_TF_CACHE": str(cache)}
    client = nbclient.NotebookClient(
        notebook,
        km=kernel,
        timeout=TIMEOUT_S,
        kernel_name="python3",
        resources={"metadata": {"path": str(source.parent)}},
        record_timing=False,
        coalesce_streams=True,
        extra_arguments=["--IPKernelApp.log_level=ERROR"],
    )
    if kernel is not None and kernel.has_kernel:
        _forget(kernel)
    client.execute(env=environment, cleanup_kc=kernel is None)
    notebook.metadata["language_info"] = {
        "name": "python"
    }  # what the kernel says of itself differs from machine to machine
    notebook.metadata[STAMP] = {
        "source": source.name,
        "sha256": sha256(source),
        "findings": findings(source),
        "budget": budget,
    }
    return notebook


def _forget(kernel: KernelManager) -> None:
    """Takes all names that a notebook has left from its kernel."""
    channels = kernel.client()
    channels.start_channels()
    try:
        channels.wait_for_ready()
        reply = channels.execute("%reset -f", reply=True, timeout=60)
        if reply["content"]["status"] != "ok":
            raise RuntimeError(f"The kernel keeps its names: {reply['content']}")
    finally:
        channels.stop_channels()


def findings(source: Path, figures: Path = FOLDER.parent / "figures") -> dict[str, str]:
    """Checksums of the findings of experiments that a source shows, by the experiment's name."""
    text = source.read_text(encoding="utf-8")
    shown = [name for call, name in FINDINGS.items() if call in text]
    return {
        name: sha256(figures / (name if Path(name).suffix else f"{name}/findings.json")) for name in shown
    }


def faults(source: Path) -> list[str]:
    """What is wrong with the notebook beside a source; nothing if it is the source, executed at full budget."""
    path = source.with_suffix(".ipynb")
    if not path.is_file():
        return ["not there"]
    notebook, expected, found = nbformat.read(path, as_version=4), read(source), []
    stamp = notebook.metadata.get(STAMP, {})
    if stamp.get("sha256") != sha256(source) or [cell.source for cell in notebook.cells] != [
        cell.source for cell in expected.cells
    ]:
        found.append("stale: its source has changed")
    if stamp.get("findings", {}) != findings(source):
        found.append("stale: the findings that it shows have changed")
    if stamp.get("budget") != "full":
        found.append(f"executed at {stamp.get('budget', 'no')} budget")
    if not all(cell.execution_count for cell in notebook.cells if cell.cell_type == "code"):
        found.append("not executed from first to last cell")
    if path.stat().st_size >= MAX_BYTES:
        found.append(f"{path.stat().st_size:,} bytes, {MAX_BYTES:,} or more")
    return found


def take_prose(source: Path) -> bool:
    """Takes the prose of a source into the executed notebook beside it, whose outputs stay.

    Args:
        source: One of `sources()`.

    Returns:
        Whether the notebook has changed.

    Raises:
        ValueError: If its code or the findings that it shows have changed, so that it must be executed.
    """
    path = source.with_suffix(".ipynb")
    executed, wanted = nbformat.read(path, as_version=4), read(source)
    old, new = ([cell for cell in each.cells if cell.cell_type == "code"] for each in (executed, wanted))
    if [cell.source for cell in old] != [cell.source for cell in new]:
        raise ValueError("its code has changed: execute it")
    if executed.metadata[STAMP].get("findings", {}) != findings(source):
        raise ValueError("the findings that it shows have changed: execute it")
    for before, after in zip(old, new, strict=True):
        after.outputs, after.execution_count = before.outputs, before.execution_count
    wanted.metadata = executed.metadata
    wanted.metadata[STAMP]["sha256"] = sha256(source)
    if wanted == executed:
        return False
    with replace_file(path) as temporary:
        nbformat.write(wanted, temporary)
    return True


def take_all_prose() -> int:
    """Takes the prose of all sources, prints what became of each, and returns the exit code."""
    failed = False
    for source in sources():
        try:
            said = "new prose" if take_prose(source) else "unchanged"
        except ValueError as error:
            said, failed = str(error), True
        print(f"{source.stem:32} {said}")
    return int(failed)


def check() -> int:
    """Prints what is wrong with each notebook and returns the exit code."""
    wrong = {source.stem: faults(source) for source in sources()}
    lost = set(FOLDER.glob("*.ipynb")) - {source.with_suffix(".ipynb") for source in sources()}
    wrong |= {path.stem: ["it has no source"] for path in lost}
    for name, reasons in wrong.items():
        print(f"{name:32} {'; '.join(reasons) or 'current'}")
    return int(any(wrong.values()))


def keep_time(source: Path, budget: str, seconds: float) -> None:
    """Keeps how long a notebook took, which its first cell tells when it is executed next."""
    path = FOLDER / TIMES
    took = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    took.setdefault(source.stem[:2], {})[budget] = round(seconds)
    with replace_file(path) as temporary:
        temporary.write_text(json.dumps(took, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def build(budget: str, only: str | None, solved: bool = False) -> int:
    """Executes the notebooks, all or the one that is named by its number.

    A smoke build goes to `smoke/`, and one with solved exercises to `solved/`.
    """
    chosen = [source for source in sources() if only in (None, source.stem, source.stem[:2])]
    if not chosen:
        print(
            f"error: Expected --only with one of {', '.join(source.stem[:2] for source in sources())}. Received: {only!r}.",
            file=sys.stderr,
        )
        return 2
    from notebooks.notebook import open_experiment, prepare

    prepare(open_experiment(budget))  # so that no progress bar of a training stays in a notebook
    folder = FOLDER
    if solved or budget == "smoke":
        folder = make_folder(FOLDER.parent / ("solved" if solved else "smoke"))
    for source in chosen:
        began = time.perf_counter()
        notebook = execute(source, budget, solved=solved)
        if not solved:
            keep_time(source, budget, time.perf_counter() - began)
        path = folder / source.with_suffix(".ipynb").name
        with replace_file(path) as temporary:
            nbformat.write(notebook, temporary)
        print(
            f"{source.stem:32} {time.perf_counter() - began:6.1f} s {path.stat().st_size / 1e3:6.0f} kB",
            flush=True,
        )
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(prog="python -m notebooks.build", description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "--budget",
        choices=("full", "smoke"),
        default="full",
        help="smoke writes into smoke/ (default: full)",
    )
    parser.add_argument("--only", metavar="NN", help="one notebook, for example 04")
    parser.add_argument(
        "--check", action="store_true", help="say which notebooks are stale, and execute nothing"
    )
    parser.add_argument(
        "--prose",
        action="store_true",
        help="take new prose into notebooks whose code is unchanged, and execute nothing",
    )
    parser.add_argument(
        "--solved", action="store_true", help="with the exercises solved, for lecturers; writes into solved/"
    )
    options = parser.parse_args(arguments)
    if options.check:
        return check()
    return take_all_prose() if options.prose else build(options.budget, options.only, options.solved)


if __name__ == "__main__":
    sys.exit(main())
