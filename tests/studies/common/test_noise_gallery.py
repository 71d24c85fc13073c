"""Each family of the gallery has the moments of its closed form, and gives its own parameters back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from studies.common import noise_gallery
from studies.common.noise_gallery import GALLERY, LOOKED_AT, OneOverFNoise
from studies.common.noise_processes import NOISES

NEW = [name for name in GALLERY if name not in NOISES]
SIGNAL = np.random.default_rng(3).normal(0, noise_gallery._SIGNAL_SD, 1_000_000)


def windows_of(name, num_windows=1_000, samples=500, seed=0):
    return (
        GALLERY[name]
        .draw(num_windows * samples, np.random.default_rng(seed), SIGNAL[: num_windows * samples])
        .reshape(num_windows, samples)
    )


def test_the_halves_are_the_seeds_draw_and_divide_the_gallery():
    unknown = [
        "one_over_f", "interference", "telegraph", "quantised", "bursts", "heavy_tails", "loudness", "signal_dependent",
        "fractional", "bernoulli",
    ]  # fmt: skip
    drawn = np.random.default_rng(200812082).permutation(unknown)[:3]
    assert set(LOOKED_AT) == {"white", "autoregressive", "heteroscedastic", "shot", *drawn}
    assert set(LOOKED_AT) < set(GALLERY) and 2 * len(LOOKED_AT) == len(GALLERY)


@pytest.mark.parametrize("name", NEW)
def test_families_have_mean_zero_and_the_same_standard_deviation(name):
    noise = windows_of(name)
    assert GALLERY[name].standard_deviation == pytest.approx(0.1, rel=0.02)  # rounding adds 1 % to quantised noise
    # the mean square of t noise with three degrees of freedom has no variance of its own: it converges slowly
    assert np.std(noise) == pytest.approx(GALLERY[name].standard_deviation, rel={"heavy_tails": 0.1, "one_over_f": 0.1}.get(name, 0.04))
    assert abs(np.mean(noise)) < {"one_over_f": 0.03, "telegraph": 0.01}.get(name, 0.002)


@pytest.mark.parametrize("name", NEW)
def test_the_owner_draws(name):
    first, again, other = windows_of(name, 2, 300, 7), windows_of(name, 2, 300, 7), windows_of(name, 2, 300, 8)
    assert (first == again).all() and (first != other).any()


def test_one_over_f_noise_has_the_power_of_its_law_in_each_octave():
    series = OneOverFNoise(1.0, 4_096.0, 1.0).draw(2**20, np.random.default_rng(1))
    power, frequency = np.abs(np.fft.rfft(series)) ** 2, np.fft.rfftfreq(len(series))
    octaves = [power[(frequency > low) & (frequency <= 2 * low)].sum() for low in 2.0 ** -np.arange(3, 10)]
    assert_allclose(octaves, np.mean(octaves), rtol=0.1)  # one over f: the same power in every octave


def test_noise_that_follows_the_signal_needs_one():
    with pytest.raises(ValueError, match=r"Expected a signal of 10 samples\. Received: one of shape \(9,\)\."):
        GALLERY["signal_dependent"].draw(10, np.random.default_rng(0), np.zeros(9))
