"""Tests of the notebooks: they run at smoke budget in real kernels, follow the required form, and are never stale."""

import ast
import base64
import io
import re
import shutil
from pathlib import Path

import nbformat
import numpy as np
import pytest
from jupyter_client.manager import KernelManager
from PIL import Image

from enhsim_tf.common import figure, lesson
from enhsim_tf.reproduce.paper.claims import CLAIMS
from enhsim_tf.reproduce.paper.figures import FIGURES
from notebooks import build
from notebooks import notebook as teaching
from studies.few_windows import figures as curve_figures
from studies.robustness import figures as robustness_figures
from studies.spacecraft import figure as labelled_figures

ROOT = Path(__file__).parents[2]
SOURCES = build.sources()
NAMES = """00_tour 01_pipeline 02_source_target 03_enhancer 04_enhanced_simulation 05_real_or_generated 08_source_noise 09_generator
    10_discriminator 11_gan_training 12_accuracy_loss 13_combined 20_the_frozen_discriminator 21_is_it_real_enough
    22_false_alarms 23_degraded_modes 24_real_telemetry 25_second_generator 26_strong_baselines 27_own_simulator
    28_how_little_telemetry""".split()
OWN_PICTURES = ("25", "26", "27")  # lessons that show pictures of their own only
each_notebook = pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.stem)


def code_of(source):
    return [cell.source for cell in build.read(source).cells if cell.cell_type == "code"]


def trees_of(source):
    return [ast.parse(code) for code in code_of(source)]


# -- executed ----------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cache(smoke_run):
    """One cache for all kernels, in which every stage is computed once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ENHSIM_TF_CACHE", str(smoke_run.cache))
        experiment = teaching.open_experiment("smoke")
        experiment.verbose = 0
        assert teaching.prepare(experiment) == []
    return smoke_run.cache


def test_no_notebook_is_lost():
    assert [source.stem for source in SOURCES] == NAMES


@pytest.fixture(scope="module")
def kernel():
    """One kernel for all notebooks, since importing takes longer than computing."""
    kernel = KernelManager(kernel_name="python3")
    yield kernel
    kernel.shutdown_kernel(now=True)


@each_notebook
def test_it_runs_and_its_solutions_are_right(source, kernel, cache):
    notebook = build.execute(source, "smoke", cache, kernel, solved=True)
    starters, solved = ([] for _ in range(2))
    for cell in notebook.cells:
        if cell.cell_type == "code" and build.CHECK in cell.source:
            (said,) = (output.text.strip() for output in cell.outputs)
            (solved if cell.metadata.get("solved") else starters).append(said)
    assert (set(starters), set(solved)) in (({lesson.NOT_ANSWERED}, {lesson.RIGHT}), (set(), set()))
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    printed = [output for output in outputs if output.output_type == "stream"]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert [output.text for output in printed if output.name == "stderr"] == []
    assert printed[0].text.startswith("Smoke budget, seed 0. Everything is ready.")
    assert pictures
    for picture in pictures:
        assert len(picture.metadata["image/png"]["alt"]) > 20
    words = nbformat.writes(notebook)
    for path in (str(ROOT), str(Path.home()), str(cache), "/tmp/"):
        assert path not in re.sub(r'"image/png": ".*?"', "", words)
    assert notebook.metadata["enhsim_tf"]["budget"] == "smoke"


def test_a_notebook_finds_no_name_of_an_earlier_one_in_a_shared_kernel(kernel, tmp_path):
    for number, code in enumerate(("import math\nearlier = math.pi", "for name in ('earlier', 'math'):\n    assert name not in globals()")):
        (tmp_path / f"9{number}_x.py").write_text(f"# %%\n{code}\n", encoding="utf-8")
        build.execute(tmp_path / f"9{number}_x.py", "smoke", tmp_path, kernel)


# -- held to their form ------------------------------------------------------------------------------------------------------


@each_notebook
def test_it_shows_figures_says_what_to_see_and_asserts_it(source):
    trees, cells = trees_of(source), build.read(source).cells
    calls = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)]
    shown, found = ([node.args[1].value for node in calls if called(node) == name] for name in ("show", "show_finding"))
    assert (
        (shown + found or source.stem[:2] in OWN_PICTURES)
        and set(shown) <= set(FIGURES)
        and set(found) <= {*robustness_figures.FIGURES, *labelled_figures.FIGURES, *curve_figures.FIGURES}
    )
    number = source.stem[:2]
    assert number[0] == "2" or number == "00" or any(name.startswith(f"fig{number}_") for name in shown)
    asserts = [any(isinstance(node, ast.Assert) for node in ast.walk(tree)) for tree in trees]
    assert sum(asserts) >= len([cell for cell in cells if "*What to see:*" in cell.source]) >= 1


@each_notebook
def test_each_what_to_see_note_is_followed_by_assertions(source):
    cells = build.read(source).cells
    for number, cell in enumerate(cells):
        if "*What to see:*" in cell.source:
            following = [cell.source for cell in cells[number + 1 : number + 3] if cell.cell_type == "code"]
            assert any("assert " in code for code in following), cell.source


@each_notebook
def test_exercises_come_with_a_folded_solution_at_the_end(source):
    cells = build.read(source).cells
    solution = next(number for number, cell in enumerate(cells) if cell.source.startswith("## Solution"))
    assert any("## Exercises\n" in cell.source for cell in cells[:solution])
    assert any("<details>" in cell.source for cell in cells[solution:])


@each_notebook
def test_a_lesson_checks_the_students_answers_and_folds_its_solutions_away(source):
    cells = build.read(source).cells
    checks = [number for number, cell in enumerate(cells) if cell.cell_type == "code" and build.CHECK in cell.source]
    solution = next(number for number, cell in enumerate(cells) if cell.source.startswith("## Solution"))
    assert len(checks) >= 2 and checks[-1] < solution
    assert all(cell.cell_type == "markdown" for cell in cells[solution:])
    build.solve(build.read(source))  # raises if a check has no solution


@each_notebook
def test_a_lesson_begins_with_its_question_and_what_it_needs(source):
    first = build.read(source).cells[0].source
    wanted = ("**Question:**", "**After this lesson**", "**You should know**", "**Running time:**", "**Terms:**")
    assert [words for words in wanted if first.count(words) != 1] == []
    assert f'lesson="{source.stem[:2]}"' in "".join(code_of(source))


def test_a_check_without_a_solution_is_refused():
    code = "check_answer(None, bool, '')"
    cells = [nbformat.v4.new_code_cell(code), nbformat.v4.new_markdown_cell("<details>\n\n```text\nx\n```\n\n</details>")]
    with pytest.raises(ValueError, match="0 for 1"):
        build.solve(nbformat.v4.new_notebook(cells=cells))


def test_a_solution_is_run_after_the_check_that_it_belongs_to():
    texts = ["check_answer(a, bool, '')", "b = None", "check_answer(b, bool, '')"]
    folded = nbformat.v4.new_markdown_cell("<details>\n\n```python\na = 1\n```\n\n```python\nb = 2\n```\n\n</details>")
    notebook = nbformat.v4.new_notebook(cells=[*map(nbformat.v4.new_code_cell, texts), folded])
    build.solve(notebook)
    solved = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    assert solved == [texts[0], "a = 1\n", texts[0], "b = None", texts[2], "b = 2\n", texts[2]]


@pytest.mark.parametrize("number", ["01", "02", "03", "04", "08", "09", "10", "11", "12", "13", "21", "22", "23", "24", "25", "26", "28"])
def test_the_mechanism_that_a_lesson_writes_out_is_compared_with_the_package(number):
    (source,) = (source for source in SOURCES if source.stem.startswith(number))
    assert "np.testing.assert_" in "".join(code_of(source))


def test_pictures_that_the_prose_shows_are_there_and_small():
    shown = [
        name for source in SOURCES for cell in build.read(source).cells for name in re.findall(r"!\[[^]]{20,}\]\((.*?)\)", cell.source)
    ]
    assert shown == ["../figures/noise_forming.gif"]
    assert 0 < (ROOT / "notebooks" / shown[0]).stat().st_size < build.MAX_BYTES


@each_notebook
def test_numbers_that_were_measured_are_not_typed(source):
    """Numbers in the prose are the paper's, settings or closed forms; a number with three decimals would be a measurement."""
    prose = "\n".join(cell.source for cell in build.read(source).cells if cell.cell_type == "markdown")
    assert re.findall(r"\d\.\d{3,}(?!\d*\])", re.sub(r"arXiv 2008\.12082|0\.001|2008\.12082", "", prose)) == []


def called(node):
    return node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")


def test_every_figure_of_the_paper_has_its_notebook():
    everything = "\n".join(code for source in SOURCES for code in code_of(source))
    assert [name for name in FIGURES if name not in everything and FIGURES[name].number < 14] == []  # the paper commented out number 14


def test_every_claim_is_taught():
    everything = "\n".join(code for source in SOURCES for code in code_of(source))
    assert [claim.id for claim in CLAIMS if f'"{claim.id}"' not in everything] == []


# -- never stale -------------------------------------------------------------------------------------------------------------


@each_notebook
def test_the_notebook_is_its_source_executed_at_full_budget(source):
    assert build.faults(source) == []


@pytest.fixture
def tiny(tmp_path):
    """A small source with the notebook that an execution at full budget would produce, and functions to change them."""
    source = tmp_path / "99_tiny.py"
    source.write_text("# %% [markdown]\n# # Tiny\n\n# %%\nprint(1)\n", encoding="utf-8")
    notebook = build.read(source)
    notebook.cells[1].execution_count = 1
    notebook.metadata["enhsim_tf"] = {"source": source.name, "sha256": build.sha256(source), "budget": "full"}
    nbformat.write(notebook, source.with_suffix(".ipynb"))
    assert build.faults(source) == []
    return source


def rewrite(source, change):
    path = source.with_suffix(".ipynb")
    notebook = nbformat.read(path, as_version=4)
    change(notebook)
    nbformat.write(notebook, path)


def test_a_missing_notebook_is_found(tiny):
    tiny.with_suffix(".ipynb").unlink()
    assert build.faults(tiny) == ["not there"]


def test_a_changed_source_is_found(tiny):
    tiny.write_text(tiny.read_text(encoding="utf-8").replace("print(1)", "print(2)"), encoding="utf-8")
    assert build.faults(tiny) == ["stale: its source has changed"]


def test_an_edited_notebook_is_found(tiny):
    rewrite(tiny, lambda notebook: notebook.cells[1].update(source="print(2)"))
    assert build.faults(tiny) == ["stale: its source has changed"]


def test_new_prose_is_taken_and_new_code_is_not(tiny):
    rewrite(tiny, lambda notebook: notebook.cells[1].update(outputs=[nbformat.v4.new_output("stream", text="1\n")]))
    assert not build.take_prose(tiny)
    tiny.write_text(tiny.read_text(encoding="utf-8").replace("# # Tiny", "# # Small"), encoding="utf-8")
    assert build.faults(tiny) == ["stale: its source has changed"]
    assert build.take_prose(tiny) and build.faults(tiny) == []
    taken = nbformat.read(tiny.with_suffix(".ipynb"), as_version=4)
    assert taken.cells[0].source == "# Small" and taken.cells[1].outputs[0].text == "1\n"
    tiny.write_text(tiny.read_text(encoding="utf-8").replace("print(1)", "print(2)"), encoding="utf-8")
    kept = tiny.with_suffix(".ipynb").read_bytes()
    with pytest.raises(ValueError, match="execute it"):
        build.take_prose(tiny)
    assert tiny.with_suffix(".ipynb").read_bytes() == kept


def test_findings_that_changed_since_are_found(tiny, tmp_path):
    figures = tmp_path / "figures"
    for name in ("robustness", "labelled"):
        (figures / name).mkdir(parents=True)
        (figures / name / "findings.json").write_text("{}", encoding="utf-8")
    tiny.write_text("# %%\nfound, tables = open_findings()\n", encoding="utf-8")
    before = build.findings(tiny, figures)
    assert list(before) == ["robustness"]
    (figures / "labelled" / "findings.json").write_text("[]", encoding="utf-8")
    assert build.findings(tiny, figures) == before
    (figures / "robustness" / "findings.json").write_text("[]", encoding="utf-8")
    assert build.findings(tiny, figures) != before
    tiny.write_text("# %%\nrows = open_residual()\n", encoding="utf-8")
    (figures / "labelled" / "residual.csv").write_text("seed\n", encoding="utf-8")
    assert list(before := build.findings(tiny, figures)) == ["labelled/residual.csv"]
    (figures / "labelled" / "residual.csv").write_text("seed\n0\n", encoding="utf-8")
    assert build.findings(tiny, figures) != before


def test_a_notebook_of_other_findings_is_stale(tiny):
    rewrite(tiny, lambda notebook: notebook.metadata["enhsim_tf"].update(findings={"robustness": "0" * 64}))
    assert build.faults(tiny) == ["stale: the findings that it shows have changed"]


def test_a_notebook_that_was_not_executed_is_found(tiny):
    rewrite(tiny, lambda notebook: notebook.cells[1].update(execution_count=None))
    assert build.faults(tiny) == ["not executed from first to last cell"]


def test_a_smoke_notebook_is_found(tiny):
    rewrite(tiny, lambda notebook: notebook.metadata["enhsim_tf"].update(budget="smoke"))
    assert build.faults(tiny) == ["executed at smoke budget"]


def test_a_heavy_notebook_is_found(tiny):
    rewrite(tiny, lambda notebook: notebook.metadata.update(ballast="x" * build.MAX_BYTES))
    assert len(build.faults(tiny)) == 1 and "bytes" in build.faults(tiny)[0]


def test_the_check_reports_stale_and_missing_notebooks_and_exits_with_1(tiny, monkeypatch, capsys):
    monkeypatch.setattr(build, "FOLDER", tiny.parent)
    assert build.main(["--check"]) == 0
    shutil.copy(tiny.with_suffix(".ipynb"), tiny.parent / "98_lost.ipynb")
    assert build.main(["--check"]) == 1
    assert re.search(r"99_tiny +current", out := capsys.readouterr().out) and re.search(r"98_lost +it has no source", out)


def test_an_unknown_notebook_is_refused(capsys):
    assert build.main(["--only", "77"]) == 2
    assert "Received: '77'" in capsys.readouterr().err


# -- what they share ---------------------------------------------------------------------------------------------------------


def test_missing_stages_are_listed_first_and_nothing_is_computed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path))
    monkeypatch.setattr(teaching, "_ROOT", tmp_path / "elsewhere")
    teaching.open_experiment("smoke")
    said = capsys.readouterr().out
    for stage in ("telemetry", "enhancer", "noise GAN", "enhancement", "speed", "false alarms", "resemblance", "degraded"):
        assert f"{stage} (seconds)" in said
    assert list(tmp_path.glob("*")) == []


def test_every_stage_of_the_experiment_is_prepared():
    source = (ROOT / "enhsim_tf" / "reproduce" / "paper" / "pipeline.py").read_text(encoding="utf-8")
    assert set(re.findall(r'(?:stages\.run|self\._measure)\("([^"]+)"', source)) == set(teaching._STAGES)


def test_the_expected_time_is_what_it_took_where_the_figures_were_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(teaching, "_ROOT", tmp_path)
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "results.json").write_text('{"budget": "full", "timings": {"enhancer": 65.4}}', encoding="utf-8")
    teaching.open_experiment("full")
    assert "enhancer (about 65 s)" in (said := capsys.readouterr().out) and "noise GAN (minutes)" in said
    teaching.open_experiment("smoke")
    assert "enhancer (seconds)" in capsys.readouterr().out


def test_the_time_of_a_lesson_is_what_it_took_when_it_was_built(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(teaching, "_ROOT", tmp_path)
    monkeypatch.setattr(build, "FOLDER", tmp_path / "notebooks")
    teaching.open_experiment("smoke", lesson="04")
    assert "lesson" not in capsys.readouterr().out
    (tmp_path / "notebooks").mkdir()
    for budget, seconds in (("smoke", 4.4), ("full", 31.6)):
        build.keep_time(tmp_path / "04_tiny.py", budget, seconds)
    teaching.open_experiment("smoke", lesson="04")
    assert "this lesson took 32 s at full budget and 4 s at smoke budget" in capsys.readouterr().out


def test_the_budget_comes_from_the_environment(tmp_path, monkeypatch, refused):
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path))
    monkeypatch.setenv("ENHSIM_TF_BUDGET", "smoke")
    assert teaching.open_experiment().settings.budget == "smoke"
    monkeypatch.setenv("ENHSIM_TF_BUDGET", "endless")
    with refused("endless", "ENHSIM_TF_BUDGET"):
        teaching.open_experiment()


def test_a_shown_figure_is_the_one_of_the_command(cache, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(cache))
    monkeypatch.setattr(teaching, "display", lambda data, **options: shown.append((data, options)))
    experiment, name = teaching.open_experiment("smoke"), "fig02_source_target"
    arrays = teaching.show(experiment, name)
    caption = "seed 0 · smoke budget · python -m enhsim_tf.reproduce --budget smoke --only fig02"
    (path,) = figure.save(name, arrays, tmp_path, caption, True, ("png",), figures=FIGURES)
    ((data, options),) = shown
    seen, kept = (np.asarray(Image.open(where).convert("RGB"), float) for where in (io.BytesIO(data["image/png"]), path))
    assert seen.shape == kept.shape and np.abs(seen - kept).mean() < 1  # of 255: error of the colour palette
    assert options["metadata"]["image/png"]["alt"] == FIGURES[name].alt
    assert len(base64.b64encode(data["image/png"])) < 300_000


def test_claims_are_the_ledgers(monkeypatch):
    shown = []
    monkeypatch.setattr(teaching, "display", lambda markdown: shown.append(markdown.data))
    teaching.claim("C6", "C1")
    sentences = {claim.id: claim.sentence for claim in CLAIMS}
    assert [sentences[id] in text for id, text in zip(("C6", "C1"), shown, strict=True)] == [True, True]
    with pytest.raises(KeyError):
        teaching.claim("C99")
