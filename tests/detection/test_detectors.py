"""Each detector finds injected anomalies, and degenerate scores find none."""

import numpy as np
import pytest

from enhsim_tf.detection.detectors import (
    Innovation,
    JointMeans,
    JointSize,
    LargestStep,
    LimitCheck,
    MovingDeviation,
    PCAResidual,
    following_drift,
    root_mean_square,
)
from enhsim_tf.detection.registry import DETECTORS, option_name

MUST_SEE = {  # anomalies that each detector should find
    "limit check": ["spike", "noisy", "shifted"],
    "PCA residual": ["stuck", "noisy", "spike"],
    "largest step": ["noisy", "spike", "shifted"],
    "moving deviation": ["spike", "shifted"],
    "innovation": ["stuck", "noisy", "spike", "shifted"],
}


def area(anomalous, nominal):
    """Area under the ROC curve: the share of pairs in the right order, ties for half."""
    difference = np.asarray(anomalous)[:, None] - np.asarray(nominal)[None]
    return np.mean((difference > 0) + 0.5 * (difference == 0))


def waves(number, seed, noise_sd=0.1):
    """Sines of 40 samples at random phases, in noise, around 5, of shape `(windows, samples)`."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, (number, 1))
    return (
        5
        + np.sin(2 * np.pi * np.arange(100) / 40 + phases)
        + noise_sd * rng.standard_normal((number, 100))
    ).astype(np.float32)


def one_channel(number, seed):
    """The waves with the axis of channels."""
    return waves(number, seed)[:, :, None]


def anomalous(kind):
    """Windows of one channel, with one kind of anomaly."""
    windows = waves(60, 1, noise_sd=0.4 if kind == "noisy" else 0.1)
    if kind == "stuck":
        windows[:, 30:] = windows[:, 30:31]
    elif kind == "spike":
        windows[:, 50] += 3
    elif kind == "shifted":
        windows[:, 40:70] += 3
    return windows[:, :, None]


@pytest.fixture(scope="module", params=DETECTORS)
def fitted(request):
    """The name of a detector, and the detector fitted to 400 nominal windows."""
    return request.param, DETECTORS[request.param](0).fit(one_channel(400, 0))


@pytest.mark.parametrize("anomaly", ["stuck", "noisy", "spike", "shifted"])
def test_planted_anomalies_are_found(fitted, anomaly):
    name, detector = fitted
    nominal, scores = detector.score(one_channel(60, 3)), detector.score(anomalous(anomaly))
    assert scores.shape == nominal.shape == (60,) and np.isfinite(scores).all()
    if anomaly in MUST_SEE[name]:
        assert area(scores, nominal) > 0.95


@pytest.mark.parametrize("name", DETECTORS)
def test_same_seed_same_scores(name):
    training, windows = one_channel(120, 0), one_channel(20, 1)
    first, again, other = (DETECTORS[name](seed).fit(training).score(windows) for seed in (3, 3, 4))
    assert (first == again).all()
    np.testing.assert_allclose(
        first, other, rtol=0.1
    )  # the PCA's solver is random, its components are not


def test_names_on_the_command_line_differ():
    assert option_name("PCA residual") == "pca-residual" and len(
        set(map(option_name, DETECTORS))
    ) == len(DETECTORS)


# several channels


def both_ways(number, seed, noise_sd=0.1):
    """Windows of two channels, of which the second is the first upside down; each has noise of its own."""
    first = waves(number, seed, noise_sd)
    return np.stack(
        [
            first,
            10
            - first
            + noise_sd
            * np.random.default_rng([seed, 1]).standard_normal(first.shape).astype(np.float32),
        ],
        axis=2,
    )


@pytest.mark.parametrize("name", DETECTORS)
def test_an_anomaly_of_one_channel_of_several_is_found(name):
    detector = DETECTORS[name](0).fit(both_ways(400, 0))
    nominal, changed = both_ways(60, 3), both_ways(60, 4)
    for begin, end in ((50, 51), (60, 90)):
        changed[:, begin:end, 1] += 3
    changed[:, 20:60, 1] += np.random.default_rng(9).standard_normal((60, 40))
    scores, plain = detector.score(changed), detector.score(nominal)
    assert scores.shape == plain.shape == (60,) and area(scores, plain) > 0.95


def vector_autoregression(number, seed, samples=120):
    """Two channels: x(t) = A x(t - 1) + e(t), e normal with correlation 0.6."""
    rng = np.random.default_rng(seed)
    values = rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], (number, samples + 50))
    for t in range(1, samples + 50):
        values[:, t] += values[:, t - 1] @ np.array([[0.7, 0.2], [-0.3, 0.5]]).T
    return values[:, 50:] + [5.0, -30.0]


def test_innovations_of_a_known_vector_autoregression_are_white_and_those_of_another_time_are_not():
    detector = Innovation(order=2).fit(vector_autoregression(300, 0))
    fresh = vector_autoregression(300, 1)
    scores = detector.score(fresh)
    assert scores.mean() == pytest.approx(2, rel=0.02)  # one for each channel
    assert scores.std() == pytest.approx(
        np.sqrt(2 * 2 / 118), rel=0.15
    )  # of a mean of 118 sums of two squares
    swapped = np.stack(
        [fresh[:, :, 0], np.roll(fresh[:, :, 1], 150, axis=0)], axis=2
    )  # every channel looks as before
    late = np.stack([fresh[:, :, 0], np.roll(fresh[:, :, 1], 30, axis=1)], axis=2)
    for changed_relation in (swapped, late):
        assert (
            detector.score(changed_relation).mean() > 3
            and area(detector.score(changed_relation), scores) > 0.999
        )
    assert area(LimitCheck().fit(fresh).score(swapped), LimitCheck().fit(fresh).score(fresh)) < 0.6


def test_innovation_of_a_channel_that_is_a_copy_of_another_is_finite():
    windows = waves(100, 0)[:, :, None] * np.ones(2)
    assert np.isfinite(Innovation(4).fit(windows).score(windows)).all()


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
    assert JointMeans().fit(own).score(own).mean() == pytest.approx(
        199 / 200
    )  # a covariance times its inverse, of n - 1 in n
    common = rng.standard_normal((2_000, 1, 1))
    windows = common + 0.1 * rng.standard_normal((2_000, 20, 2))
    apart = windows[:1].copy()
    apart[:, :, 1] += (
        0.5  # half the deviation of the channel, twenty of the difference of two means
    )
    assert JointMeans().fit(windows).score(apart)[0] > 10


def test_both_a_short_change_and_a_lasting_one_are_far():
    rng = np.random.default_rng(2)
    windows = rng.standard_normal((4_000, 40, 2))
    short, lasting = windows[:500].copy(), windows[:500].copy()
    short[:, 10:20, 0] += (
        1.6  # 5 deviations of the mean of a quarter, 2.5 of the mean of the window
    )
    lasting[:, :, 0] += 0.8  # 2.5 deviations of the mean of each quarter, 5 of that of the window
    detector = JointSize().fit(windows)
    for changed in (short, lasting):
        assert np.mean(detector.score(changed) > np.quantile(detector.score(windows), 0.99)) > 0.8


# the size of residuals


def sizes_of(sds, seed=0):
    """Sizes of windows of 100 samples of white noise with these standard deviations."""
    return root_mean_square(
        np.asarray(sds)[:, None] * np.random.default_rng(seed).standard_normal((len(sds), 100))
    )


def test_the_factor_is_the_median_of_past_sizes_within_its_bounds():
    sizes = np.concatenate([np.ones(20), np.full(100, 1.2), np.full(100, 5.0), np.full(100, 0.5)])
    expected = np.ones(320)
    for number in range(24, 320):
        past = sizes[max(0, number - 8 - 64) : number - 8]
        expected[number] = min(max(np.median(past), 1.0), 1.5)
    np.testing.assert_allclose(following_drift(sizes, 1.0, 1.5), sizes / expected)
    np.testing.assert_array_equal(following_drift(sizes, 1.0, 1.0), sizes)


def test_the_scale_follows_slow_drift_but_no_fault_beyond_the_bound():
    typical = np.median(sizes_of(np.ones(400)))
    threshold = np.quantile(following_drift(sizes_of(np.ones(400), 1), typical), 0.99)
    slow = sizes_of(np.linspace(1, 1.45, 600), 2)  # within the bound of 1.5
    assert (
        np.mean(following_drift(slow, typical) > threshold) < 0.1
        and np.mean(slow > threshold) > 0.5
    )
    lasting = sizes_of(
        np.concatenate([np.ones(200), np.full(1_000, 2.5)]), 3
    )  # larger than bound times threshold, however long it lasts
    assert threshold * 1.5 < 1.9 and (following_drift(lasting, typical)[200:] > threshold).all()
