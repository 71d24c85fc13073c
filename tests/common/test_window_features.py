"""Features of noise and the signal below it: worked by hand on few samples, and without a value for what is not there."""

import numpy as np
import pytest

from enhsim_tf.common.window_features import signal_edges, signal_features


def test_edges_divide_levels_and_slopes_into_thirds():
    signal = np.arange(30.0).reshape(3, 10) ** 2
    edges = signal_edges(signal)
    for values, (low, high) in zip((signal, np.gradient(signal, axis=1)), edges, strict=True):
        assert np.sum(values <= low) == pytest.approx(10, abs=1) and np.sum(values > high) == pytest.approx(10, abs=1)


def test_features_are_mean_and_scale_of_the_noise_at_each_level_and_slope():
    signal = np.array([[0.0, 0, 1, 2, 2, 1, 0, 0]])  # slopes: 0 0.5 1 0.5 -0.5 -1 -0.5 0
    noise = np.array([[1.0, 3, 4, 5, 7, 2, 1, 3]])
    edges = np.array([[0.5, 1.5], [-0.25, 0.25]])
    low, medium, high, falls, flat, rises = signal_features(noise, signal, edges).reshape(6, 2)
    for (mean, log_scale), there in (
        (low, [1, 3, 1, 3]),
        (medium, [4, 2]),
        (high, [5, 7]),
        (falls, [7, 2, 1]),
        (flat, [1, 3]),
        (rises, [3, 4, 5]),
    ):
        assert mean == pytest.approx(np.mean(there)) and log_scale == pytest.approx(np.log(np.mean(np.square(there))) / 2)


def test_what_a_window_does_not_contain_is_taken_from_the_whole_window():
    noise = np.array([[1.0, -1, 2, 2], [0.0, 0, 0, 0]])
    found = signal_features(noise, np.full((2, 4), 5.0), np.array([[0.0, 1.0], [-1.0, 1.0]])).reshape(2, 6, 2)
    np.testing.assert_allclose(found[0], np.tile([1.0, np.log(2.5) / 2], (6, 1)))
    assert np.isfinite(found[1]).all()
