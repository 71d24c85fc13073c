"""The size of residuals: hand-worked factors, and the bound on what they absorb."""

import numpy as np
import pytest

from enhsim_tf.detection.residual_size import ResidualSize, root_mean_square


def sizes_of(sds, seed=0):
    """Sizes of windows of 100 samples of white noise with these standard deviations."""
    return root_mean_square(np.asarray(sds)[:, None] * np.random.default_rng(seed).standard_normal((len(sds), 100)))


def test_the_size_is_the_root_mean_square():
    np.testing.assert_allclose(root_mean_square([[3.0, -4.0], [0.0, 0.0]]), [np.sqrt(12.5), 0.0])


def test_the_factor_is_the_median_of_past_sizes_within_its_bounds():
    sizes = np.concatenate([np.ones(20), np.full(100, 1.2), np.full(100, 5.0), np.full(100, 0.5)])
    detector = ResidualSize(1.5).fit_sizes(np.ones(10))
    expected = np.ones(320)
    for number in range(24, 320):
        past = sizes[max(0, number - 8 - 64) : number - 8]
        expected[number] = min(max(np.median(past), 1.0), 1.5)
    np.testing.assert_allclose(detector.score_sizes(sizes), sizes / expected)
    np.testing.assert_array_equal(ResidualSize(1).fit_sizes(np.ones(10)).score_sizes(sizes), sizes)


def test_the_scale_follows_slow_drift_but_no_fault_beyond_the_bound():
    detector = ResidualSize().fit_sizes(sizes_of(np.ones(400)))
    threshold = np.quantile(detector.score_sizes(sizes_of(np.ones(400), 1)), 0.99)
    slow = sizes_of(np.linspace(1, 1.45, 600), 2)  # within the bound of 1.5
    assert np.mean(detector.score_sizes(slow) > threshold) < 0.1 and np.mean(slow > threshold) > 0.5
    lasting = sizes_of(np.concatenate([np.ones(200), np.full(1_000, 2.5)]), 3)  # larger than bound times threshold, however long it lasts
    assert threshold * detector.bound < 1.9 and (detector.score_sizes(lasting)[200:] > threshold).all()


@pytest.mark.parametrize("bound", [0.9, np.inf, np.nan])
def test_a_bound_out_of_range_is_refused(refused, bound):
    with refused("bound"):
        ResidualSize(bound)
