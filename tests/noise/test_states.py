"""Noise models are made again from what is saved of them, and what describes no noise is refused."""

import json

import numpy as np
import pytest

from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork
from enhsim_tf.noise.ladder import RUNGS, FitTask, generate, generate_series
from enhsim_tf.noise.selection import Selection, window_statistics
from enhsim_tf.noise.states import NoiseState, model_from, state_of

WINDOWS = np.random.default_rng(0).standard_normal((30, 40)).astype(np.float32)
CLEAN = np.sin(np.arange(40) / 5).astype(np.float32) * np.ones((30, 1), np.float32)


@pytest.mark.parametrize("rung", RUNGS)
def test_a_saved_noise_model_generates_the_same_noise(rung):
    model = RUNGS[rung](FitTask(WINDOWS, CLEAN, 2, 5, starts=10 * np.arange(30)))
    state = state_of(model)
    assert state.is_finite and bool(state.networks) != bool(state.arrays)
    again = model_from(json.loads(json.dumps(dict(state.settings))), state.networks, state.arrays)
    assert type(again) is type(model)
    np.testing.assert_array_equal(generate(again, 6, 1, CLEAN[:6]), generate(model, 6, 1, CLEAN[:6]))
    np.testing.assert_array_equal(generate_series(again, 90, 1, np.zeros(90)), generate_series(model, 90, 1, np.zeros(90)))


@pytest.mark.parametrize("rung", ["residual windows", "matched residual windows", "autoregressive network"])
def test_real_noise_is_drawn_sparingly_also_from_saved_models(rung):
    """Windows that begin every ten samples: of four windows of forty samples, or pasts of twenty, none need overlap."""
    values = np.random.default_rng(2).standard_normal(330).astype(np.float32)
    windows = np.stack([values[begin : begin + 40] for begin in 10 * np.arange(30)])
    state = state_of(RUNGS[rung](FitTask(windows, CLEAN, 2, 5, starts=10 * np.arange(30))))
    model = model_from(state.settings, state.networks, state.arrays)
    real = model.pasts if rung == "autoregressive network" else model
    for seed in range(20):
        drawn = generate(real, 4, seed, CLEAN[:4, : real.windows.shape[1]])
        rows = [np.flatnonzero((real.windows == each).all(axis=1))[0] for each in drawn]
        assert np.diff(np.sort(rows)).min() * 10 >= real.windows.shape[1]


def test_models_saved_under_the_old_name_are_read():
    model = model_from({"kind": "resampled"}, {}, {"windows": WINDOWS})
    np.testing.assert_array_equal(model.windows, WINDOWS)


def test_a_network_saved_without_predictions_draws_the_same_noise():
    network = AutoregressiveNetwork(40, 1.0, num_rare=2, sees_predictions=False, sees_changes=False, seed=4).fit(WINDOWS, 5)
    state = state_of(network)
    settings = {name: value for name, value in state.settings.items() if name not in ("sees_predictions", "sees_changes", "num_rare")}
    assert all(name.startswith("weight_") for name in state.arrays)
    np.testing.assert_array_equal(model_from(settings, {}, state.arrays).generate(3, 1), network.generate(3, 1))


def test_a_network_saved_without_changes_draws_the_same_noise():
    network = AutoregressiveNetwork.untrained(WINDOWS, seed=4)
    before = AutoregressiveNetwork(**network.get_config() | {"sees_changes": False}).fit(WINDOWS, 5)
    state = state_of(before)
    settings = {name: value for name, value in state.settings.items() if name != "sees_changes"}
    assert sum(name.startswith("weight_") for name in state.arrays) == len(network.network.get_weights()) - 2, "inputs are not standardised"
    np.testing.assert_array_equal(model_from(settings, {}, state.arrays).generate(3, 1), before.generate(3, 1))


def test_a_network_that_selects_windows_is_saved():
    noise = np.random.default_rng(0).standard_normal((30, 64)).astype(np.float32)
    network = AutoregressiveNetwork.untrained(noise, seed=4).fit(noise, 5)
    size, rng = window_statistics(noise).shape[1], np.random.default_rng(1)
    network.selection = Selection(rng.normal(size=size), np.ones(size), rng.normal(size=2 * size))
    state = state_of(network)
    again = model_from(state.settings, {}, state.arrays)
    np.testing.assert_array_equal(again.generate(3, 1), network.generate(3, 1))
    np.testing.assert_array_equal(again.generate_series(150, 1), network.generate_series(150, 1))
    assert (again.generate_series(150, 1)[:100] == network.generate_series(100, 1)).all(), "the last window is completed"
    with pytest.raises(ValueError, match="a selection"):
        model_from(state.settings, {}, state.arrays | {"selection_spread": np.zeros(size)})


def test_a_network_with_a_past_of_a_whole_window_is_refused():
    state = state_of(AutoregressiveNetwork.untrained(WINDOWS, seed=4).fit(WINDOWS, 2))
    assert state.arrays["past_windows"].shape == (30, 20)
    with pytest.raises(ValueError, match="past of a window or more"):
        model_from(state.settings, {}, state.arrays | {"past_windows": np.zeros((30, 40), np.float32)})


def test_a_network_saved_with_degrees_of_freedom_under_a_softplus_draws_the_same_noise():
    network = AutoregressiveNetwork.untrained(WINDOWS, seed=4).fit(WINDOWS, 5)
    state = state_of(network)
    settings = {name: value for name, value in state.settings.items() if name != "tails"}
    (place,) = [name for name, weight in state.arrays.items() if weight.shape == (network.num_components,)]
    degrees = np.exp(
        10 * state.arrays[place].astype(np.float64)
    )  # above the least; the inverse of a softplus gives the weights of that time
    before = np.where(degrees > 30, degrees, np.log(np.expm1(np.minimum(degrees, 30)))).astype(np.float32)
    again = model_from(settings, {}, dict(state.arrays) | {place: before})
    np.testing.assert_allclose(again.generate(50, 1), network.generate(50, 1), rtol=1e-3, atol=1e-5)
    with pytest.raises(ValueError, match="unknown tails 'cauchy'"):
        model_from(dict(state.settings) | {"tails": "cauchy"}, {}, state.arrays)


def test_the_levels_of_quantised_noise_are_saved():
    noise = 0.1 + 0.25 * np.rint(WINDOWS / 0.25)
    state = state_of(AutoregressiveNetwork.untrained(noise).fit(noise, 2))
    levels = (model_from(state.settings, {}, state.arrays).generate(5, 1) - 0.1) / 0.25
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-4)


@pytest.mark.parametrize(
    ("settings", "arrays", "words"),
    [
        ({"kind": "pink"}, {}, "unknown noise"),
        ({"kind": "residual windows"}, {"windows": np.full((3, 9), np.nan)}, "not finite"),
        ({"kind": "autoregression", "window": 9, "innovation_sd": -1.0}, {"coefficients": np.zeros(1)}, "scale"),
        ({"kind": "autoregressive network", "window": 9, "scale": 0.0}, {}, "scale"),
        (
            {"kind": "autoregressive network", "window": 9, "scale": 1.0, "num_components": 10**6, "units": 10**6},
            {},
            "impossible size",
        ),
    ],
)
def test_what_describes_no_noise_is_refused(settings, arrays, words):
    with pytest.raises(ValueError, match=words):
        model_from(settings, {}, arrays)


def test_numbers_that_are_not_finite_are_found():
    network = AutoregressiveNetwork.untrained(WINDOWS)
    state = state_of(network)
    assert state.is_finite
    assert not NoiseState(state.settings, {}, state.arrays | {"weight_00": np.full(3, np.inf)}).is_finite
    assert not NoiseState(dict(state.settings) | {"scale": float("nan")}, {}, state.arrays).is_finite
    with pytest.raises(TypeError, match="noise model of the ladder"):
        state_of("noise")
