import numpy as np
import pytest

from enhsim_tf.common.two_sample import boosted_trees, window_features
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.noise_choice import (
    CandidateJudgement,
    HeldOutJudge,
    NoiseWindows,
    anomalous_windows,
    choose,
    choose_noise,
    pieces_of,
    signal_features,
)


def windows(noise, window=50):
    """Disjoint windows of a series of shape `(samples, channels)` on a signal of zeros."""
    cut = noise[: len(noise) // window * window].reshape(-1, window, noise.shape[1]).astype(np.float32)
    return NoiseWindows(cut, np.zeros_like(cut), window * np.arange(len(cut)))


def white(number=20_000, seed=0):
    return np.random.default_rng(seed).standard_normal((number, 2)) * (1.0, 30.0)


def bursts(number=20_000, seed=0):
    rng = np.random.default_rng(seed)
    return white(number, seed) * (1 + 5 * (np.convolve(rng.random(number) < 0.01, np.ones(40), "same") > 0))[:, None]


@pytest.mark.parametrize(("noise", "expected"), [(white, "gaussian"), (bursts, "residual windows")])
def test_the_simplest_noise_that_real_noise_is_not_told_from_is_chosen(noise, expected):
    learnt, judged = windows(noise(seed=3)), windows(noise(seed=4))
    model, rows, _ = choose_noise(learnt, judged, learnt, seed=0)
    assert [row["name"] for row in rows if row["is_chosen"]] == [expected]
    assert rows[-1]["name"] == expected  # nothing after the first that passes is tried
    drawn = model.generate(200, np.random.default_rng(0))
    assert np.std(drawn, axis=(0, 1)) == pytest.approx(np.std(noise(seed=3), axis=0), rel=0.15)


def test_with_too_little_noise_whole_windows_are_drawn():
    few = windows(white(300))
    _, rows, notes = choose_noise(few, few, few, seed=0)
    assert not rows and "too little" in notes[0]


def judgement(name, auc=0.5, alarms=0.01, recall=0.5):
    return CandidateJudgement(name, auc, 0.5, alarms, 0.01, recall, 0.5)


@pytest.mark.parametrize(
    ("judgements", "expected"),
    [
        ([judgement("a", auc=0.56), judgement("b", auc=0.54)], "b"),
        ([judgement("a", alarms=0.021), judgement("b", recall=0.46), judgement("c", auc=0.6)], "a"),  # none passes: .011, .04 and .1
        ([judgement("a"), judgement("b", auc=0.4)], "a"),
    ],
)
def test_the_rule_of_the_choice_by_hand(judgements, expected):
    assert choose(judgements) == expected


def test_anomalies_are_in_one_channel_and_of_the_asked_size():
    nominal = np.zeros((6, 120, 2), np.float32)
    found = anomalous_windows(nominal, np.array([1.0, 10.0]), 0, (4.0,))["level_shift", 4.0]
    size = np.abs(found).max(axis=1)
    assert ((size > 0).sum(axis=1) == 1).all() and set(size[size > 0].tolist()) == {4.0, 40.0}


def test_few_windows_are_cut_into_pieces():
    learnt = windows(white(1_000))
    pieces = pieces_of(learnt, windows(white(1_000, 1)))
    assert [each.noise.shape for each in pieces] == [(60, 16, 2)] * 2  # three pieces of sixteen in each of twenty windows


def test_noise_on_levels_is_not_told_from_itself_by_rounding_errors_of_32_bits():
    rng = np.random.default_rng(0)
    noise = 0.05 * np.rint(rng.standard_normal((600, 60)) / 0.5)
    signal = np.sin(np.arange(60) / 7 + rng.uniform(0, 6, (600, 1)))
    # the noise of telemetry that is stored in 32 bits, and exact noise
    stored = (signal + noise).astype(np.float32) - signal.astype(np.float32)
    assert 0 < np.max(np.abs(stored - noise)) < 1e-6
    exact, real = noise[:300], stored[300:]
    assert boosted_trees(window_features(exact / 0.1), window_features(real / 0.1)) > 0.7
    stored, signal32, places = stored[:, :, None], signal.astype(np.float32)[:, :, None], 60 * np.arange(600)
    learnt, judged = (NoiseWindows(stored[some], signal32[some], places[some]) for some in (slice(0, 300), slice(300, None)))
    judgement = HeldOutJudge(learnt, judged, seed=0).judge("exact", WindowBootstrap(exact[:, :, None]), rng)
    assert judgement.auc < 0.58


def test_features_are_mean_and_scale_of_the_noise_at_each_level_and_slope():
    signal = np.array([[0.0, 0, 1, 2, 2, 1, 0, 0]])  # slopes: 0 0.5 1 0.5 -0.5 -1 -0.5 0
    noise = np.array([[1.0, 3, 4, 5, 7, 2, 1, 3]])
    found = signal_features(noise, signal, np.array([[0.5, 1.5], [-0.25, 0.25]])).reshape(6, 2)
    places = [1, 3, 1, 3], [4, 2], [5, 7], [7, 2, 1], [1, 3], [3, 4, 5]  # low, medium, high, falls, flat, rises
    for (mean, log_scale), there in zip(found, places, strict=True):
        assert mean == pytest.approx(np.mean(there)) and log_scale == pytest.approx(np.log(np.mean(np.square(there))) / 2)


def test_what_a_window_does_not_contain_is_taken_from_the_whole_window():
    noise = np.array([[1.0, -1, 2, 2], [0.0, 0, 0, 0]])
    found = signal_features(noise, np.full((2, 4), 5.0), np.array([[0.0, 1.0], [-1.0, 1.0]])).reshape(2, 6, 2)
    np.testing.assert_allclose(found[0], np.tile([1.0, np.log(2.5) / 2], (6, 1)))
    assert np.isfinite(found[1]).all()
