"""Known noise processes, which serve as ground truth for learned noise.

Each process generates noise of any length and mean zero, and knows its overall `standard_deviation`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class NoiseProcess(Protocol):
    """Interface of all processes. Parameters are the fields of the class; `standard_deviation` is that of the whole process."""

    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; a process may depend on a `signal` of this shape."""


@dataclass(frozen=True)
class WhiteNoise:
    """Independent Gaussian noise of a `standard_deviation`."""

    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`."""
        return rng.normal(0.0, self.standard_deviation, num_samples)


@dataclass(frozen=True)
class AutoregressiveNoise:
    """Gaussian AR(1) noise: each sample is `coefficient` times the last one plus an independent draw."""

    coefficient: float
    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`, stationary from its first sample."""
        return self.standard_deviation * first_order(num_samples, self.coefficient, rng)


@dataclass(frozen=True)
class FractionalGaussianNoise:
    """The increments of fractional Brownian motion: long memory for a `hurst` exponent above 0.5, white at 0.5."""

    hurst: float
    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`, exactly: by circulant embedding (Davies and Harte 1987)."""
        from scipy.fft import irfft, next_fast_len, rfft

        half = next_fast_len(num_samples)
        covariance = _fractional_autocovariance(self.hurst, half + 1)
        power = np.maximum(rfft(np.concatenate([covariance, covariance[-2:0:-1]])).real, 0)  # below zero by rounding only
        spectrum = rng.standard_normal(half + 1) + 1j * rng.standard_normal(half + 1)
        spectrum[[0, -1]] = np.sqrt(2) * spectrum[[0, -1]].real  # real at frequencies that are their own mirror image
        return self.standard_deviation * irfft(np.sqrt(half * power) * spectrum, 2 * half)[:num_samples]


@dataclass(frozen=True)
class ShotNoise:
    """Poisson pulses of one sample on white noise, with the mean of the pulses subtracted.

    Args:
        rate: Pulses a sample.
        amplitude: Mean of the exponentially distributed pulses, in the unit of the signal.
        background_sd: Standard deviation of the white noise.
    """

    rate: float
    amplitude: float
    background_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation: a pulse has a mean square of twice its squared mean."""
        return float(np.sqrt(2 * self.rate * self.amplitude**2 + self.background_sd**2))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`."""
        places = rng.integers(0, num_samples, rng.poisson(self.rate * num_samples))
        pulses = np.bincount(places, rng.exponential(self.amplitude, places.size), minlength=num_samples)
        return pulses - self.rate * self.amplitude + rng.normal(0.0, self.background_sd, num_samples)


@dataclass(frozen=True)
class BernoulliGaussianNoise:
    """White noise to which some samples add a second, larger Gaussian draw.

    Args:
        probability: Share of samples with an impulse.
        impulse_sd: Standard deviation of the impulses, in the unit of the signal.
        background_sd: Standard deviation of the white noise.
    """

    probability: float
    impulse_sd: float
    background_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation."""
        return float(np.sqrt(self.probability * self.impulse_sd**2 + self.background_sd**2))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`."""
        has_impulse = rng.random(num_samples) < self.probability
        return rng.normal(0.0, np.sqrt(self.background_sd**2 + has_impulse * self.impulse_sd**2))


@dataclass(frozen=True)
class HeteroscedasticNoise:
    """Gaussian noise whose logarithm of scale is a slow Gaussian process (Ornstein-Uhlenbeck).

    Args:
        log_scale_sd: Standard deviation of the logarithm of the scale.
        standard_deviation: Overall, in the unit of the signal.
        correlation_samples: Samples after which the correlation of the logarithm of the scale has fallen to 1 / e.
    """

    log_scale_sd: float
    standard_deviation: float
    correlation_samples: float = 2_000.0

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`."""
        log_scale = self.log_scale_sd * first_order(num_samples, np.exp(-1 / self.correlation_samples), rng)
        # the mean of exp(2 l) is exp(2 sd^2), which the scale takes back
        return self.standard_deviation * np.exp(log_scale - self.log_scale_sd**2) * rng.standard_normal(num_samples)


def first_order(num_samples: int, coefficient: float, rng: np.random.Generator) -> np.ndarray:
    """A stationary Gaussian AR(1) process of variance 1."""
    from scipy.signal import lfilter

    step = np.sqrt(1 - coefficient**2)
    draws = step * rng.standard_normal(num_samples)
    draws[:1] /= step
    return lfilter([1.0], [1.0, -coefficient], draws)


def _fractional_autocovariance(hurst: float, num_lags: int) -> np.ndarray:
    """Of fractional Gaussian noise of variance 1; second differences of `lag^(2 hurst)` in a form that keeps their digits."""
    lag = np.arange(1, num_lags, dtype=np.float64)
    with np.errstate(divide="ignore"):  # log(1 - 1) at lag 1 is minus infinity, and its exponential zero
        bend = np.expm1(2 * hurst * np.log1p(1 / lag)) + np.expm1(2 * hurst * np.log1p(-1 / lag))
    return np.concatenate([[1.0], 0.5 * lag ** (2 * hurst) * bend])


_HALF = float(np.sqrt(0.005))  # half the variance of noise of standard deviation 0.1
NOISES: dict[str, NoiseProcess] = {
    "white": WhiteNoise(0.1),
    "autoregressive": AutoregressiveNoise(0.7, 0.1),
    "heteroscedastic": HeteroscedasticNoise(0.8, 0.1),
    "shot": ShotNoise(0.01, 0.5, _HALF),
    "fractional": FractionalGaussianNoise(0.8, 0.1),
    "bernoulli": BernoulliGaussianNoise(0.01, 10 * _HALF, _HALF),
}
