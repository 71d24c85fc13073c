"""The size of residuals: hand-worked factors, and the bound on what they absorb."""

import numpy as np
import pytest

from enhsim_tf.detection.residual_size import ResidualSize, root_mean_square


def noise(sds, samples=100, seed=0):
    return np.asarray(sds)[:, None] * np.random.default_rng(seed).standard_normal((len(sds), samples))


def test_the_size_is_the_root_mean_square():
    np.testing.assert_allclose(root_mean_square([[3.0, -4.0], [0.0, 0.0]]), [np.sqrt(12.5), 0.0])


def test_the_factor_is_the_median_of_past_sizes_within_its_bounds():
    sizes = np.concatenate([np.ones(20), np.full(100, 1.2), np.full(100, 5.0), np.full(100, 0.5)])
    detector = ResidualSize(bound=1.5, overlap=8, memory=64).fit_sizes(np.ones(10))
    expected = np.ones(320)
    for number in range(24, 320):
        past = sizes[max(0, number - 8 - 64) : number - 8]
        expected[number] = min(max(np.median(past), 1.0), 1.5)
    np.testing.assert_allclose(detector.factors(sizes), expected)
    np.testing.assert_allclose(detector.score_sizes(sizes), sizes / expected)
    np.testing.assert_array_equal(ResidualSize(bound=1).fit_sizes(np.ones(10)).score_sizes(sizes), sizes)


def test_the_scale_follows_slow_drift_but_no_fault_beyond_the_bound():
    detector = ResidualSize().fit(noise(np.ones(400)))
    threshold = np.quantile(detector.score(noise(np.ones(400), seed=1)), 0.99)
    slow = np.linspace(1, 1.45, 600)  # within the bound of 1.5
    assert np.mean(detector.score(noise(slow, seed=2)) > threshold) < 0.1
    assert np.mean(ResidualSize(1).fit(noise(np.ones(400))).score(noise(slow, seed=2)) > threshold) > 0.5
    lasting = np.concatenate([np.ones(200), np.full(1_000, 2.5)])  # larger than bound times threshold, however long it lasts
    assert threshold * detector.bound < 1.9
    assert (detector.score(noise(lasting, seed=3))[200:] > threshold).all()


@pytest.mark.parametrize("options", [{"bound": 0.9}, {"bound": np.inf}, {"bound": np.nan}, {"overlap": -1}, {"memory": 0}])
def test_settings_out_of_range_are_refused(refused, options):
    with refused("bound"):
        ResidualSize(**options)
