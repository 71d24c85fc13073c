"""Detectors without networks: by hand, on known processes, and on one channel of several."""

import numpy as np
import pytest

from studies.common.detectors import (
    JointMeans,
    LargestStep,
    LimitCheck,
    MovingDeviation,
    PCAResidual,
)

DETECTORS = {
    "limit check": LimitCheck,
    "PCA residual": lambda: PCAResidual(seed=0),
    "largest step": LargestStep,
    "moving deviation": MovingDeviation,
}


def area(anomalous, nominal):
    """Area under the ROC curve: the share of pairs in the right order, ties for half."""
    difference = np.asarray(anomalous)[:, None] - np.asarray(nominal)[None]
    return np.mean((difference > 0) + 0.5 * (difference == 0))


def waves(number, seed, noise_sd=0.1):
    """Sines of 40 samples at random phases, in noise, around 5, of shape `(windows, samples)`."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, (number, 1))
    signal = 5 + np.sin(2 * np.pi * np.arange(100) / 40 + phases)
    return (signal + noise_sd * rng.standard_normal(signal.shape)).astype(np.float32)


# several channels


def both_ways(number, seed, noise_sd=0.1):
    """Windows of two channels, of which the second is the first upside down; each has noise of its
    own.
    """
    first = waves(number, seed, noise_sd)
    noise = np.random.default_rng([seed, 1]).standard_normal(first.shape)
    return np.stack([first, 10 - first + noise_sd * noise], axis=2).astype(np.float32)


@pytest.mark.parametrize("name", DETECTORS)
def test_an_anomaly_of_one_channel_of_several_is_found(name):
    detector = DETECTORS[name]().fit(both_ways(400, 0))
    nominal, changed = both_ways(60, 3), both_ways(60, 4)
    for begin, end in ((50, 51), (60, 90)):
        changed[:, begin:end, 1] += 3
    changed[:, 20:60, 1] += np.random.default_rng(9).standard_normal((60, 40))
    scores, plain = detector.score(changed), detector.score(nominal)
    assert scores.shape == plain.shape == (60,) and area(scores, plain) > 0.95


# by hand


def test_limit_check_by_hand():
    detector = LimitCheck().fit(np.arange(1_001.0)[None])  # limits 1 and 999
    windows = np.array([[2.0, 2.5], [2, 999.5], [-1, 999.5], [1, 999], [9, -9]])
    assert detector.score(windows) == pytest.approx([-1, 0.5, 2, 0, 10])


def test_controls_by_hand():
    windows = np.array([[0.0, 1, -2, -2], [5, 5, 5, 5]])
    assert LargestStep().fit(windows).score(windows).tolist() == [3, 0]
    assert MovingDeviation().fit(windows).score(windows) == pytest.approx(np.std(windows, axis=1))
    random = waves(5, 0) + 1e4
    stretches = np.lib.stride_tricks.sliding_window_view(random.astype(np.float64), 25, axis=1)
    assert MovingDeviation().score(random) == pytest.approx(stretches.std(axis=2).max(axis=1))


def test_pca_residual_is_the_energy_outside_the_span():
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.standard_normal((50, 50)))[0].T
    training = 7 + rng.standard_normal((200, 3)) @ basis[:3]
    detector = PCAResidual(num_components=3).fit(training)
    inside = 7 + 4 * rng.standard_normal((20, 3)) @ basis[:3]
    assert detector.score(inside) == pytest.approx(np.zeros(20), abs=1e-20)
    energies = rng.uniform(0.1, 4, 20)
    outside = inside + np.sqrt(energies)[:, None] * basis[10]
    assert detector.score(outside) == pytest.approx(energies / 50)


def test_a_channel_that_leaves_the_others_is_far_although_its_values_are_usual():
    rng = np.random.default_rng(1)
    own = rng.standard_normal((200, 40, 3)) + [1.0, -2.0, 5.0]
    # a covariance times its inverse
    assert JointMeans().fit(own).score(own).mean() == pytest.approx(1)
    common = rng.standard_normal((2_000, 1, 1))
    windows = common + 0.1 * rng.standard_normal((2_000, 20, 2))
    apart = windows[:1].copy()
    # half the deviation of the channel, twenty of the difference of two means
    apart[:, :, 1] += 0.5
    assert JointMeans().fit(windows).score(apart)[0] > 10
