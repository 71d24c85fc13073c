"""Two-sample tests, compared with direct implementations of their definitions, and applied to samples of one distribution."""

import numpy as np
import pytest
import scipy.signal
from sklearn.metrics import roc_auc_score

from enhsim_tf.common import two_sample
from studies.robustness import distances


def normal(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def autoregressive(num_windows, samples, coefficient, seed=0):
    """AR(1) windows of variance 1."""
    return scipy.signal.lfilter([np.sqrt(1 - coefficient**2)], [1, -coefficient], normal(num_windows, samples + 50, seed=seed))[:, 50:]


def test_features_of_a_window_worked_by_hand():
    window = np.array([[1.0, -1, 1, -1, 1, -1, 1, -1]])
    mean, log_sd, kurtosis, highest, log_steps, correlation = two_sample.window_features(3 + 2 * window)[0, :6]
    assert (mean, highest) == (3, 5)
    assert log_sd == pytest.approx(np.log(2))
    assert kurtosis == pytest.approx(1 - 3)
    assert log_steps == pytest.approx(np.log(np.std([-4, 4, -4, 4, -4, 4, -4])))
    assert correlation == pytest.approx(-1)


def test_features_of_white_noise_are_those_of_its_closed_form():
    features = two_sample.window_features(0.5 * normal(400, 500))
    expected = [0, np.log(0.5), 0, None, np.log(0.5 * np.sqrt(2)), 0]
    for column, value in enumerate(expected):
        if value is not None:
            assert np.mean(features[:, column]) == pytest.approx(value, abs=0.02)


def test_eight_bands_that_double_in_width():
    # a sine in the middle of each octave of 1 ... 250 cycles a window is strongest in the band of its octave
    cycles = np.array([1, 3, 6, 11, 23, 45, 90, 180])
    windows = np.sin(2 * np.pi * cycles[:, None] / 500 * np.arange(500))
    features = two_sample.window_features(windows)
    assert features.shape == (8, 14)
    assert np.argmax(features[:, 6:], axis=1).tolist() == list(range(8))


def test_features_of_a_window_that_stands_still_are_finite():
    assert np.isfinite(two_sample.window_features(np.full((2, 500), 7.0, np.float32))).all()


@pytest.mark.parametrize("seed", [1, 3])
def test_two_samples_of_one_process_cannot_be_told_apart(seed):
    auc = two_sample.two_sample_auc(normal(200, 100, seed=seed), normal(200, 100, seed=seed + 1), seed=0)
    assert auc == pytest.approx(0.5, abs=5 * np.sqrt(401 / (12 * 200**2)))  # standard error of the rank sum


def test_two_samples_of_two_processes_can_and_the_same_seed_says_the_same():
    first, again = (two_sample.two_sample_auc(autoregressive(100, 100, 0.7), normal(120, 100, seed=3), seed=0) for _ in range(2))
    assert first > 0.98 and first == again


def test_two_sample_folds_hold_out_neighbours():
    # stretches of ten windows at a level of their own, of either kind by chance: whoever met a neighbour in training
    # knows its level and so its kind
    levels = np.random.default_rng(0).permutation(40).reshape(2, 20)
    generated, real = (np.repeat(kind, 10)[:, None] + 0.01 * normal(200, 50) for kind in levels)
    assert two_sample.two_sample_auc(generated, real, seed=0) < 0.75


def test_two_sample_auc_refuses_too_few_windows(refused):
    with refused("10 windows"):
        two_sample.two_sample_auc(normal(9, 100), normal(40, 100), seed=0)


def test_permutation_p_value_of_scores():
    folds, labels = np.tile(np.repeat([0, 1], 30), 2), np.repeat([1, 0], 60)
    assert two_sample.HeldOut(labels + 0.1 * normal(120), labels, folds).p_value(99) == 0.01  # none of 99 is as large
    by_chance = [two_sample.HeldOut(normal(120, seed=seed), labels, folds).p_value(99) for seed in range(200)]
    assert np.mean(by_chance) == pytest.approx(0.5, abs=5 / np.sqrt(12 * 200))
    assert np.mean(np.array(by_chance) <= 0.1) == pytest.approx(0.1, abs=5 * np.sqrt(0.09 / 200))


def test_permutation_p_value_written_out():
    folds, labels, scores = np.tile(np.repeat([0, 1], 5), 2), np.repeat([1, 0], 10), normal(20) + np.repeat([0.2, 0], 10)
    owner, areas = np.random.default_rng(1), []
    for _ in range(2_000):
        shuffled = labels.copy()
        for fold in (0, 1):
            shuffled[folds == fold] = owner.permutation(labels[folds == fold])
        areas.append(roc_auc_score(shuffled, scores))
    held_out = two_sample.HeldOut(scores, labels, folds)
    expected = np.mean(np.array(areas) >= held_out.auc - 1e-9)
    assert 0.01 < expected < 0.5
    assert held_out.p_value(2_000) == pytest.approx(expected, abs=5 * np.sqrt(2 * expected / 2_000))


def test_permutations_keep_to_their_fold():
    # within each fold all scores are equal: whatever the labels, no order of them is larger
    folds, labels = np.tile(np.repeat([0, 1], 30), 2), np.repeat([1, 0], 60)
    assert two_sample.HeldOut(folds.astype(float), labels, folds).p_value(99) == 1


def test_convolution_features_written_out():
    windows = normal(3, 40)
    features = distances.convolution_features(windows, num_kernels=2, seed=4)
    assert features.shape == (3, 3 * 2 * 2) and features.dtype == np.float32  # dilations 1, 2, 4
    owner, expected = np.random.default_rng(4), []
    for dilation in (1, 2, 4):
        kernels, thresholds = owner.standard_normal((9, 2)), owner.standard_normal(2)
        for pool in (np.max, lambda response, threshold: np.mean(response > threshold)):
            for kernel, threshold in zip(kernels.T, thresholds, strict=True):
                spread = np.zeros(8 * dilation + 1)
                spread[::dilation] = kernel / np.sqrt(np.sum(kernel**2))
                responses = [np.correlate(window, spread, mode="valid") for window in windows]
                expected.append([pool(response) if pool is np.max else pool(response, threshold) for response in responses])
    assert features == pytest.approx(np.transpose(expected), abs=1e-5)


def test_convolutions_tell_what_they_should_and_not_what_they_should_not():
    features = distances.convolution_features
    same = two_sample.linear_classifier(features(normal(150, 200)), features(normal(150, 200, seed=1)))
    assert same.auc == pytest.approx(0.5, abs=5 * np.sqrt(301 / (12 * 150**2))) and same.p_value() > 0.01
    for other in (autoregressive(150, 200, 0.4), 1.5 * normal(150, 200), normal(150, 200) + 0.5):
        told = two_sample.linear_classifier(features(other), features(normal(150, 200, seed=1)))
        assert told.auc > 0.95 and told.p_value(99) == 0.01


def test_convolution_features_refuse_windows_below_a_kernel(refused):
    with refused("at least 9 samples"):
        distances.convolution_features(normal(4, 8))


def test_density_and_coverage_by_hand():
    real = np.array([[0.0], [1.0], [2.0], [10.0]])  # to the nearest: 1, 1, 1 and 8
    generated = np.array([[0.5], [0.6], [9.0], [30.0]])
    # 0.5 and 0.6 lie in the reach of 0 and 1, 9 in that of 10; 30 and the reach of 2 stay empty
    assert distances.density(generated, real, num_neighbours=1) == pytest.approx(5 / 4)
    assert distances.coverage(generated, real, num_neighbours=1) == pytest.approx(3 / 4)


def test_density_and_coverage_of_two_samples_of_one_process_are_those_of_theory():
    pairs = [(normal(300, 4, seed=2 * seed), normal(300, 4, seed=2 * seed + 1)) for seed in range(20)]
    assert np.mean([distances.coverage(*pair) for pair in pairs]) == pytest.approx(1 - 2.0**-5, abs=0.01)
    assert np.mean([distances.density(*pair) for pair in pairs]) == pytest.approx(1, abs=0.05)
    with pytest.raises(ValueError, match="more than 5 real windows"):
        distances.density(normal(9, 4), normal(5, 4))


def test_mmd_written_out():
    generated, real = normal(12, 3, seed=1) + 0.5, normal(15, 3) * [1, 10, 100]
    unit = np.std(real, axis=0)
    lengths = [np.linalg.norm((real[i] - real[j]) / unit) for i in range(15) for j in range(i)]

    def kernel(one, other):
        return np.exp(-np.sum(((one - other) / unit) ** 2) / (2 * np.median(lengths) ** 2))

    expected = sum(kernel(generated[i], generated[j]) for i in range(12) for j in range(12) if i != j) / (12 * 11)
    expected += sum(kernel(real[i], real[j]) for i in range(15) for j in range(15) if i != j) / (15 * 14)
    expected -= 2 * sum(kernel(one, other) for one in generated for other in real) / (12 * 15)
    assert distances.mmd_squared(generated, real) == pytest.approx(expected)


def test_mmd_is_unbiased_and_its_p_value_uniform():
    pairs = [(normal(30, 2, seed=2 * seed), normal(30, 2, seed=2 * seed + 1)) for seed in range(300)]
    values = [distances.mmd_squared(*pair) for pair in pairs]
    assert np.mean(values) == pytest.approx(0, abs=4 * np.std(values) / np.sqrt(300)) and min(values) < 0
    p_values = np.array([distances.mmd_p_value(*pair, num_permutations=99) for pair in pairs])
    assert np.mean(p_values) == pytest.approx(0.5, abs=5 / np.sqrt(12 * 300))
    assert np.mean(p_values <= 0.1) == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / 300))
    assert distances.mmd_p_value(normal(30, 2) + 2, normal(30, 2, seed=1), num_permutations=99) == 0.01


def test_features_that_stand_still_are_no_obstacle():
    real, generated = normal(30, 3) * [1, 0, 1], normal(30, 3, seed=1)
    found = [compare(generated, real) for compare in (distances.density, distances.coverage, distances.mmd_squared)]
    assert np.isfinite(found).all()
