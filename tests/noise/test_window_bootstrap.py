"""Residual windows drawn again: whole windows stay real, a series has the same scale at its seams,
and noise can follow the signal.
"""

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.signal import lfilter

from enhsim_tf.noise.registry import noise_model
from enhsim_tf.noise.window_bootstrap import WindowBootstrap


def ar1(num_windows, window, coefficient=0.9, seed=0):
    draws = default_rng(seed).standard_normal((num_windows, window + 100))
    return lfilter([1.0], [1.0, -coefficient], draws)[:, 100:].astype(np.float32)


@pytest.mark.parametrize("follows_signal", [False, True])
def test_all_channels_are_those_of_one_window(follows_signal):
    # the channels of a window belong together
    levels = np.ones((20, 40, 2)) * default_rng(0).standard_normal((20, 1, 1)) * [1.0, -3.0]
    noise = (
        WindowBootstrap.fit(levels, np.zeros((20, 40, 2)))
        if follows_signal
        else WindowBootstrap(levels)
    )
    drawn = noise.generate(60, default_rng(3), np.zeros((60, 40, 2)))
    assert {row.tobytes() for row in drawn} <= {row.tobytes() for row in noise.windows}
    series = noise.generate_series(500, default_rng(0), np.zeros((500, 2)))
    assert series.shape == (500, 2) and np.ptp(series) > 1
    np.testing.assert_allclose(series[:, 1], -3 * series[:, 0], atol=1e-5)


def test_every_channel_of_a_signal_counts_whatever_its_unit():
    signal = np.stack(
        [1e-6 * sines(400, 80, 1), np.full((400, 80), 1e3) + 1e-3 * sines(400, 80, 2)], axis=2
    )
    windows = (signal - signal.mean(axis=(0, 1))) / signal.std(axis=(0, 1))
    drawn = WindowBootstrap.fit(windows, signal).generate(400, default_rng(3), signal)
    for channel in range(2):
        assert np.corrcoef(drawn[:, :, channel].ravel(), windows[:, :, channel].ravel())[0, 1] > 0.8


@pytest.mark.parametrize("follows_signal", [False, True])
def test_windows_are_drawn_with_replacement_and_all_equally_often(follows_signal):
    windows, signal = ar1(20, 40), np.zeros((4_000, 40))
    noise = (
        WindowBootstrap.fit(windows, signal[:20]) if follows_signal else WindowBootstrap(windows)
    )
    _, counts = np.unique(noise.generate(4_000, default_rng(3), signal), axis=0, return_counts=True)
    # binomial counts of mean 200 and sd 14
    assert len(counts) == 20 and 130 < counts.min() < 190 and 210 < counts.max() < 270


def test_noise_of_the_name_none_is_zero_and_an_unknown_name_is_refused(refused):
    windows = np.ones((30, 40, 2), np.float32)
    none = noise_model("none").fit(windows, windows)
    assert not none.generate_series(90, default_rng(0), np.zeros((90, 2))).any()
    with refused("'pink'"):
        noise_model("pink")


def test_a_mean_stays_constant_across_seams():
    np.testing.assert_allclose(
        WindowBootstrap(np.full((5, 400), 3.0)).generate_series(2_000, default_rng(0)),
        3.0,
        rtol=1e-6,
    )


def sines(num_windows, window, seed=0, period=40):
    """Windows of a sine that begin at random phases."""
    begins = default_rng(seed).integers(0, period, num_windows)
    return np.sin(2 * np.pi * (begins[:, None] + np.arange(window)) / period)


def loud_where_high(signal, seed=1):
    """White noise of standard deviation 1.1 + signal."""
    return (1.1 + signal) * default_rng(seed).standard_normal(np.shape(signal))


def test_matched_windows_are_real_ones_of_the_nearest_signals():
    signal, windows = sines(400, 80), default_rng(2).standard_normal((400, 80)).astype(np.float32)
    drawn = WindowBootstrap.fit(windows, signal).generate(400, default_rng(3), signal)
    rows = [np.flatnonzero((windows == each).all(axis=1))[0] for each in drawn]
    phases = signal[:, :40].argmax(axis=1)
    apart = np.abs((phases[rows] - phases + 20) % 40 - 20)
    # 20 of 400 windows: at most two of 40 phases away
    assert apart.max() <= 2


def test_matched_noise_follows_the_signal_and_whole_windows_do_not():
    signal = sines(2_000, 80)
    noise, new = loud_where_high(signal), sines(3_000, 80, seed=5)
    matched = WindowBootstrap.fit(noise, signal).generate(3_000, default_rng(3), new)
    whole = WindowBootstrap(noise).generate(3_000, default_rng(3))
    for low, high in ((-1, -0.8), (-0.1, 0.1), (0.8, 1)):
        there = (new >= low) & (new <= high)
        truth = np.sqrt(np.mean((1.1 + new[there]) ** 2))
        assert matched[there].std() == pytest.approx(truth, rel=0.15 if low > -0.5 else 0.5)
        assert whole[there].std() == pytest.approx(noise.std(), rel=0.05)


def test_a_matched_series_keeps_scale_and_mean_across_seams():
    signal = sines(2_000, 80)
    # of the enhancer: the same in every period
    error = 0.5 * np.cos(2 * np.pi * np.arange(4_000) / 40)
    series_signal = np.sin(2 * np.pi * np.arange(4_000) / 40)
    windows = loud_where_high(signal) + 0.5 * np.gradient(signal, axis=1) * 40 / (2 * np.pi)
    noise = WindowBootstrap.fit(windows, signal)
    series = np.stack(
        [noise.generate_series(4_000, default_rng(seed), series_signal) for seed in range(60)]
    )
    # sums of squared weights are one, so that neither the scale nor the error of the enhancer is
    # larger at seams
    # standard error at the loudest phase: 0.27
    assert np.abs(series.mean(axis=0) - error).max() < 0.3 * 4
    assert np.polyfit(error, series.mean(axis=0), 1)[0] == pytest.approx(1, abs=0.05)
    spread = series.reshape(60, 100, 40).std(axis=(0, 1))
    np.testing.assert_allclose(spread, 1.1 + series_signal[:40], atol=0.12)


def test_a_signal_of_another_shape_is_refused(refused):
    noise = WindowBootstrap.fit(ar1(30, 40), sines(30, 40))
    for draw in (
        lambda: noise.generate(3, default_rng(0)),
        lambda: noise.generate(3, default_rng(0), sines(4, 40)),
        lambda: noise.generate_series(90, default_rng(0), np.zeros(80)),
    ):
        with refused("signal"):
            draw()
