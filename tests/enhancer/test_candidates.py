"""The candidates for the enhancer: known processes are recovered by the one that can express them,
and held-out time stays unseen.
"""

import numpy as np
import pytest

from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer import candidates
from enhsim_tf.enhancer.candidates import Training, block_edges, choose_enhancer, judge, split_fold
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.enhancer.names import COARSE, LEVEL_AND_GAIN, NETWORK, RIDGE, RIDGE_AND_FEATURES
from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.telemetry.windows import average_windows, run_starts

WINDOW = 16


def series(num_samples=2_400, seed=0, width=9):
    """Two coarse columns: smooth random signals that do not repeat."""
    rng = np.random.default_rng(seed)
    draws = rng.standard_normal((2, num_samples))
    smooth = np.stack([np.convolve(draw, np.hanning(width), "same") for draw in draws], axis=1)
    return smooth / smooth.std(axis=0)


def windows_of(coarse, target, num_windows=400):
    """Windows of both, each of shape `(windows, samples, columns)`; a target of one channel is a
    series.
    """
    target = target.reshape(len(target), -1)
    starts = np.linspace(0, len(coarse) - WINDOW, num_windows).astype(int)
    places = starts[:, None] + np.arange(WINDOW)
    return coarse[places], target[places], starts


def noise(number, sd, seed=9):
    return sd * np.random.default_rng(seed).standard_normal(number)


# blocks of time


def test_blocks_cover_the_time_and_are_held_out_in_turn():
    edges = block_edges(100, 1_000, window=50)
    # 900 samples, three windows of 50 in each block
    assert edges.tolist() == [100, 250, 400, 550, 700, 850, 1_000]
    starts = np.arange(100, 951)
    learnt, held = zip(*(split_fold(starts, 50, edges, fold) for fold in range(3)), strict=True)
    assert sorted({int(starts[row]) for row in held[0]}) == [*range(100, 201), *range(550, 651)]
    assert not set(held[0]) & set(held[1]) and not set(held[1]) & set(held[2])
    for training, held_out in zip(learnt, held, strict=True):  # they share no sample
        assert np.abs(starts[training][:, None] - starts[held_out]).min() == 50
    with pytest.raises(InputError, match="windows of 50 samples"):
        block_edges(0, 149, window=50)


# one candidate


def test_the_coarse_candidate_returns_the_most_similar_column_of_each_channel_unchanged():
    coarse = series() * [1.0, 3.0] + [5.0, -40.0]
    target = coarse[:, ::-1] * [2.0, -1.0] + noise((len(coarse), 2), 0.1)
    inputs, targets, starts = windows_of(coarse, target)
    found = Training(inputs, targets, starts).fit(COARSE)
    np.testing.assert_allclose(found.predict(inputs), inputs[:, :, ::-1], rtol=1e-4, atol=1e-4)


def test_level_and_gain_are_those_of_least_squares():
    coarse = series()
    target = coarse * [-0.5, 3] + [7, -1] + noise((len(coarse), 2), 0.05)
    inputs, targets, starts = windows_of(coarse, target)
    predicted = Training(inputs, targets, starts).fit(LEVEL_AND_GAIN).predict(inputs)
    for channel in range(2):
        gain, level = np.polyfit(inputs[:, :, channel].ravel(), targets[:, :, channel].ravel(), 1)
        np.testing.assert_allclose(
            predicted[:, :, channel], level + gain * inputs[:, :, channel], atol=1e-4
        )


@pytest.mark.usefixtures("narrow_enhancer")
def test_the_papers_network_takes_all_columns_and_learns():
    coarse = series(width=60)
    target = coarse @ [[1, -9], [1, 0]] + [0, 5]
    inputs, targets, starts = windows_of(coarse, target)
    found = Training(inputs, targets, starts).fit(NETWORK, epochs=6)
    errors = np.sqrt(np.mean((found.predict(inputs) - targets) ** 2, axis=(0, 1)))
    # of the first channel, one coarse column alone leaves 0.7
    assert (errors < 0.4 * targets.std(axis=(0, 1))).all()


def test_random_features_are_ridge_regression_on_a_hidden_layer_of_relu():
    coarse = series(800)
    target = np.column_stack([coarse[:, 0] ** 2, 4 * np.abs(coarse[:, 1])])
    inputs, targets, starts = windows_of(coarse, target, 60)
    alone, both = (
        Training(inputs, targets, starts).fit(name) for name in (RIDGE, RIDGE_AND_FEATURES)
    )
    (kernel, shift), (weights, _) = both.layers
    assert kernel.shape == (2 * WINDOW, 1_000) and weights.shape == (1_000, 2 * WINDOW)
    hidden = np.maximum((inputs - both.centre).reshape(len(inputs), -1) @ kernel + shift, 0)[
        :, None, :
    ]
    left = (targets - alone.predict(inputs)).reshape(len(inputs), -1)
    expected = alone.predict(inputs) + fit_ridge(hidden, left, starts, num_channels=2).predict(
        hidden
    ).reshape(targets.shape)
    np.testing.assert_allclose(both.predict(inputs), expected, atol=1e-3)


def test_the_sum_of_factors_and_layers_by_hand():
    rng = np.random.default_rng(0)
    first, second, kernel, last, bias, inner, centre, inputs = (
        rng.standard_normal(size).astype(np.float32)
        for size in ((8, 2), (2, 12), (8, 5), (5, 12), 12, 5, 2, (3, 4, 2))
    )
    layers = (kernel, inner), (last, bias)
    name = "ridge and random features"
    found = Enhancer(name, 4, 2, 3, centre, bias, (first, second), layers)
    rows = (inputs - centre).reshape(3, 8)
    expected = rows @ first @ second + bias + np.maximum(rows @ kernel + inner, 0) @ last + bias
    np.testing.assert_allclose(
        found.predict(inputs), expected.reshape(3, 4, 3), rtol=1e-4, atol=1e-5
    )


# the choice


def test_the_choice_does_not_depend_on_units():
    coarse = series()
    first = 0.7 * coarse[:, 0] + 0.4 * np.roll(coarse[:, 1], 1)
    target = np.column_stack([first, coarse[:, 1]]) + noise((len(coarse), 2), 0.05)
    one = choose_enhancer(*windows_of(coarse, target))
    other = choose_enhancer(
        *windows_of(coarse * [1e-4, 1e4] + [3.0, 1e5], target * [1e3, 1e-3] - [5e3, 2.0])
    )
    assert one.enhancer.name == other.enhancer.name == RIDGE
    for first, second in zip(one.judged[1:], other.judged[1:], strict=True):
        assert first.name == second.name and first.error == pytest.approx(second.error, rel=1e-3)


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        (lambda coarse: coarse[:, 0], COARSE),
        (lambda coarse: 3 + 1.5 * coarse[:, 0], LEVEL_AND_GAIN),
        (
            lambda coarse: np.convolve(coarse[:, 0], [0.5, 0.3, 0.2], "same") + 0.5 * coarse[:, 1],
            RIDGE,
        ),
        (lambda coarse: coarse[:, 0] + 0.5 * coarse[:, 0] ** 2, RIDGE_AND_FEATURES),
    ],
)
def test_the_simplest_sufficient_candidate_is_chosen(target, expected):
    coarse = series(4_800, width=60)
    found = choose_enhancer(*windows_of(coarse, target(coarse) + noise(len(coarse), 0.05), 1_200))
    assert found.enhancer.name == found.without_fold.name == expected
    names = [candidate.name for candidate in found.judged]
    assert names == [COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_FEATURES]


def test_a_candidate_that_is_asked_for_is_used_whatever_its_error():
    coarse, said = series(), []
    found = choose_enhancer(
        *windows_of(coarse, coarse[:, 0] + coarse[:, 1]),
        LEVEL_AND_GAIN,
        progress=Progress(said.append),
    )
    assert found.enhancer.name == LEVEL_AND_GAIN
    assert [candidate.name for candidate in found.judged] == [COARSE, RIDGE, LEVEL_AND_GAIN]
    assert said == [f"enhancer {each.name} ..." for each in found.judged]


def test_the_comparison_hand_worked():
    first, second = judge({"a": np.array([0.04, 0.06]), "b": np.array([0.01, 0.05])})
    assert first.error == pytest.approx(0.05**0.5) and second.error == pytest.approx(0.03**0.5)
    # deviation 0.0141 of two, divided by root 2: 0.01
    assert first.standard_error == pytest.approx(0.01 / (2 * 0.05**0.5))
    assert first.behind == pytest.approx(0.02) and first.behind_standard_error == pytest.approx(
        0.01
    )
    assert second.behind == 0 and second.is_within and not first.is_within


# 2 % above 0.04 is 0.0408
@pytest.mark.parametrize(("squared", "is_within"), [(0.0407, True), (0.0409, False)])
def test_an_error_that_is_one_per_cent_larger_is_as_good(squared, is_within):
    first, _ = judge({"simple": np.full(3, squared), "best": np.full(3, 0.04)})
    assert first.is_within == is_within


def test_candidates_with_one_ridge_regression_are_judged_without_held_out_windows_and_then_fitted_to_all(
    monkeypatch,
):
    seen = []
    monkeypatch.setattr(
        candidates,
        "fit_ridge",
        lambda *given, **options: seen.append(given[2]) or fit_ridge(*given, **options),
    )
    coarse = series()
    inputs, targets, starts = windows_of(coarse, coarse[:, 0])
    choose_enhancer(inputs, targets, starts, RIDGE_AND_FEATURES)
    edges = block_edges(0, int(starts.max()) + WINDOW, WINDOW)
    learnt = starts[split_fold(starts, WINDOW, edges, 0)[0]]
    # of the columns and of the features
    for found, expected in zip(seen, (learnt, learnt, starts, starts), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_what_cannot_be_judged_is_refused(refused):
    windows = windows_of(series(), series()[:, 0])
    with refused("deep magic"):
        choose_enhancer(*windows, "deep magic")
    with refused("longer telemetry"):
        choose_enhancer(*windows[:2], np.zeros(400, int))


def test_a_training_that_diverges_is_refused(refused, monkeypatch):
    layers = [(np.full((32, 8), np.nan), np.zeros(8)), (np.ones((8, 16)), np.zeros(16))]
    monkeypatch.setattr(candidates, "_train", lambda rows, *rest: layers)
    with refused("diverged", "--enhancer ridge"):
        Training(*windows_of(series(), series()[:, 0])).fit(NETWORK)


# runs from overlapping windows


@pytest.mark.parametrize("num_samples", [32, 63, 201])
def test_windows_that_agree_give_the_run_itself(num_samples):
    run = np.random.default_rng(0).standard_normal((num_samples, 2)).astype(np.float32)
    starts = run_starts(num_samples, 32)
    assert (
        starts[0] == 0 and starts[-1] == num_samples - 32 and np.diff(starts, prepend=0).max() <= 8
    )
    made = average_windows(
        lambda rows: run[starts[rows, None] + np.arange(32)], starts, 32, num_samples
    )
    assert made.dtype == np.float32
    np.testing.assert_allclose(made, run, atol=1e-5)


def test_windows_that_disagree_are_joined_without_a_step():
    starts, levels = run_starts(1_000, 64), np.random.default_rng(0).standard_normal(1_000)
    made = average_windows(
        lambda rows: np.tile(levels[: len(starts)][rows, None, None], (1, 64, 1)), starts, 64, 1_000
    )
    assert np.abs(np.diff(made[:, 0])).max() < 0.12  # the levels themselves differ by up to 4
