"""Known noise processes, which serve as ground truth for learned noise.

Each process generates noise of any length and mean zero, knows its overall `standard_deviation`, and estimates its own
parameters from windows. Generated noise is evaluated as in Wunderlich and Sklar (2023): if a generator has learnt a process,
the parameters estimated from its noise are those of the process.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class NoiseProcess(Protocol):
    """Interface of all processes. Parameters are the fields of the class; `standard_deviation` is that of the whole process."""

    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; a process may depend on a `signal` of this shape."""

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """The parameters by name, from noise of shape `(windows, samples)` without knowing them."""


@dataclass(frozen=True)
class WhiteNoise:
    """Independent Gaussian noise of a `standard_deviation`."""

    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`."""
        return rng.normal(0.0, self.standard_deviation, num_samples)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """The standard deviation."""
        return {"standard_deviation": float(np.std(windows, dtype=np.float64))}


@dataclass(frozen=True)
class AutoregressiveNoise:
    """Gaussian AR(1) noise: each sample is `coefficient` times the last one plus an independent draw."""

    coefficient: float
    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`, stationary from its first sample."""
        return self.standard_deviation * first_order(num_samples, self.coefficient, rng)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """The lag-1 correlation and the standard deviation."""
        from enhsim_tf.realism.measures import autocorrelation

        return {"coefficient": float(autocorrelation(windows, 1)[1])} | WhiteNoise.estimate(windows)


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

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """The exponent by Whittle's likelihood of the mean periodogram, against its exact expectation; and the sd."""
        from scipy.optimize import minimize_scalar

        samples = np.shape(windows)[1]
        periodogram = np.mean(np.abs(np.fft.rfft(np.asarray(windows, np.float64), axis=1)[:, 1:]) ** 2, axis=0)
        taper = 1 - np.arange(samples) / samples

        def loss(hurst: float) -> float:
            covariance = taper * _fractional_autocovariance(hurst, samples)
            expected = 2 * np.fft.rfft(covariance).real[1:] - covariance[0]
            return np.log(np.mean(periodogram / expected)) + np.mean(np.log(expected))

        return {"hurst": float(minimize_scalar(loss, bounds=(0.01, 0.99), method="bounded").x)} | WhiteNoise.estimate(windows)


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

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Maximum likelihood of a Gaussian, to which some samples add one exponential pulse.

        By expectation and maximisation; two pulses on one sample are not foreseen, which matters above a rate of about 0.1.
        """
        from scipy.special import log_ndtr

        values, share, sd = _grouped(windows)
        place, probability, amplitude = float(np.median(windows)), 0.01, 5 * sd
        for _ in range(500):
            above = values - place
            middle = above - sd**2 / amplitude  # a pulse's size, given its sample, is a Gaussian around it, cut off at zero
            log_cut = log_ndtr(middle / sd)
            log_pulse = -np.log(amplitude) - above / amplitude + sd**2 / (2 * amplitude**2) + log_cut
            log_none = -0.5 * (above / sd) ** 2 - np.log(sd * np.sqrt(2 * np.pi))
            has_pulse = share * _posterior(probability, log_pulse, log_none)
            hazard = sd * np.exp(-0.5 * (middle / sd) ** 2 - log_cut) / np.sqrt(2 * np.pi)
            size = middle + hazard
            spread = np.maximum(sd**2 - hazard * middle - hazard**2, 0)
            before, probability = probability, np.clip(has_pulse.sum(), 1e-12, 1 - 1e-12)
            amplitude = max((has_pulse * size).sum() / probability, 1e-3 * sd)
            place = (share * values).sum() - (has_pulse * size).sum()
            above = values - place
            sd = np.sqrt(((share - has_pulse) * above**2 + has_pulse * ((above - size) ** 2 + spread)).sum())
            if abs(probability - before) < 1e-6 * before:
                break
        return {"rate": float(-np.log1p(-probability)), "amplitude": float(amplitude), "background_sd": float(sd)}


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

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Maximum likelihood of a mixture of two Gaussians of mean zero, by expectation and maximisation."""
        values, share, narrow = _grouped(windows)
        wide, probability = 5 * narrow, 0.01
        for _ in range(500):
            logs = [-0.5 * (values / sd) ** 2 - np.log(sd) for sd in (wide, narrow)]
            has_impulse = share * _posterior(probability, *logs)
            before, probability = probability, np.clip(has_impulse.sum(), 1e-12, 1 - 1e-12)
            wide = np.sqrt((has_impulse * values**2).sum() / probability)
            narrow = np.sqrt(((share - has_impulse) * values**2).sum() / (1 - probability))
            if abs(probability - before) < 1e-6 * before:
                break
        impulse = np.sqrt(max(wide**2 - narrow**2, 0))
        return {"probability": float(probability), "impulse_sd": float(impulse), "background_sd": float(narrow)}


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

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """From the covariance of the logarithm of absolute values: that of the scale, since the Gaussian factor has none.

        An exponential through its lags up to half a window; a correlation much longer than the window is told but roughly.
        """
        from scipy.optimize import curve_fit

        from enhsim_tf.realism.measures import lagged_products

        logs = np.log(np.abs(np.asarray(windows, np.float64)) + 1e-12)
        lag = np.arange(1.0, logs.shape[1] // 2 + 1)
        covariance = lagged_products(logs, len(lag)).mean(axis=0)[1:]
        bounds = ([0.0, 0.5], [np.inf, 1000.0 * len(lag)])
        start = (max(covariance[: 1 + len(lag) // 10].mean(), 1e-6), float(len(lag)))
        (level, decay), _ = curve_fit(lambda k, level, decay: level * np.exp(-k / decay), lag, covariance, start, bounds=bounds)
        return {"log_scale_sd": float(np.sqrt(level)), "correlation_samples": float(decay)} | WhiteNoise.estimate(windows)


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


def _posterior(probability: float, log_first: np.ndarray, log_second: np.ndarray) -> np.ndarray:
    """Probability of the first of two components, given the logarithms of their densities."""
    from scipy.special import expit

    return expit(np.log(probability) - np.log1p(-probability) + log_first - log_second)


def _grouped(windows: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Values rounded to a fiftieth of their robust sd, the share of samples at each, and that sd, which pulses do not move."""
    values = np.asarray(windows, np.float64).ravel()
    sd = max(float(np.diff(np.quantile(values, [0.1587, 0.8413]))[0]) / 2, 1e-12)  # two sd of a Gaussian apart
    cells, counts = np.unique(np.rint(values * (50 / sd)), return_counts=True)
    return cells * (sd / 50), counts / values.size, sd


_HALF = float(np.sqrt(0.005))  # half the variance of noise of standard deviation 0.1
NOISES: dict[str, NoiseProcess] = {
    "white": WhiteNoise(0.1),
    "autoregressive": AutoregressiveNoise(0.7, 0.1),
    "heteroscedastic": HeteroscedasticNoise(0.8, 0.1),
    "shot": ShotNoise(0.01, 0.5, _HALF),
    "fractional": FractionalGaussianNoise(0.8, 0.1),
    "bernoulli": BernoulliGaussianNoise(0.01, 10 * _HALF, _HALF),
}
