"""The ladder of enhancers: known processes are recovered by the rung that can express them, and held-out time stays unseen."""

import numpy as np
import pytest
from enhsim_tf.enhancer.ladder import COARSE, LEVEL_AND_GAIN, NETWORK, RIDGE, RIDGE_AND_NETWORK, RUNGS, fit_ladder, fit_rung, judge
from enhsim_tf.enhancer.rung_networks import linear_network, sum_of_networks
from enhsim_tf.enhancer.scaling import Scaling

from enhsim_tf.common.training import dense_stack
from enhsim_tf.enhancer import ladder
from enhsim_tf.enhancer.held_out_blocks import block_edges, split_fold

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
WINDOW = 16
FAST = (COARSE, LEVEL_AND_GAIN, RIDGE)


def series(num_samples=2_400, seed=0, width=9):
    """Two coarse columns: smooth random signals that do not repeat."""
    rng = np.random.default_rng(seed)
    smooth = np.stack([np.convolve(each, np.hanning(width), "same") for each in rng.standard_normal((2, num_samples))], axis=1)
    return smooth / smooth.std(axis=0)


def windows_of(coarse, target, num_windows=400):
    starts = np.linspace(0, len(coarse) - WINDOW, num_windows).astype(int)
    places = starts[:, None] + np.arange(WINDOW)
    return coarse[places], target[places], starts


def noise(number, sd, seed=9):
    return sd * np.random.default_rng(seed).standard_normal(number)


# blocks of time


def test_blocks_cover_the_time_and_are_held_out_in_turn():
    edges = block_edges(100, 1_000, window=50)
    assert edges.tolist() == [100, 250, 400, 550, 700, 850, 1_000]  # 900 samples, three windows of 50 in each block
    starts = np.arange(100, 951)
    held = [split_fold(starts, 50, edges, fold)[1] for fold in range(3)]
    assert sorted({int(starts[row]) for row in held[0]}) == [*range(100, 201), *range(550, 651)]
    assert not set(held[0]) & set(held[1]) and not set(held[1]) & set(held[2])


def test_training_windows_share_no_sample_with_held_out_windows():
    starts = np.random.default_rng(0).integers(0, 900, 300)
    edges = block_edges(0, 950, window=50)
    for fold in range(3):
        learnt, held_out = split_fold(starts, 50, edges, fold)
        samples = {sample for start in starts[held_out] for sample in range(start, start + 50)}
        assert len(learnt) and len(held_out)
        assert not any(start in samples or start + 49 in samples for start in starts[learnt].tolist())


def test_too_little_time_is_refused(refused):
    with refused("windows of 50 samples"):
        block_edges(0, 149, window=50)


# units


def test_scaling_hand_worked():
    inputs = np.array([[[0.0, 5.0], [2.0, 5.0]], [[4.0, 5.0], [6.0, 5.0]]])  # the second column is constant
    scaling = Scaling.fit(inputs, np.array([[10.0, 30.0]]))
    assert scaling.input_centre == (3.0, 5.0) and scaling.input_scale == (pytest.approx(5**0.5), 1.0)
    assert (scaling.target_centre, scaling.target_scale) == (20.0, 10.0)
    rows = scaling.scale_inputs(inputs[:1])
    np.testing.assert_allclose(rows, [[-3 / 5**0.5, 0, -1 / 5**0.5, 0]], rtol=1e-6)
    np.testing.assert_allclose(scaling.unscale_target(scaling.scale_target(np.array([[12.0]]))), [[12.0]])
    assert Scaling.from_config(scaling.get_config()) == scaling


# networks


def test_the_sum_of_two_networks_is_the_sum_of_their_outputs():
    rng = np.random.default_rng(0)
    linear = linear_network(rng.standard_normal((6, 3)), rng.standard_normal(3), "ridge")
    rest = dense_stack(6, (4, 5, 3), 1, "rest")
    rows = rng.standard_normal((7, 6)).astype(np.float32)
    expected = np.asarray(linear(rows)) + 0.25 * np.asarray(rest(rows))
    np.testing.assert_allclose(np.asarray(sum_of_networks(linear, rest, 0.25)(rows)), expected, rtol=1e-5, atol=1e-6)


# rungs


def test_the_coarse_rung_returns_the_most_similar_column_unchanged():
    coarse = series() * [1.0, 3.0] + [5.0, -40.0]
    inputs, targets, starts = windows_of(coarse, coarse[:, 1] + noise(len(coarse), 0.1))
    np.testing.assert_allclose(fit_rung(COARSE, inputs, targets, starts).predict(inputs), inputs[:, :, 1], rtol=1e-4, atol=1e-4)


def test_level_and_gain_are_those_of_least_squares():
    coarse = series()
    target = 7 - 0.5 * coarse[:, 0] + noise(len(coarse), 0.05)
    inputs, targets, starts = windows_of(coarse, target)
    gain, level = np.polyfit(inputs[:, :, 0].ravel(), targets.ravel(), 1)
    np.testing.assert_allclose(fit_rung(LEVEL_AND_GAIN, inputs, targets, starts).predict(inputs), level + gain * inputs[:, :, 0], atol=1e-4)


def test_the_chosen_rung_does_not_depend_on_units():
    coarse = series()
    target = 0.7 * coarse[:, 0] + 0.4 * np.roll(coarse[:, 1], 1) + noise(len(coarse), 0.05)
    one = fit_ladder(*windows_of(coarse, target), FAST)
    other = fit_ladder(*windows_of(coarse * [1e-4, 1e4] + [3.0, 1e5], 1e3 * target - 5e3), FAST)
    assert one.chosen == other.chosen == RIDGE
    assert one.errors[RIDGE] == pytest.approx(other.errors[RIDGE], rel=1e-3)
    assert one.errors[LEVEL_AND_GAIN] == pytest.approx(other.errors[LEVEL_AND_GAIN], rel=1e-3)


# the choice


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        (lambda coarse: coarse[:, 0], COARSE),
        (lambda coarse: 3 + 1.5 * coarse[:, 0], LEVEL_AND_GAIN),
        (lambda coarse: np.convolve(coarse[:, 0], [0.5, 0.3, 0.2], "same") + 0.5 * coarse[:, 1], RIDGE),
    ],
)
def test_the_simplest_sufficient_rung_is_chosen(target, expected):
    coarse = series()
    found = fit_ladder(*windows_of(coarse, target(coarse) + noise(len(coarse), 0.1)), FAST)
    assert found.chosen == expected
    assert list(found.errors) == list(found.standard_errors) == list(FAST)


def bent(coarse):
    return coarse[:, 0] + 0.5 * coarse[:, 0] ** 2


def test_a_network_is_chosen_where_the_map_is_not_linear():
    coarse = series(4_800, width=60)
    target = bent(coarse) + noise(len(coarse), 0.05)
    found = fit_ladder(*windows_of(coarse, target, 1_200), (RIDGE, RIDGE_AND_NETWORK), refit="chosen")
    assert found.chosen == RIDGE_AND_NETWORK and found.errors[RIDGE_AND_NETWORK] < 0.6 * found.errors[RIDGE]


def test_the_papers_network_takes_all_columns_and_learns():
    coarse = series(width=60)
    inputs, targets, starts = windows_of(coarse, coarse[:, 0] + coarse[:, 1])
    found = fit_rung(NETWORK, inputs, targets, starts, epochs=6)
    assert found.network.input_shape == (None, 2 * WINDOW) and found.network.output_shape == (None, WINDOW)
    assert np.sqrt(np.mean((found.predict(inputs) - targets) ** 2)) < 0.4 * targets.std()  # one coarse column alone leaves 0.7


def test_the_comparison_hand_worked():
    first, second = judge({"a": np.array([0.04, 0.06]), "b": np.array([0.01, 0.05])})
    assert first.error == pytest.approx(0.05**0.5) and second.error == pytest.approx(0.03**0.5)
    assert first.standard_error == pytest.approx(0.01 / (2 * 0.05**0.5))  # deviation 0.0141 of two, divided by root 2: 0.01
    assert first.behind == pytest.approx(0.02) and first.behind_standard_error == pytest.approx(0.01)
    assert second.behind == 0 and second.is_within and not first.is_within


def test_held_out_errors_do_not_depend_on_held_out_windows_during_training(monkeypatch):
    seen = []
    monkeypatch.setattr(
        ladder, "fit_rung", lambda name, inputs, targets, starts, *rest: seen.append(starts) or fit_rung(name, inputs, targets, starts)
    )
    coarse = series()
    inputs, targets, starts = windows_of(coarse, coarse[:, 0])
    fit_ladder(inputs, targets, starts, (RIDGE,))
    judging, refitting = seen
    edges = block_edges(0, int(starts.max()) + WINDOW, WINDOW)
    np.testing.assert_array_equal(judging, starts[split_fold(starts, WINDOW, edges, 0)[0]])
    np.testing.assert_array_equal(refitting, starts)


def test_same_seed_same_ladder():
    coarse = series(1_200)
    data = windows_of(coarse, coarse[:, 0] ** 2, 100)
    one, other = (fit_ladder(*data, (RIDGE_AND_NETWORK,), seed=4, epochs=1) for _ in range(2))
    assert one.judged == other.judged
    np.testing.assert_array_equal(one.predict(data[0]), other.predict(data[0]))


def test_only_the_chosen_rung_is_fitted_again_on_request():
    coarse = series()
    found = fit_ladder(*windows_of(coarse, coarse[:, 0]), FAST, refit="chosen")
    assert set(found.rungs) == {found.chosen} and len(found.judged) == 3


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"rungs": ("deep magic",)}, "deep magic"),
        ({"rungs": ()}, "rungs"),
        ({"refit": "none"}, "none"),
        ({"targets": np.full((400, WINDOW), np.nan)}, "NaN"),
        ({"targets": np.zeros((3, WINDOW))}, "(3, 16)"),
        ({"starts": np.zeros(400, int)}, "windows"),
    ],
)
def test_what_cannot_be_judged_is_refused(refused, change, word):
    inputs, targets, starts = windows_of(series(), series()[:, 0])
    with refused(word):
        fit_ladder(**{"inputs": inputs, "targets": targets, "starts": starts, "rungs": FAST} | change)


def test_one_column_may_be_given_without_its_axis():
    coarse = series()
    inputs, targets, starts = windows_of(coarse, coarse[:, 0])
    with_axis, without = (fit_rung(RIDGE, each, targets, starts) for each in (inputs[:, :, :1], inputs[:, :, 0]))
    np.testing.assert_array_equal(with_axis.predict(inputs[:, :, :1]), without.predict(inputs[:, :, 0]))


def test_the_rungs_are_in_the_order_of_their_cost():
    assert RUNGS == ("coarse", "level and gain", "ridge", "ridge and network", "network")
