"""Lessons: each notebook is its source, executed at full budget; each lesson runs, and its
solutions are right.
"""

import ast
import re
import subprocess
import sys

import nbformat
import pytest

from enhsim_tf.common.errors import InputError
from notebooks import build
from notebooks.lesson_tools import CLAIMS, FIGURES, NOT_ANSWERED, RIGHT, ROOT, SMOKE

SOURCES = build.sources()
each_lesson = pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.stem)


def code_of(source):
    return [cell.source for cell in build.read(source).cells if cell.cell_type == "code"]


# -- never stale ---------------------------------------------------------------------------------


@each_lesson
def test_the_notebook_is_its_source_executed_at_full_budget(source):
    assert build.faults(source) == []


def test_no_notebook_is_without_a_source():
    assert sorted(build.FOLDER.glob("*.ipynb")) == [
        source.with_suffix(".ipynb") for source in SOURCES
    ]


@pytest.fixture
def tiny(tmp_path):
    """A small source, and beside it the notebook that an execution at full budget writes."""
    source = tmp_path / "99_tiny.py"
    source.write_text(
        '# %% [markdown]\n# # Tiny\n\n# %%\nopen_study("battery")\n', encoding="utf-8"
    )
    notebook = build.read(source)
    notebook.cells[1].execution_count = 1
    notebook.metadata[build.STAMP] = {"budget": build.FULL, "findings": build.findings(source)}
    nbformat.write(notebook, source.with_suffix(".ipynb"))
    assert build.faults(source) == []
    return source


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda notebook: notebook.cells[1].update(source="other"), "its source has changed"),
        (lambda notebook: notebook.cells[0].update(source="other"), "its source has changed"),
        (
            lambda notebook: notebook.cells[1].update(execution_count=None),
            "a cell was not executed",
        ),
        (
            lambda notebook: notebook.metadata[build.STAMP].update(budget=SMOKE),
            "it was not executed at full budget",
        ),
        (
            lambda notebook: notebook.metadata[build.STAMP].update(findings={"battery": "0"}),
            "the findings that it shows have changed",
        ),
    ],
)
def test_a_notebook_that_is_not_its_source_executed_is_found(tiny, change, fault):
    notebook = nbformat.read(tiny.with_suffix(".ipynb"), as_version=4)
    change(notebook)
    nbformat.write(notebook, tiny.with_suffix(".ipynb"))
    assert build.faults(tiny) == [fault]
    tiny.with_suffix(".ipynb").unlink()
    assert build.faults(tiny) == ["there is no notebook"]


# -- executed ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """One cache for all lessons, in which every stage is computed once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ENHSIM_TF_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.mark.slow
@each_lesson
def test_a_lesson_runs_and_its_solutions_are_right(source, cache):
    notebook = build.execute(source, SMOKE, solved=True)
    checks = [
        cell for cell in notebook.cells if cell.cell_type == "code" and build.CHECK in cell.source
    ]
    said = {}
    for cell in checks:
        text = "".join(output.text for output in cell.outputs).strip()
        said.setdefault(cell.metadata.get("solved", False), set()).add(text)
    assert said == {False: {NOT_ANSWERED}, True: {RIGHT}}


# -- for students, and outside a clone -----------------------------------------------------------

ADDRESS = "https://github.com/someone/something"


@each_lesson
def test_each_check_has_a_solution_and_no_lesson_holds_it(source):
    cells = build.read(source).cells
    checks = [cell for cell in cells if cell.cell_type == "code" and build.CHECK in cell.source]
    solutions, lesson = build.solutions_of(source), "\n".join(cell.source for cell in cells)
    assert len(checks) == len(solutions) > 0
    assert "<details>" not in lesson and not any(code.strip() in lesson for code in solutions)


def test_outputs_are_kept_only_if_no_code_has_changed(tiny):
    notebook = nbformat.read(tiny.with_suffix(".ipynb"), as_version=4)
    notebook.cells[1].outputs = [nbformat.v4.new_output("stream", text="seen")]
    nbformat.write(notebook, tiny.with_suffix(".ipynb"))
    tiny.write_text(tiny.read_text(encoding="utf-8").replace("Tiny", "Small"), encoding="utf-8")
    kept = build.keep_outputs(tiny)
    assert kept.cells[0].source == "# Small" and kept.cells[1].outputs[0].text == "seen"
    nbformat.write(kept, tiny.with_suffix(".ipynb"))
    assert build.faults(tiny) == []
    tiny.write_text(
        tiny.read_text(encoding="utf-8").replace("battery", "factorial"), encoding="utf-8"
    )
    with pytest.raises(ValueError, match="99_tiny"):
        build.keep_outputs(tiny)


def test_badges_and_set_up_are_there_with_an_address_and_not_without(tiny):
    without, published = build.keep_outputs(tiny), build.keep_outputs(tiny, ADDRESS)
    assert [cell.source for cell in without.cells] == ["# Tiny", 'open_study("battery")']
    title, set_up, code = (cell.source for cell in published.cells)
    place = "github/someone/something/blob/lessons/notebooks/99_tiny.ipynb"
    assert f"colab.research.google.com/{place}" in title
    assert "mybinder.org/v2/gh/someone/something/HEAD" in title
    assert ADDRESS in set_up and code == without.cells[1].source


@pytest.mark.parametrize(
    "address", ["someone/something", "https://example.org/a/b", "https://github.com/a"]
)
def test_an_address_elsewhere_is_refused(tiny, address):
    with pytest.raises(InputError, match="https://github.com/OWNER/NAME"):
        build.keep_outputs(tiny, address)


def test_the_set_up_fetches_a_clone_and_starts_in_its_lessons(tmp_path):
    clone, elsewhere = tmp_path / "origin", tmp_path / "elsewhere"
    (clone / "notebooks").mkdir(parents=True)
    elsewhere.mkdir()
    (clone / "notebooks" / "lesson_tools.py").write_text("found = True\n")
    (clone / "requirements.txt").write_text("")
    for command in (
        "git init -q",
        "git add .",
        "git -c user.name=a -c user.email=a@b commit -q -m first",
    ):
        subprocess.run(command.split(), cwd=clone, check=True)
    code = build.SET_UP_CODE.format(address=clone.as_uri())
    twice = (
        f"{code}\nimport lesson_tools\n{code}\nprint(lesson_tools.found, "
        "os.path.basename(os.getcwd()))"
    )
    for _ in range(2):  # a kernel that starts again finds the clone there
        done = subprocess.run(
            [sys.executable, "-c", twice], cwd=elsewhere, check=True, capture_output=True, text=True
        )
        assert done.stdout.strip().endswith("True notebooks")


def test_slides_hold_their_pictures_and_need_no_network(tmp_path):
    build.build_slides(tmp_path / "slides.html")
    page = (tmp_path / "slides.html").read_text(encoding="utf-8")
    shown = re.findall(r"!\[", (build.FOLDER / "slides.py").read_text(encoding="utf-8"))
    assert page.count('src="data:image/png;base64,') == len(shown) > 10
    assert not re.search(r'(src|href)="https?:', page) and "<link" not in page


# -- what they hold ------------------------------------------------------------------------------


@each_lesson
def test_what_a_lesson_tells_to_see_is_asserted(source):
    cells = build.read(source).cells
    for number, cell in enumerate(cells):
        if "*What to see:*" in cell.source:
            following = "\n".join(
                cell.source for cell in cells[number + 1 : number + 3] if cell.cell_type == "code"
            )
            assert any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(following))), (
                cell.source
            )


def test_a_claim_has_the_same_verdict_and_numbers_in_every_lesson():
    verdicts, numbers = {}, {}
    for source in SOURCES:
        for cell in build.code_cells(nbformat.read(source.with_suffix(".ipynb"), as_version=4)):
            for output in cell.outputs:
                text = output.get("data", {}).get("text/markdown", "")
                if found := re.match(r"> \*\*(C\d): (.*?)\.\*\*", text):
                    verdicts.setdefault(found[1], set()).add(found[2])
                    if limits := re.findall(r"\d[\d,.]*", text[found.end() :]):
                        # a lesson may leave them out
                        numbers.setdefault(found[1], set()).add(tuple(limits))
    assert len(verdicts) == 9
    assert all(len(each) == 1 for each in (*verdicts.values(), *numbers.values()))


def test_every_figure_and_every_claim_of_the_paper_is_taught():
    everything = "\n".join(code for source in SOURCES for code in code_of(source))
    names = [*FIGURES, *(claim.id for claim in CLAIMS)]
    assert [name for name in names if f'"{name}"' not in everything] == []


@each_lesson
def test_pictures_that_the_prose_shows_are_there(source):
    text = "\n".join(cell.source for cell in build.read(source).cells)
    names = re.findall(r"!\[[^]]+\]\((.*?)\)", text)
    assert [name for name in names if not (build.FOLDER / name).is_file()] == []


@each_lesson
def test_a_notebook_names_no_folder_of_the_machine_that_executed_it(source):
    text = re.sub(
        r'"image/png": ".*?"', "", source.with_suffix(".ipynb").read_text(encoding="utf-8")
    )
    assert [name for name in (str(ROOT), "/tmp/", "/home/", "/root/") if name in text] == []
