"""Detectors of the studies: neighbours by hand, what a support vector machine and networks find,
and the draws of the seed.
"""

import numpy as np
import pytest

from studies.common.detectors import (
    DETECTORS,
    ConvolutionalAutoencoder,
    NearestNeighbours,
)
from tests.studies.common.test_plain_detectors import waves


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if "autoencoder" in name else [])
        for name in DETECTORS
    ],
)
def test_louder_noise_is_found_and_the_seed_gives_the_scores(name):
    training, nominal, noisy = waves(200, 0), waves(40, 3), waves(40, 1, noise_sd=0.4)
    first, again, other = (DETECTORS[name](seed).fit(training) for seed in (3, 3, 4))
    assert np.mean(first.score(noisy)[:, None] > first.score(nominal)) > 0.95
    np.testing.assert_array_equal(first.score(nominal), again.score(nominal))
    if "autoencoder" in name or "forest" in name:
        assert (first.score(nominal) != other.score(nominal)).any()


def test_distance_to_the_neighbours_by_hand():
    training = np.array([[0.0, 0], [3, 4], [0, 1], [100, 100]])
    detector = NearestNeighbours(num_neighbours=2).fit(training)
    assert detector.score(np.array([[0.0, 0], [6, 8], [100, 100]])) == pytest.approx(
        [0.5, (5 + np.hypot(6, 7)) / 2, np.hypot(97, 96) / 2]
    )
    assert NearestNeighbours(9).fit(training).score(training[:1]) == pytest.approx(
        (0 + 5 + 1 + np.hypot(100, 100)) / 4
    )
    # a large offset leaves the distances as they are
    assert NearestNeighbours(2).fit(training + 2.0**30).score(
        np.array([[6.0, 8]]) + 2.0**30
    ) == pytest.approx((5 + np.hypot(6, 7)) / 2)


def test_autoencoders_take_several_channels_one_after_the_other():
    windows = np.stack([waves(40, 0), -waves(40, 1)], axis=2)[:, :63]  # of odd length
    joined = np.concatenate([windows[:, :, 0], windows[:, :, 1]], axis=1)
    both = (
        ConvolutionalAutoencoder(epochs=1, seed=2).fit(each).score(each)
        for each in (windows, joined)
    )
    np.testing.assert_array_equal(*both)
