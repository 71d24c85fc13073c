"""Residual windows drawn again: whole windows stay real, and a series has the same scale at its seams as elsewhere."""

import numpy as np
import pytest

from enhsim_tf.noise.window_bootstrap import WindowBootstrap


def ar1(num_windows, window, coefficient=0.9, seed=0):
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((num_windows, window))
    noise[:, 0] /= np.sqrt(1 - coefficient**2)
    for place in range(1, window):
        noise[:, place] += coefficient * noise[:, place - 1]
    return noise.astype(np.float32)


def test_windows_are_real_ones():
    windows = ar1(20, 40)
    drawn = WindowBootstrap(windows).generate(100, 3)
    assert drawn.shape == (100, 40) and {row.tobytes() for row in drawn} <= {row.tobytes() for row in windows}


def test_the_scale_is_constant_across_seams():
    noise = WindowBootstrap(ar1(3_000, 40))
    series = np.stack([noise.generate_series(120, seed) for seed in range(4_000)])
    scale = series.std(axis=0)
    assert scale.mean() == pytest.approx(noise.scale, rel=0.02)
    assert np.abs(scale / scale.mean() - 1).max() < 0.06  # five standard errors of 4,000 draws


def test_a_series_has_no_steps_at_seams():
    noise = WindowBootstrap(np.random.default_rng(0).standard_normal((500, 1)) * np.ones((500, 40)))  # each window is one level
    series = noise.generate_series(20_000, 0)
    assert np.abs(np.diff(series)).max() < 0.7 and series.std() == pytest.approx(1, abs=0.1)


def test_neighbouring_samples_are_correlated_as_in_the_windows():
    series = WindowBootstrap(ar1(500, 200)).generate_series(100_000, 1)
    assert np.corrcoef(series[1:], series[:-1])[0, 1] == pytest.approx(0.9, abs=0.01)


def test_same_seed_same_noise():
    noise = WindowBootstrap(ar1(20, 40))
    for draw in (noise.generate, noise.generate_series):
        np.testing.assert_array_equal(draw(77, 5), draw(77, 5))
        assert not np.array_equal(draw(77, 5), draw(77, 6))


@pytest.mark.parametrize("windows", [np.zeros((0, 40)), np.zeros(40), np.full((2, 40), np.nan), np.zeros((3, 2))])
def test_unusable_windows_are_refused(refused, windows):
    with refused("windows of noise"):
        WindowBootstrap(windows)
