"""Ridge regression: against scikit-learn, by hand, and independent of units."""

import numpy as np
import pytest
from sklearn.linear_model import Ridge as SklearnRidge

from enhsim_tf.enhancer.ridge import PENALTIES, fit_ridge


def _linear(num_windows, noise=0.1, seed=0, samples=12, outputs=7, columns=2):
    """Windows of two columns of different size, a known linear map of them, and noise."""
    rng = np.random.default_rng(seed)
    scales = np.array([1.0, 30.0])[:columns]
    inputs = rng.standard_normal((num_windows, samples, columns)) * scales + 4
    matrix = np.random.default_rng(99).standard_normal((samples * columns, outputs))
    matrix /= np.tile(scales, samples)[:, None]
    clean = inputs.reshape(num_windows, -1) @ matrix + 2
    return inputs, clean + noise * rng.standard_normal(clean.shape), clean


def _standardised(inputs, like):
    centred = like - like.mean(axis=0)
    deviation = np.sqrt((centred**2).mean(axis=(0, 1)))
    return ((inputs - like.mean(axis=0)) / deviation).reshape(len(inputs), -1)


# so few that two factors hold fewer numbers: 5 * (24 + 7) < 24 * 7 <= 6 * (24 + 7); fewer than
# inputs; as many; more
@pytest.mark.parametrize("num_windows", [5, 6, 24, 200])
@pytest.mark.parametrize("penalty", [1e-3, 1e4])
def test_it_is_scikit_learns_on_standardised_windows(num_windows, penalty):
    inputs, targets, _ = _linear(num_windows)
    new, *_ = _linear(5, seed=1)
    found = fit_ridge(inputs, targets, penalties=[penalty])
    expected = SklearnRidge(alpha=penalty).fit(_standardised(inputs, inputs), targets)
    expected = expected.predict(_standardised(new, inputs))
    np.testing.assert_allclose(found.predict(new), expected, rtol=1e-5, atol=1e-5)
    assert found.penalty == penalty and found.predict(new).dtype == np.float32
    assert len(found.factors) == (2 if num_windows == 5 else 1)


def test_the_chosen_penalty_is_that_of_a_plain_loop():
    inputs, targets, _ = _linear(60, noise=3.0)
    targets += 100  # far from zero
    penalties, squares = [0.1, 30.0, 1000.0], np.zeros(3)
    for held_out in np.array_split(np.arange(60), 5):
        training = np.setdiff1d(np.arange(60), held_out)
        learnt, judged = (
            _standardised(inputs[rows], inputs[training]) for rows in (training, held_out)
        )
        for number, penalty in enumerate(penalties):
            model = SklearnRidge(alpha=penalty).fit(learnt, targets[training])
            squares[number] += np.sum((model.predict(judged) - targets[held_out]) ** 2)
    found = fit_ridge(inputs, targets, penalties=penalties).penalty
    assert found == penalties[np.argmin(squares)] == 30.0


def test_constant_samples_and_constant_columns_do_no_harm():
    inputs, targets, _ = _linear(80)
    new, *_ = _linear(5, seed=1)

    def with_constants(windows):
        windows = np.concatenate([windows, np.full((len(windows), 12, 1), 0.1, np.float32)], axis=2)
        return np.concatenate([windows, np.full((len(windows), 1, 3), 1 / 3)], axis=1)

    predicted = fit_ridge(with_constants(inputs), targets, penalties=[1e-3]).predict(
        with_constants(new)
    )
    np.testing.assert_allclose(
        predicted, fit_ridge(inputs, targets, penalties=[1e-3 * 12 / 13]).predict(new), atol=1e-3
    )
    constant = fit_ridge(np.full((6, 4), 7.0), np.arange(6.0)[:, None])
    np.testing.assert_allclose(constant.predict(np.full((1, 4), 7.0)), [[2.5]])


def test_one_window_predicts_itself_and_the_largest_of_equally_good_penalties_is_chosen():
    found = fit_ridge(np.ones((1, 4)), np.array([[3.0, 5.0]]))
    np.testing.assert_array_equal(found.predict(np.zeros((2, 4))), [[3, 5], [3, 5]])
    assert (
        found.penalty
        == fit_ridge(np.arange(20.0).reshape(10, 2), np.ones((10, 3))).penalty
        == max(PENALTIES)
    )


def _of_two_channels(num_windows):
    """Targets whose outputs alternate between a channel with little noise and one with much."""
    inputs, _, clean = _linear(num_windows, outputs=8)
    noise = np.random.default_rng(5).standard_normal(clean.shape) * np.tile([0.1, 30.0], 4)
    return inputs, clean + noise


@pytest.mark.parametrize("num_windows", [20, 200])
def test_channels_are_fitted_as_if_each_were_alone(num_windows):
    inputs, targets = _of_two_channels(num_windows)
    together, new = fit_ridge(inputs, targets, num_channels=2), _linear(5, seed=1)[0]
    for channel in range(2):
        alone = fit_ridge(inputs, targets[:, channel::2])
        assert alone.penalty == together.chosen[channel]
        np.testing.assert_allclose(
            together.predict(new)[:, channel::2], alone.predict(new), rtol=1e-5, atol=1e-4
        )
    assert together.penalty == min(together.chosen) < max(together.chosen)


def test_chosen_penalties_are_kept_and_nothing_is_cross_validated():
    inputs, targets = _of_two_channels(60)
    found, new = (
        fit_ridge(inputs, targets, num_channels=2, chosen=(0.5, 70.0)),
        _linear(5, seed=1)[0],
    )
    assert found.chosen == (0.5, 70.0)
    for channel, penalty in enumerate(found.chosen):
        alone = fit_ridge(inputs, targets[:, channel::2], penalties=[penalty])
        np.testing.assert_allclose(
            found.predict(new)[:, channel::2], alone.predict(new), rtol=1e-5, atol=1e-4
        )


def test_windows_may_overlap_and_come_in_any_order():
    # each window twice: without their starts, the copy in training would make the smallest penalty
    # the best
    inputs, targets, _ = _linear(60, noise=10.0, samples=40)
    starts = np.repeat(40 * np.arange(60), 2)
    inputs, targets = (each.repeat(2, axis=0) for each in (inputs, targets))
    order = np.random.default_rng(3).permutation(120)
    shuffled = inputs[order], targets[order]
    first, second = fit_ridge(inputs, targets, starts), fit_ridge(*shuffled, starts[order])
    assert first.penalty == second.penalty > fit_ridge(*shuffled).penalty
