"""Latent inputs: the same distribution in training and in generation, and series without seams."""

import keras
import numpy as np
import pytest

from enhsim_tf.noise import latent as latent_module
from enhsim_tf.noise.latent import Latent, standard_normal

SLOW = (30.0, 200.0)


def convolution(channels=5, width=7):
    return keras.Sequential([keras.Input((None, channels)), keras.layers.Conv1D(1, width)])


def correlation(series, lag):
    """Pooled over rows; the mean and the variance are known."""
    return np.mean(series[:, lag:] * series[:, : series.shape[1] - lag])


def test_vectors_are_those_of_the_paper():
    generator = keras.Sequential([keras.Input((16,)), keras.layers.Dense(50)])
    latent = Latent(generator, 50, span=2.0)
    expected = np.float32(2.0) * np.random.default_rng(3).standard_normal((4, 16), np.float32)
    np.testing.assert_array_equal(latent.sample(4, np.random.default_rng(3)), expected)
    draws = np.asarray(latent.draw(20_000, keras.random.SeedGenerator(1)))
    assert draws.shape == (20_000, 16) and not latent.is_series
    assert abs(draws.std() - 2.0) < 0.01 and abs(draws.mean()) < 0.02


@pytest.mark.parametrize("way", ["in a training step", "by NumPy"])
def test_channels_have_their_correlation(way):
    latent = Latent(convolution(), 100, span=1.5, slow_samples=SLOW)
    rows = 4_000
    draws = (
        latent.sample(rows, np.random.default_rng(0)) if way == "by NumPy" else np.asarray(latent.draw(rows, keras.random.SeedGenerator(0)))
    )
    assert draws.shape == (rows, 106, 5)
    for channel in range(3):
        assert abs(draws[:, :, channel].std() - 1.5) < 0.01
        assert abs(correlation(draws[:, :, channel], 1)) < 0.02
    for channel, samples in enumerate(SLOW, 3):
        assert abs(draws[:, 0, channel].std() - 1) < 0.04 and abs(draws[:, -1, channel].std() - 1) < 0.04  # stationary
        for lag in (1, 20, 100):
            # 4,000 rows: the standard error is below 1 / sqrt(4,000) = 0.016
            assert abs(correlation(draws[:, :, channel], lag) - np.exp(-lag / samples)) < 0.05
        assert abs(np.mean(draws[:, :, channel] * draws[:, :, 0])) < 0.05


@pytest.mark.parametrize("shape", [(400_001,), (500, 400, 2)])
def test_standard_normal_draws_have_the_distribution_and_its_tails(shape):
    from scipy.stats import kstest, norm

    draws = np.asarray(standard_normal(shape, (3, 4)))
    assert draws.shape == shape and draws.dtype == np.float32
    values = draws.ravel()
    assert kstest(values, norm.cdf).pvalue > 0.001
    for limit in (2.0, 3.0, 4.0):
        expected = len(values) * 2 * norm.sf(limit)
        assert abs(np.sum(np.abs(values) > limit) - expected) < 4 * np.sqrt(expected)  # a count, four standard deviations
    half = len(values) // 2  # sines and cosines of the same angles
    assert abs(np.mean(values[:half] * values[-half:])) < 4 / np.sqrt(half)
    assert abs(np.mean(values[:half] ** 2 * values[-half:] ** 2) - 1) < 4 * np.sqrt(8 / half)
    np.testing.assert_array_equal(standard_normal(shape, (3, 4)), draws)
    assert np.any(np.asarray(standard_normal(shape, (3, 5))) != draws)


def test_rows_do_not_depend_on_how_many_are_drawn():
    latent = Latent(convolution(), 40, slow_samples=SLOW)
    rng = np.random.default_rng(5)
    in_parts = np.concatenate([latent.sample(number, rng) for number in (1, 2, 4)])
    np.testing.assert_array_equal(latent.sample(7, np.random.default_rng(5)), in_parts)


@pytest.mark.parametrize("stretch", [40, 41, 99, 250])
def test_chunks_join_without_seams(stretch, monkeypatch):
    generator = convolution()
    latent = Latent(generator, 40, slow_samples=SLOW)
    whole = np.asarray(generator(next(latent.series_chunks(250, np.random.default_rng(2)))))[0, :, 0]
    monkeypatch.setattr(latent_module, "_CHUNK_SAMPLES", stretch)
    parts = [np.asarray(generator(each))[0, :, 0] for each in latent.series_chunks(250, np.random.default_rng(2))]
    assert [len(part) for part in parts[:-1]] == [stretch] * (len(parts) - 1)
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-5)
    assert len(whole) == 250


def test_slow_channels_of_a_series_are_stationary():
    latent = Latent(convolution(), 40, slow_samples=(20.0,))
    series = next(latent.series_chunks(100_000, np.random.default_rng(0)))[:, :, -1]
    assert abs(series.std() - 1) < 0.05 and abs(correlation(series, 20) - np.exp(-1)) < 0.05
