"""Changes at several resolutions, against differences worked out by hand, and the two ways in which they are computed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from enhsim_tf.keras_tools.backend import tf
from enhsim_tf.noise.changes import LEAST_WINDOW, Changes

NOISE = np.random.default_rng(0).standard_normal((50, 64)).astype(np.float32)


def test_sums_of_magnitudes_by_hand():
    window = np.zeros((1, LEAST_WINDOW))
    window[0, 2] = 3.0  # one pulse
    sums = Changes(LEAST_WINDOW).sums(window)
    assert sums.shape == (1, LEAST_WINDOW, 4)  # averages of 1, 2, 4 and 8 samples
    # averages of one sample differ where the pulse comes and where it goes; places before which nothing came have no sum
    assert sums[0, :6, 0].tolist() == [0, 0, 0, 3, 6, 6]
    # averages of two samples: 0 and 1.5, 0 and 1.5, 1.5 and 0, 1.5 and 0
    assert sums[0, :9, 1].tolist() == [0, 0, 0, 1.5, 3, 4.5, 6, 6, 6]


def test_white_noise_has_changes_of_known_size():
    """The difference of two averages of n independent samples has the variance 2 / n, and a mean magnitude of sqrt(2 / pi) times its root."""
    windows = np.random.default_rng(1).standard_normal((4_000, 512))
    changes = Changes(512)
    before = changes.before(np.moveaxis(changes.sums(windows), 2, 0), 500).reshape(-1, 7, 3)  # lengths 1 to 64, spans of 16, 64, 256
    for number, length in enumerate(2 ** np.arange(7)):
        expected = np.sqrt(2 / np.pi) * np.sqrt(2 / length)
        assert np.mean(np.exp(before[:, number, 2])) == pytest.approx(expected, rel=0.01)


def test_training_sees_what_generation_sees():
    changes = Changes(64)
    sums, places = changes.sums(NOISE), np.array([0, 1, 17, 63])
    seen = changes.features(tf.constant(sums), tf.constant(places, tf.int32)).numpy()
    for number, place in enumerate(places):
        assert_allclose(seen[:, number], changes.before(np.moveaxis(sums, 2, 0).astype(np.float64), place), atol=2e-4)
    assert seen.shape == (50, 4, changes.size) and np.ptp(seen[:, 2:], axis=0).min() > 0


def test_changes_of_the_next_sample_are_those_of_the_window_that_contains_it():
    changes = Changes(64)
    total = np.pad(np.cumsum(NOISE, axis=1, dtype=np.float64), [(0, 0), (1, 0)])
    sums = changes.sums(NOISE)
    next_one = changes.magnitudes(total, 40, changes.lengths)
    assert_allclose(sums[:, 39] + next_one, sums[:, 40], rtol=1e-5)
