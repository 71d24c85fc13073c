"""Exercises with a student's numbers: answers against independent computations, and checks."""

import contextlib
import io

import nbformat
import numpy as np
import pytest

from notebooks import exercises

NUMBERS = {exercise.title: number for number, exercise in enumerate(exercises.EXERCISES)}


def pendulum(height):
    """The NRMSE of a square wave, from samples."""
    sine = np.sin(2 * np.pi * (np.arange(20_000) + 0.5) / 20_000)
    return np.sqrt(np.mean((height * np.sign(sine) - sine) ** 2)) / sine.std()


def parameters(window, first, second):
    from enhsim_tf.common.backend import keras

    layers = [keras.layers.Dense(units) for units in (first, second, window)]
    return keras.Sequential([keras.Input((window,)), *layers]).count_params()


def ridge(x, y, penalty):
    from sklearn.linear_model import Ridge

    return Ridge(penalty, fit_intercept=False).fit(np.reshape(x, (-1, 1)), y).coef_[0]


def luck(number, percent):
    from scipy.stats import binom

    return int(binom.isf(percent / 100, number, 0.5)) + 1


def filtered(width, period):
    import pandas as pd

    wave = pd.Series(np.sin(2 * np.pi * np.arange(50 * period) / period))
    return np.nanstd(wave - wave.rolling(width, center=True).mean()) / np.std(wave)


def rank(shares):
    from enhsim_tf.common.measures import effective_rank

    sides = np.sqrt(np.array(shares))  # points at both ends of each axis
    return effective_rank(np.concatenate([np.diag(sides), -np.diag(sides)]))


def places(width, window, stride):
    return np.lib.stride_tricks.sliding_window_view(np.zeros(window), width)[::stride].shape[0]


def generator_loss(seen):
    from enhsim_tf.common.backend import keras

    return float(keras.losses.BinaryCrossentropy()(np.ones((3, 1)), np.reshape(seen, (3, 1))))


def called_real(real, generated):
    rows = np.repeat([1, 1, 0, 0], [real, 100 - real, generated, 100 - generated])
    called = np.repeat([1, 0, 0, 1], [real, 100 - real, generated, 100 - generated])
    return rows[called == 1].mean()


def threshold(scores, percent):
    from enhsim_tf.scoring.metrics import threshold

    return threshold(np.array(scores), percent / 100)


def auc(nominal, anomalous):
    from sklearn.metrics import roc_auc_score

    return roc_auc_score([0] * len(nominal) + [1] * len(anomalous), nominal + anomalous)


def distance(rho, first, second):
    from scipy.spatial.distance import mahalanobis

    inverse = np.linalg.inv([[1, rho], [rho, 1]])
    return mahalanobis([first, second], [0, 0], inverse) ** 2


def alarm(windows, percent):
    from scipy.stats import binom

    return binom.sf(0, windows, percent / 100)


def wrong_size(scale):
    rng = np.random.default_rng(0)
    real, learnt = rng.standard_normal(400_000), scale * rng.standard_normal(400_000)
    return np.mean(real**2) / np.mean(learnt**2)


ORACLES = {
    "A day of alarms": alarm,
    "A square wave for a sine": pendulum,
    "Count the parameters": parameters,
    "Ridge regression by hand": ridge,
    "More than luck": luck,
    "What a moving average calls noise": filtered,
    "Effective rank": rank,
    "Places of a filter": places,
    "The generator's loss": generator_loss,
    "Called real": called_real,
    "A conformal threshold": threshold,
    "Rank by pairs": auc,
    "Noise of the wrong size": wrong_size,
    "Two channels together": distance,
}


@pytest.mark.parametrize("title", NUMBERS)
@pytest.mark.parametrize("seed", range(2))
def test_an_answer_is_that_of_an_independent_computation(title, seed):
    exercise, values = exercises.EXERCISES[NUMBERS[title]], exercises.drawn(seed)[NUMBERS[title]]
    tolerance = 0.02 if title == "Noise of the wrong size" else 0.5 * 10**-exercise.decimals
    assert exercise.answer(**values) == pytest.approx(ORACLES[title](**values), abs=tolerance)


def said_by(notebook, answers):
    """What the checks of a notebook say to answers."""
    names, said = {}, []
    exec(notebook.cells[1].source, names)
    for number, answer in answers.items():
        with contextlib.redirect_stdout(io.StringIO()) as out:
            names["check"](number, answer)
        said.append(out.getvalue().strip())
    return said


@pytest.fixture(scope="module")
def notebook():
    return exercises.as_notebook(3)


def test_right_answers_are_right_and_others_not(notebook):
    values = exercises.drawn(3)
    sought = {
        number: exercise.answer(**values[number - 1])
        for number, exercise in enumerate(exercises.EXERCISES, start=1)
    }
    assert said_by(notebook, sought) == [f"{number}: right." for number in sought]
    wrong = {number: 1.1 * answer + 1 for number, answer in sought.items()}
    assert said_by(notebook, wrong) == [f"{number}: not yet." for number in sought]
    assert said_by(notebook, {1: None}) == ["1: not yet answered."]


def test_an_answer_may_be_off_by_one_in_the_last_place(notebook):
    exact = exercises.EXERCISES[0].answer(**exercises.drawn(3)[0])
    assert said_by(notebook, {1: exact + 0.001}) == ["1: right."]
    assert said_by(notebook, {1: exact + 0.003}) == ["1: not yet."]


def test_the_notebook_holds_no_answer_and_all_values(notebook):
    text = "\n".join(cell.source for cell in notebook.cells)
    for exercise, values in zip(exercises.EXERCISES, exercises.drawn(3), strict=True):
        assert all(str(value) in text for value in values.values())
        if exercise.decimals == 3:
            assert f"{exercise.answer(**values):.3f}" not in text
    assert "{" not in "\n".join(cell.source for cell in notebook.cells[2:]).replace("\\", "")


def test_another_seed_has_other_numbers_and_the_same_seed_the_same():
    assert exercises.drawn(1) == exercises.drawn(1) != exercises.drawn(2)


def test_one_command_writes_the_notebook_and_one_prints_the_answers(tmp_path, capsys):
    out = tmp_path / "mine.ipynb"
    assert exercises.main(["--seed", "7", "--out", str(out)]) == 0
    assert len(nbformat.read(out, as_version=4).cells) == 2 + 2 * len(exercises.EXERCISES)
    capsys.readouterr()
    assert exercises.main(["--seed", "7", "--answers"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(exercises.EXERCISES)
