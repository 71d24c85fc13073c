"""What lessons share: published results, budgets, answers and sliders."""

import ipywidgets
import numpy as np
import pytest

from notebooks import lesson_tools as lesson


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


def test_a_notebook_that_is_executed_to_be_read_holds_pictures_instead(displayed, monkeypatch):
    monkeypatch.setenv(lesson.STATIC, "1")
    drawn = []
    lesson.slider(drawn.append, "width", range(1, 8, 2), shown=(5, 1), unit="samples")
    assert drawn == [5, 1]
    assert [thing.data for thing in displayed] == [
        "*In Jupyter, this cell has a slider for the width (samples). Stored here: 5, 1.*"
    ]


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
