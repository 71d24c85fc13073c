import numpy as np
import pytest

from studies.reference_or_source.autoregression import Autoregression, choose, held_out_errors
from studies.reference_or_source.inputs import columns_of, inputs_of, regressions


def test_commands_sums_and_clock_begin_anew_with_each_unit():
    commands = np.array([1.0, 2.0, 3.0, 4.0])[:, None]
    columns = inputs_of(commands, 2, window=2)
    assert columns[:, :3].tolist() == [[0, 1, 0.5], [0.5, 2, 1.5], [0, 3, 1.5], [0.5, 4, 3.5]]
    assert inputs_of(commands, None, window=2)[:, 2].tolist() == [0.5, 1.5, 3.0, 5.0]


def test_a_running_average_answers_a_step_as_its_closed_form():
    window, step = 20, np.repeat([0.0, 1.0], [1, 300])[:, None]
    columns = inputs_of(step, None, window)
    number = columns_of(columns.shape[1])
    averages = columns[:, number["plain"] : number["averages"] : 2]
    for values, constant in zip(averages.T, (0.1, 0.5, 2.0, 5.0), strict=True):
        assert values == pytest.approx(1 - np.exp(-np.arange(301) / (constant * window)))
    assert number == {"plain": 3, "averages": 11, "all": 15}


def test_a_regression_on_commands_finds_a_quadratic_law():
    rng = np.random.default_rng(0)
    inputs = inputs_of(rng.standard_normal((400, 1)), 40, window=10)
    inputs = inputs.reshape(40, 10, -1)
    telemetry = 1 + inputs[:, :, 1:2] * inputs[:, :, 2:3]
    starts = np.arange(40) * 10
    fit = regressions(inputs.shape[2])["quadratic, penalty 1"]
    predicted = fit(inputs[:30], telemetry[:30], starts[:30])(inputs[30:])
    assert predicted == pytest.approx(telemetry[30:], abs=0.1)


def process(number, rng):
    """Two channels of a first-order process that an input drives, with small noise."""
    inputs = rng.standard_normal((number, 60, 1))
    values = np.zeros((number, 60, 2))
    values[:, 0] = rng.standard_normal((number, 2))
    for place in range(1, 60):
        values[:, place] = values[:, place - 1] @ [[0.8, 0.1], [0.0, 0.5]]
        values[:, place] += inputs[:, place] * [1.0, -1.0]
        values[:, place] += 0.01 * rng.standard_normal((number, 2))
    return values, inputs


def test_the_autoregression_recovers_a_known_process():
    values, inputs = process(60, np.random.default_rng(0))
    model = Autoregression(1, 1e-4).fit(values, inputs)
    errors = model.errors(values, inputs)
    assert errors.shape == (60, 59, 2)
    assert 0.009 < errors.std() < 0.0105


def test_order_and_penalty_are_chosen_on_folds_that_were_not_learnt():
    values, inputs = process(60, np.random.default_rng(0))
    folds = np.arange(60) % 3
    model = choose(values, inputs, folds)
    errors = held_out_errors(model, values, inputs, folds)
    assert errors[:, -30:].std() == pytest.approx(0.01, rel=0.05)
