"""Each family of noise has the moments and the memory of its closed form."""

import numpy as np
import pytest

from studies.common import noise_processes as noises
from studies.common.example import draw_noise
from studies.common.noise_processes import GALLERY

# mean of a million samples, in the unit of the signal
SLOW = {"fractional": 0.03, "one_over_f": 0.03, "telegraph": 0.01}
# the mean square of t noise with three degrees of freedom has no variance of its own; slow families
# have few independent samples
WIDE = {
    "heteroscedastic": 0.3,
    "heavy_tails": 0.1,
    "one_over_f": 0.1,
    "loudness": 0.04,
    "bursts": 0.04,
    "telegraph": 0.02,
}


def rng(seed=0):
    return np.random.default_rng(seed)


def covariance(series, lag):
    return np.mean(series[: len(series) - lag] * series[lag:])


@pytest.mark.parametrize("name", GALLERY)
def test_families_have_mean_zero_and_the_standard_deviation_that_is_asked_for_and_their_owner_draws(
    name,
):
    signal, process = rng(3).normal(0, noises._SIGNAL_SD, 1_000_000), GALLERY[name]
    noise = draw_noise(name, signal, 0.1, rng())
    assert noise.shape == (1_000_000,) and noise.dtype == np.float64
    # rounding adds 1 % to quantised noise
    assert process.standard_deviation == pytest.approx(0.1, rel=0.02)
    assert np.std(noise) == pytest.approx(0.1, rel=WIDE.get(name, 0.02))
    assert np.mean(noise) == pytest.approx(0, abs=SLOW.get(name, 0.002))
    owner, signal = rng(7), signal[:300]
    first = draw_noise(name, signal, 0.1, owner)
    assert (draw_noise(name, signal, 0.1, rng(7)) == first).all()
    assert (draw_noise(name, signal, 0.1, owner) != first).any()


@pytest.mark.parametrize("coefficient", [-0.5, 0.7, 0.95])
def test_autoregressive_memory_falls_as_powers(coefficient):
    noise = noises.autoregressive(400_000, rng(), coefficient=coefficient, sd=2.0)
    measured = [covariance(noise, lag) / 4 for lag in range(6)]
    independent = 400_000 * (1 - coefficient**2) / (1 + coefficient**2)
    assert measured == pytest.approx(coefficient ** np.arange(6), abs=5 * np.sqrt(2 / independent))


def test_autoregressive_noise_is_stationary_from_its_first_sample():
    owner = rng()
    draws = np.stack([noises.first_order(4, 0.95, owner) for _ in range(4_000)])
    assert np.std(draws, axis=0) == pytest.approx(np.ones(4), rel=5 / np.sqrt(2 * 4_000))


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_fractional_noise_has_its_autocovariance_and_scaling_law(hurst):
    owner, samples = rng(), 64
    draws = np.stack([noises.fractional(samples, owner, hurst=hurst, sd=1.0) for _ in range(4_000)])
    lag = np.arange(8.0)
    expected = 0.5 * (
        np.abs(lag + 1) ** (2 * hurst) - 2 * lag ** (2 * hurst) + np.abs(lag - 1) ** (2 * hurst)
    )
    measured = [np.mean(draws[:, 0] * draws[:, int(k)]) for k in lag]
    assert measured == pytest.approx(expected, abs=5 * np.sqrt(2 / 4_000))
    # the mean of n samples has the standard deviation n^(hurst - 1)
    assert np.std(draws.mean(axis=1)) == pytest.approx(
        samples ** (hurst - 1), rel=5 / np.sqrt(2 * 4_000)
    )


def test_shot_noise_has_its_cumulants_and_its_tail():
    noise = noises.shot(2_000_000, rng(), rate=0.02, amplitude=0.5, background_sd=0.1)
    # a pulse has a mean square of twice its squared mean
    assert np.var(noise) == pytest.approx(2 * 0.02 * 0.5**2 + 0.1**2, rel=0.02)
    assert np.mean(noise**3) == pytest.approx(6 * 0.02 * 0.5**3, rel=0.1)
    # far above the background only pulses are left: exp(-x / amplitude) of them, twice the rate
    # giving a little more
    assert np.mean(noise > 1.5) == pytest.approx(0.02 * np.exp(-1.5 / 0.5), rel=0.15)


def test_heteroscedastic_scale_is_a_slow_gaussian_process():
    noise = noises.heteroscedastic(2_000_000, rng(), log_scale_sd=0.5, sd=2.0, correlation=20)
    assert np.mean(noise**4) / np.mean(noise**2) ** 2 == pytest.approx(
        3 * np.exp(4 * 0.5**2), rel=0.15
    )
    logs = np.log(np.abs(noise))
    logs -= logs.mean()
    # the logarithm of the absolute value of a Gaussian has variance pi^2 / 8 and no memory
    expected = [0.25 + np.pi**2 / 8, *(0.25 * np.exp(-np.array([1, 5, 20, 60]) / 20))]
    assert [covariance(logs, lag) for lag in (0, 1, 5, 20, 60)] == pytest.approx(expected, abs=0.01)
    assert covariance(noise, 1) / 4 == pytest.approx(0, abs=0.01)


def test_one_over_f_noise_has_the_power_of_its_law_in_each_octave():
    series = noises.one_over_f(2**20, rng(1), longest=4_096.0, sd=1.0)
    power, frequency = np.abs(np.fft.rfft(series)) ** 2, np.fft.rfftfreq(len(series))
    octaves = [
        power[(frequency > low) & (frequency <= 2 * low)].sum() for low in 2.0 ** -np.arange(3, 10)
    ]
    # one over f: the same power in every octave
    np.testing.assert_allclose(octaves, np.mean(octaves), rtol=0.1)


def test_noise_that_follows_the_signal_needs_one():
    with pytest.raises(ValueError, match=r"Received: one of shape \(9,\)"):
        GALLERY["signal_dependent"].draw(10, rng(), np.zeros(9))
