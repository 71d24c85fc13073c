import numpy as np
import pytest

from enhsim_tf.scoring.views import (
    JOINT_VIEWS,
    VIEWS,
    Level,
    Relation,
    Shape,
    Spread,
    Step,
    Subspace,
)

ALL = VIEWS | JOINT_VIEWS

RNG = np.random.default_rng(0)
NOMINAL = (
    np.sin(2 * np.pi * (RNG.random((200, 1, 1)) + np.arange(32)[:, None] / 16))
    + 0.1 * RNG.standard_normal((200, 32, 2))
).astype(np.float32)


def windows_of(*rows):
    """Windows of one channel."""
    return np.array(rows, np.float32)[:, :, None]


def check_view(make):
    """The contract of every view."""
    before = NOMINAL.copy()
    view = make().fit(NOMINAL)
    scores = view.score(NOMINAL)
    assert scores.shape == (200,) and np.isfinite(scores).all() and (scores >= 0).all()
    np.testing.assert_array_equal(NOMINAL, before)
    # a window is scored alone, and again the same
    np.testing.assert_allclose(view.score(NOMINAL[3:5]), scores[3:5], rtol=1e-3, atol=0.01)
    np.testing.assert_array_equal(make().fit(NOMINAL).score(NOMINAL), scores)
    # far outside in every respect: another level, shape, size and step
    other = 10 + 5 * np.random.default_rng(1).standard_normal((20, 32, 2)).astype(np.float32)
    assert view.score(other).min() > np.quantile(scores, 0.99)


@pytest.mark.parametrize("name", ALL)
def test_every_view_keeps_the_contract(name):
    check_view(ALL[name])


@pytest.mark.parametrize("name", ALL)
def test_windows_that_never_vary_have_score_zero_and_any_others_more(name):
    view = ALL[name]().fit(np.zeros((30, 16, 1), np.float32))
    assert not view.score(np.zeros((2, 16, 1), np.float32)).any()
    spike = np.zeros((1, 16, 1), np.float32)
    spike[0, 8] = 1.0
    assert view.score(spike)[0] > 0.01


def test_a_shape_is_the_distance_to_the_nearest_one_whatever_the_level():
    view = Shape().fit(windows_of([0, 1, 0, 1], [0, 0, 2, 2]))
    windows = windows_of([7, 8, 7, 8], [0, 0, 2, 3])
    # (-1, -1, 1, 1) and (-1.25, -1.25, .75, 1.75)
    np.testing.assert_allclose(view.score(windows), [0.0, np.sqrt(0.75)], atol=1e-6)


def test_a_subspace_is_left_by_what_is_orthogonal_to_it():
    line = np.linspace(-1, 1, 21)[:, None] * [3.0, 0.0, 4.0, 0.0]
    view = Subspace().fit(windows_of(*line))
    windows = windows_of([30, 0, 40, 0], [4, 0, -3, 0], [3, 1, 4, 0])
    np.testing.assert_allclose(view.score(windows), [0.0, 5.0, 1.0], atol=1e-4)


def test_a_level_is_counted_in_standard_deviations_of_the_means_along_their_relation():
    first, apart = np.random.default_rng(1).standard_normal((2, 5_000))
    means = np.stack([first + 0.1 * apart, first - 0.1 * apart], axis=1)
    view = Level().fit(np.repeat(means[:, None], 4, axis=1))
    windows = np.repeat(np.array([[[2.0, 2.0]], [[0.5, -0.5]]]), 4, axis=1)
    # shrinkage makes the small deviation, .14, a little larger
    along, across = view.score(windows)
    assert along == pytest.approx(2.0, abs=0.1) and 3.0 < across < 5.2


def test_a_spread_is_a_logarithm_and_a_step_is_in_units_of_the_largest_nominal_one():
    wave = windows_of([1.0, -1.0] * 8)
    view = Spread().fit(np.concatenate([wave, wave, 2 * wave]))
    np.testing.assert_allclose(view.score(wave * np.e**2), 2.0, rtol=1e-5)
    np.testing.assert_allclose(Step().fit(wave).score(np.concatenate([wave, 3 * wave])), [1, 3])


def vector_autoregression(number, seed, samples=64):
    """Two channels: x(t) = A x(t - 1) + e(t), e normal with correlation 0.6."""
    rng = np.random.default_rng(seed)
    values = rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], (number, samples + 50))
    for t in range(1, samples + 50):
        values[:, t] += values[:, t - 1] @ np.array([[0.7, 0.2], [-0.3, 0.5]]).T
    return values[:, 50:].astype(np.float32)


def test_errors_of_a_known_vector_autoregression_are_white_and_those_of_another_time_are_not():
    view = Relation().fit(vector_autoregression(300, 0))
    fresh = vector_autoregression(300, 1)
    scores = view.score(fresh)
    assert scores.mean() == pytest.approx(1, rel=0.03)
    # of a mean of 48 samples of two channels
    assert scores.std() == pytest.approx(np.sqrt(2 / 96), rel=0.15)
    # every channel looks as before
    swapped = np.stack([fresh[:, :, 0], np.roll(fresh[:, :, 1], 150, axis=0)], axis=2)
    late = np.stack([fresh[:, :, 0], np.roll(fresh[:, :, 1], 30, axis=1)], axis=2)
    for changed in (swapped, late):
        assert np.mean(view.score(changed) > np.quantile(scores, 0.99)) > 0.95
