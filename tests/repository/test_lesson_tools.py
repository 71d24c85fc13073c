"""What lessons share: published results, budgets, answers and sliders."""

import base64
import sys
from pathlib import Path

import ipywidgets
import numpy as np
import pytest

from notebooks import lesson_tools as lesson

sys.path.insert(0, str(Path(__file__).parent))
import chromium


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (None, "Not yet answered."),
        (4, "Right."),
        (5, "Not yet. Count again."),
        (np.array([4]), "Right."),
        ("four", "Not yet. The check cannot use this answer: "),
    ],
)
def test_an_answer_is_missing_right_or_wrong(answer, said, capsys):
    lesson.check_answer(answer, lambda number: abs(number - 4) < 1e-9, "Count again.")
    assert capsys.readouterr().out.startswith(said)


def test_an_error_of_the_check_itself_is_not_hidden():
    with pytest.raises(ZeroDivisionError):
        lesson.check_answer(4, lambda number: 1 / 0, "")


@pytest.fixture
def displayed(monkeypatch):
    shown = []
    monkeypatch.setattr(lesson, "display", lambda *things: shown.extend(things))
    return shown


def test_a_slider_draws_its_first_value_and_every_value_that_is_chosen(displayed, monkeypatch):
    monkeypatch.delenv(lesson.STATIC, raising=False)
    drawn = []
    lesson.slider(drawn.append, "width", range(1, 8, 2), shown=(5, 1), unit="samples")
    control, output = displayed
    assert isinstance(control, ipywidgets.SelectionSlider) and isinstance(output, ipywidgets.Output)
    assert control.options == (1, 3, 5, 7) and control.description == "width (samples)"
    assert drawn == [5]
    control.value = 3
    assert drawn == [5, 3]


@pytest.fixture
def framed(monkeypatch):
    """What a slider displays in a lesson that is executed to be read, and the values it drew."""
    monkeypatch.setenv(lesson.STATIC, "1")
    shown, drawn = [], []
    monkeypatch.setattr(lesson, "display", lambda data, **about: shown.append(data))

    def draw(value):
        drawn.append(value)
        with lesson.drawing(f"picture of {value}", height=0.5) as panel:
            panel.plot([0, value])

    lesson.slider(draw, "width", range(1, 42, 2), shown=(5, 3), unit="samples")
    return shown, drawn


def test_a_lesson_to_be_read_holds_frames_of_few_values_and_all_that_are_shown(framed):
    _, drawn = framed
    assert drawn == sorted({*range(1, 42, 6), 3, 5})


def test_frames_are_one_output_that_starts_with_the_first_value_to_be_shown(framed):
    (data,), drawn = framed
    assert data["text/html"].count(base64.b64encode(data["image/png"]).decode()) == 2
    assert f'value="{drawn.index(5)}"' in data["text/html"] and "picture of 5" in data["text/html"]


@pytest.mark.slow
@pytest.mark.skipif(chromium.PROGRAM is None, reason="there is no Chromium")
def test_a_key_changes_the_frame_without_a_kernel(framed, tmp_path):
    (tmp_path / "page.html").write_text(framed[0][0]["text/html"])
    with chromium.browser(tmp_path / "profile") as page:
        page.open((tmp_path / "page.html").as_uri())
        before = page.evaluate("document.querySelector('img').src")
        page.evaluate("document.querySelector('input').focus()")
        page.press("ArrowRight")
        assert page.evaluate("document.querySelector('output').textContent") == "7"
        assert page.evaluate("document.querySelector('img').src") != before


def test_a_study_is_opened_by_its_name():
    found, tables = lesson.open_study("robustness")
    assert found["num_replicates"] == tables["alarms"].groupby(["environment", "seed"]).ngroups


def test_an_unknown_study_is_refused(refused):
    with refused("robustnes", "robustness"):
        lesson.open_study("robustnes")


def test_the_budget_comes_from_the_environment(tmp_path, monkeypatch, refused):
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path))
    monkeypatch.setenv(lesson.BUDGET, lesson.SMOKE)
    pipeline, budget = lesson.open_pipeline()
    assert (budget, pipeline.settings.epochs) == (lesson.SMOKE, 2)
    monkeypatch.setenv(lesson.BUDGET, "endless")
    with refused("endless", lesson.BUDGET):
        lesson.open_pipeline()


@pytest.mark.parametrize(
    "name", [name for name in lesson.FIGURES if name not in lesson.DRAWN_BY_HAND]
)
def test_the_code_of_a_figure_defines_the_function_that_draws_it(name):
    code = lesson._code_of(name).partition("```python\n")[2].partition("```")[0]
    *definition, call = code.strip().splitlines()
    names = {}
    exec("\n".join(definition), names)
    function = lesson.FIGURES[name].drawn_by
    assert call == f"{function.__name__}(pipeline)"
    assert names[function.__name__].__code__.co_names == function.__code__.co_names


def test_figures_drawn_by_hand_have_no_code_to_show():
    assert all(lesson.FIGURES[name].drawn_by(None) is None for name in lesson.DRAWN_BY_HAND)
