"""Each process has the moments and the memory of its closed form."""

import numpy as np
import pytest

from studies.common.noise_processes import (
    NOISES,
    AutoregressiveNoise,
    BernoulliGaussianNoise,
    FractionalGaussianNoise,
    HeteroscedasticNoise,
    ShotNoise,
    WhiteNoise,
)


def rng(seed=0):
    return np.random.default_rng(seed)


def covariance(series, lag):
    return np.mean(series[: len(series) - lag] * series[lag:])


@pytest.mark.parametrize("name", NOISES)
def test_environments_have_mean_zero_and_the_same_standard_deviation(name):
    noise = NOISES[name].draw(2_000_000, rng())
    assert noise.shape == (2_000_000,) and noise.dtype == np.float64
    assert NOISES[name].standard_deviation == pytest.approx(0.1)
    # slow processes have few independent samples: 1,000 correlation times of an exponential of sd 1.6
    assert np.std(noise) == pytest.approx(0.1, rel={"heteroscedastic": 0.25, "shot": 0.02, "bernoulli": 0.02}.get(name, 0.01))
    assert np.mean(noise) == pytest.approx(0, abs=0.03 if name == "fractional" else 0.001)


@pytest.mark.parametrize("name", NOISES)
def test_the_owner_draws_and_moves_on(name):
    process, owner = NOISES[name], rng(7)
    first, again, other = process.draw(300, rng(7)), process.draw(300, rng(7)), process.draw(300, rng(8))
    assert (first == again).all() and (first != other).any()
    assert (process.draw(300, owner) == first).all() and (process.draw(300, owner) != first).any()


def test_white_noise_is_what_the_generator_draws():
    assert (WhiteNoise(0.3).draw(50, rng(7)) == rng(7).normal(0, 0.3, 50)).all()


def test_white_noise_has_its_standard_deviation_and_no_memory():
    number, sd = 100_000, 0.3
    noise = WhiteNoise(sd).draw(number, rng())
    assert np.std(noise) == pytest.approx(sd, rel=5 / np.sqrt(2 * number))
    assert np.mean(noise) == pytest.approx(0, abs=5 * sd / np.sqrt(number))
    assert covariance(noise, 1) / sd**2 == pytest.approx(0, abs=5 / np.sqrt(number))


@pytest.mark.parametrize("coefficient", [-0.5, 0.7, 0.95])
def test_autoregressive_memory_falls_as_powers(coefficient):
    noise = AutoregressiveNoise(coefficient, 2.0).draw(400_000, rng())
    measured = [covariance(noise, lag) / 4 for lag in range(6)]
    independent = 400_000 * (1 - coefficient**2) / (1 + coefficient**2)
    assert measured == pytest.approx(coefficient ** np.arange(6), abs=5 * np.sqrt(2 / independent))


def test_autoregressive_noise_is_stationary_from_its_first_sample():
    process, owner = AutoregressiveNoise(0.95, 1.0), rng()
    draws = np.stack([process.draw(4, owner) for _ in range(4_000)])
    assert np.std(draws, axis=0) == pytest.approx(np.ones(4), rel=5 / np.sqrt(2 * 4_000))


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_fractional_noise_has_its_autocovariance_and_scaling_law(hurst):
    process, owner, samples = FractionalGaussianNoise(hurst, 1.5), rng(), 64
    draws = np.stack([process.draw(samples, owner) for _ in range(4_000)]) / 1.5
    lag = np.arange(8.0)
    expected = 0.5 * (np.abs(lag + 1) ** (2 * hurst) - 2 * lag ** (2 * hurst) + np.abs(lag - 1) ** (2 * hurst))
    measured = [np.mean(draws[:, 0] * draws[:, int(k)]) for k in lag]
    assert measured == pytest.approx(expected, abs=5 * np.sqrt(2 / 4_000))
    # the mean of n samples has the standard deviation n^(hurst - 1)
    assert np.std(draws.mean(axis=1)) == pytest.approx(samples ** (hurst - 1), rel=5 / np.sqrt(2 * 4_000))


def test_fractional_noise_remembers_over_a_million_samples():
    noise = FractionalGaussianNoise(0.9, 1.0).draw(2**20, rng())
    blocks = noise.reshape(-1, 2**10).mean(axis=1)
    # means of n samples have the variance n^(2 hurst - 2), of which their own mean takes its part
    assert np.var(blocks) == pytest.approx(2.0 ** (10 * -0.2) - 2.0 ** (20 * -0.2), rel=0.2)


def test_shot_noise_has_its_cumulants_and_its_tail():
    process, number = ShotNoise(0.02, 0.5, 0.1), 2_000_000
    noise = process.draw(number, rng())
    assert process.standard_deviation == pytest.approx(np.sqrt(0.01 + 0.01))
    assert np.var(noise) == pytest.approx(0.02, rel=0.02)
    assert np.mean(noise**3) == pytest.approx(6 * 0.02 * 0.5**3, rel=0.1)
    # far above the background only pulses are left: exp(-x / amplitude) of them, twice the rate giving a little more
    assert np.mean(noise > 1.5) == pytest.approx(0.02 * np.exp(-1.5 / 0.5), rel=0.15)


def test_bernoulli_noise_has_its_moments():
    process = BernoulliGaussianNoise(0.02, 1.0, 0.1)
    noise = process.draw(2_000_000, rng())
    assert process.standard_deviation == pytest.approx(np.sqrt(0.02 + 0.01))
    assert np.var(noise) == pytest.approx(0.03, rel=0.02)
    assert np.mean(noise**4) == pytest.approx(3 * (0.02 * 1.01**2 + 0.98 * 0.01**2), rel=0.06)


def test_heteroscedastic_scale_is_a_slow_gaussian_process():
    process = HeteroscedasticNoise(0.5, 2.0, correlation_samples=20)
    noise = process.draw(2_000_000, rng())
    assert np.var(noise) == pytest.approx(4, rel=0.03)
    assert np.mean(noise**4) / np.mean(noise**2) ** 2 == pytest.approx(3 * np.exp(4 * 0.5**2), rel=0.15)
    logs = np.log(np.abs(noise))
    logs -= logs.mean()
    # the logarithm of the absolute value of a Gaussian has variance pi^2 / 8 and no memory
    expected = [0.25 + np.pi**2 / 8, *(0.25 * np.exp(-np.array([1, 5, 20, 60]) / 20))]
    assert [covariance(logs, lag) for lag in (0, 1, 5, 20, 60)] == pytest.approx(expected, abs=0.01)
    assert covariance(noise, 1) / 4 == pytest.approx(0, abs=0.01)
