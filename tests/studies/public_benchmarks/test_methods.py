"""Scores of samples, thresholds and peers, on series whose scores are known."""

import numpy as np
import pytest

from studies.public_benchmarks.methods import (
    OnWindows,
    SampleScores,
    conformal_threshold,
    sample_scores,
    without,
)
from studies.public_benchmarks.peers import (
    RANDOM,
    MatrixProfile,
    MovingDeviation,
    PCAError,
    peers,
)


def test_samples_take_the_mean_of_their_windows_or_the_last_window_that_has_ended():
    # windows of 8 samples begin at every sample from 0 to 12
    scores = sample_scores(np.arange(13.0), 20, 8)
    assert scores.whole.tolist() == [3.5] * 8 + [4.5, 5.5, 6.5, 7.5] + [8.5] * 8
    assert scores.past.tolist() == [-np.inf] * 7 + list(range(13))


class Values:
    """Scores a sample by its value, and refuses a series whose first value it has learnt."""

    def fit(self, nominal):
        self.learnt = nominal[np.isfinite(nominal)]
        return self

    def score(self, series):
        assert series[0, 0] not in self.learnt
        return SampleScores(series[:, 0], series[:, 0])


def test_the_threshold_is_the_conformal_one_of_blocks_that_were_not_learnt():
    nominal = np.arange(1_000, dtype=np.float32)[:, None]
    # of 1,000 samples that of rank ceil(1,001 * .95); of the last 250 that of rank ceil(251 * .95)
    assert conformal_threshold(Values, nominal[::-1], 1, 0.05) == 950
    assert conformal_threshold(Values, nominal, 1, 0.05) == 749 + 239
    # 20 windows that share no sample support no smaller rate than 1 / 21: the largest score
    assert conformal_threshold(Values, nominal, 50, 0.01) == 999


def test_windows_with_samples_that_are_left_out_are_not_learnt():
    class Memory:
        def fit(self, windows):
            self.windows = windows

    series = np.arange(100.0)[:, None]
    method = OnWindows(Memory(), 8).fit(without(series, 20, 90))
    unit = np.std(np.r_[0:20, 90:100])
    firsts = method.detector.windows[:, 0, 0] * unit
    assert firsts.round(3).tolist() == [*range(13), 90, 91, 92]
    assert np.ptp(method.detector.windows[0, :, 0]) == pytest.approx(7 / unit)


def test_the_error_of_components_is_what_lies_outside_them():
    rng = np.random.default_rng(0)
    axes = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    learnt = rng.standard_normal((300, 6)) * [10, 10, 10, 0.1, 0.1, 0.1] @ axes.T + 5
    method = PCAError(0.95).fit(learnt[:, :, None])
    away = 5 + 3 * axes[:, 5]
    assert method.score(away[None, :, None])[0] == pytest.approx(3**2 / 6, rel=0.02)
    assert method.score(5 + 50 * axes[None, :, 0, None])[0] < 0.1
    constant = PCAError(0.95).fit(np.full((9, 4, 1), 2.0))
    assert constant.score(np.full((1, 4, 1), 5.0))[0] == 9


def test_the_moving_deviation_is_that_of_the_channel_that_moves_most():
    windows = np.stack([[[0, 1.0], [0, 3.0], [0, 5.0]]])
    assert MovingDeviation().score(windows) == np.std([1, 3, 5])


@pytest.mark.slow  # compiles for half a minute
def test_the_matrix_profile_is_the_distance_to_the_nearest_window_whatever_its_level_and_scale():
    pytest.importorskip("stumpy")
    rng = np.random.default_rng(0)
    nominal, judged = (rng.standard_normal((80, 1)) for _ in range(2))
    method = MatrixProfile(8).fit(without(nominal, 30, 50))
    found = method.score(judged)

    def windows_of(values):
        every = np.lib.stride_tricks.sliding_window_view(values[:, 0], 8)
        return (every - every.mean(axis=1, keepdims=True)) / every.std(axis=1, keepdims=True)

    learnt = np.concatenate([windows_of(nominal[:30]), windows_of(nominal[50:])])
    distances = np.linalg.norm(windows_of(judged)[:, None] - learnt, axis=2).min(axis=1)
    np.testing.assert_allclose(found.past[7:], distances, rtol=1e-4)


@pytest.mark.parametrize("name", ["PCA", "isolation forest", "nearest neighbours", "ECOD"])
def test_a_peer_finds_what_is_far_away_and_the_same_seed_scores_alike(name):
    pytest.importorskip("pyod")
    rng = np.random.default_rng(0)
    nominal, judged = rng.standard_normal((200, 2)), rng.standard_normal((120, 2))
    judged[60:] += 20
    for setting, make in peers(16, 3)[name].items():
        scores = make().fit(nominal).score(judged)
        assert scores.whole.shape == scores.past.shape == (120,)
        if "centred" not in setting:
            assert scores.whole[80:].mean() > scores.whole[:40].mean()
        np.testing.assert_array_equal(make().fit(nominal).score(judged).whole, scores.whole)


def test_random_scores_do_not_depend_on_the_series():
    make = peers(16, 3)[RANDOM][""]
    one, other = (
        make().fit(np.ones((50, 1))).score(series) for series in np.eye(2, 50)[:, :, None]
    )
    np.testing.assert_array_equal(one.whole, other.whole)
