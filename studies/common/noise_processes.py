"""Families of noise whose truth is known, which serve as ground truth for noise models, and which
of them a designer may look at.

A function of a family draws float64 noise of mean zero and shape `(number,)`. It takes the number
of samples, a random generator, and parameters; one family also takes the signal that the noise is
added to. Standard deviations (`sd`) and amplitudes are in the unit of the signal, times in
samples. With the values here, all families have a standard deviation of 0.1.

The four environments of the study of robustness were known when the convolutional GAN was designed.
A generator that is meant for noise in general must be judged on noise that its designer did not
use. The families are therefore divided before any design
work: half of them may be looked at during the design, and the other half are reported on once.
    `LOOKED_AT` contains the four known
environments and three of the other ten families, drawn by
`numpy.random.default_rng(200812082).permutation(...)[:3]`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

NOISES = ("white", "autoregressive", "heteroscedastic", "shot")  # of most studies
LOOKED_AT = (*NOISES, "fractional", "heavy_tails", "one_over_f")
_HALF = float(np.sqrt(0.005))  # half the variance of noise of standard deviation 0.1
_SIGNAL_SD = float(np.sqrt(0.5**2 / 2 + 0.25**2 / 2))  # of the two waves of the example telemetry


def first_order(number: int, coefficient: float, rng: np.random.Generator) -> np.ndarray:
    """A Gaussian AR(1) process of variance 1, stationary from its first sample."""
    from scipy.signal import lfilter

    step = np.sqrt(1 - coefficient**2)
    draws = step * rng.standard_normal(number)
    draws[:1] /= step
    return lfilter([1.0], [1.0, -coefficient], draws)


def white(number: int, rng: np.random.Generator) -> np.ndarray:
    """Independent Gaussian noise."""
    return rng.normal(0.0, 0.1, number)


def autoregressive(
    number: int,
    rng: np.random.Generator,
    coefficient: float = 0.7,
    sd: float = 0.1,
) -> np.ndarray:
    """Gaussian AR(1) noise: each sample is `coefficient` times the last one plus an independent
    draw.
    """
    return sd * first_order(number, coefficient, rng)


def heteroscedastic(
    number: int,
    rng: np.random.Generator,
    log_scale_sd: float = 0.8,
    sd: float = 0.1,
    correlation: float = 2_000.0,
) -> np.ndarray:
    """Gaussian noise whose logarithm of scale is a slow Gaussian process (Ornstein-Uhlenbeck), with
    1 / e left after `correlation`.
    """
    log_scale = log_scale_sd * first_order(number, np.exp(-1 / correlation), rng)
    # the mean of exp(2 l) is exp(2 sd^2), which the scale takes back
    return sd * np.exp(log_scale - log_scale_sd**2) * rng.standard_normal(number)


def shot(
    number: int,
    rng: np.random.Generator,
    rate: float = 0.01,
    amplitude: float = 0.5,
    background_sd: float = _HALF,
) -> np.ndarray:
    """Poisson pulses of one sample, `rate` a sample, with exponential heights of mean `amplitude`,
    less their mean, on white noise.
    """
    places = rng.integers(0, number, rng.poisson(rate * number))
    pulses = np.bincount(places, rng.exponential(amplitude, places.size), minlength=number)
    return pulses - rate * amplitude + rng.normal(0.0, background_sd, number)


def fractional(
    number: int,
    rng: np.random.Generator,
    hurst: float = 0.8,
    sd: float = 0.1,
) -> np.ndarray:
    """The increments of fractional Brownian motion: long memory for a `hurst` exponent above 0.5,
    white at 0.5.

    They are drawn exactly, by circulant embedding (Davies and Harte 1987).
    """
    from scipy.fft import irfft, next_fast_len, rfft

    half = next_fast_len(number)
    lag = np.arange(1, half + 1, dtype=np.float64)
    # log(1 - 1) at lag 1 is minus infinity, and its exponential zero
    with np.errstate(divide="ignore"):
        # second differences of lag^(2 hurst) in a form that keeps their digits
        bend = np.expm1(2 * hurst * np.log1p(1 / lag)) + np.expm1(2 * hurst * np.log1p(-1 / lag))
    covariance = np.concatenate([[1.0], 0.5 * lag ** (2 * hurst) * bend])
    # below zero by rounding only
    power = np.maximum(rfft(np.concatenate([covariance, covariance[-2:0:-1]])).real, 0)
    spectrum = rng.standard_normal(half + 1) + 1j * rng.standard_normal(half + 1)
    # real at frequencies that are their own mirror image
    spectrum[[0, -1]] = np.sqrt(2) * spectrum[[0, -1]].real
    return sd * irfft(np.sqrt(half * power) * spectrum, 2 * half)[:number]


def bernoulli(number: int, rng: np.random.Generator) -> np.ndarray:
    """White noise to which one sample in a hundred adds a second, larger Gaussian draw."""
    probability = 0.01
    impulse_sd = 10 * _HALF
    background_sd = _HALF
    has_impulse = rng.random(number) < probability
    return rng.normal(0.0, np.sqrt(background_sd**2 + has_impulse * impulse_sd**2))


def one_over_f(
    number: int,
    rng: np.random.Generator,
    longest: float = 4_000.0,
    sd: float = 0.1,
) -> np.ndarray:
    """Gaussian noise whose power falls with the frequency (flicker noise), and is flat below that
    of the period `longest`.
    """
    from scipy.fft import irfft, next_fast_len, rfftfreq

    # A shaped spectrum is that of a circular series. A series that is longer than needed by twice
    # the longest period keeps its two ends from being neighbours.
    length = next_fast_len(number + 2 * int(longest), real=True)
    amplitude = np.maximum(rfftfreq(length), 1 / longest) ** -0.5
    amplitude[0] = 0
    spectrum = amplitude * (
        rng.standard_normal(len(amplitude)) + 1j * rng.standard_normal(len(amplitude))
    )
    # irfft divides by the length and counts each frequency twice: the variance of the series is 4 *
    # sum(a^2) / length^2.
    return sd / (2 * np.sqrt(np.sum(amplitude**2)) / length) * irfft(spectrum, length)[:number]


def interference(number: int, rng: np.random.Generator) -> np.ndarray:
    """A sine whose phase wanders, on white noise: for example the mains, or a reaction wheel."""
    phase = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(2 * np.pi / 17.3, 0.02, number))
    return 0.1 * np.sin(phase) + rng.normal(0, _HALF, number)


def telegraph(number: int, rng: np.random.Generator) -> np.ndarray:
    """A level that jumps between two values after random, exponentially distributed times of mean
    300, on white noise.
    """
    changes = rng.random(number) < 1 / 300
    level = (rng.integers(2) + np.cumsum(changes)) % 2
    return 2 * _HALF * (level - 0.5) + rng.normal(0, _HALF, number)


def quantised(number: int, rng: np.random.Generator) -> np.ndarray:
    """Gaussian AR(1) noise, rounded to multiples of a step, as an analogue-to-digital converter
    does.
    """
    step = 0.05
    return step * np.rint(0.1 * first_order(number, 0.8, rng) / step)


def bursts(number: int, rng: np.random.Generator) -> np.ndarray:
    """White noise that is louder during bursts, which begin and end at random (a Markov chain of
    two states with mean times).
    """
    gap = 360.0
    burst = 40.0
    ends = 1 / np.array([gap, burst])
    num_pairs = 10 + int(2 * number / (burst + gap))
    lengths = rng.geometric(np.tile(ends, num_pairs))
    while lengths.sum() < 2 * number:
        lengths = np.concatenate([lengths, rng.geometric(np.tile(ends, num_pairs))])
    is_burst = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
    begin = rng.integers(number)  # by then the chain has forgotten its first state
    return rng.standard_normal(number) * np.where(
        is_burst[begin : begin + number], np.sqrt(0.055), _HALF
    )


def heavy_tails(number: int, rng: np.random.Generator) -> np.ndarray:
    """AR(1) noise whose innovations have Student's t distribution: large values are not rare, and
    they ring.
    """
    from scipy.signal import lfilter

    degrees = 3.0
    sd = 0.1
    coefficient = 0.5
    settling = 200
    scale = sd * np.sqrt((1 - coefficient**2) * (degrees - 2) / degrees)
    innovations = scale * rng.standard_t(degrees, number + settling)
    return lfilter([1.0], [1.0, -coefficient], innovations)[settling:]


def loudness(number: int, rng: np.random.Generator) -> np.ndarray:
    """White noise and a coloured component (AR(1)) whose loudness varies slowly."""
    log_scale_sd = 0.6
    log_scale = log_scale_sd * first_order(number, np.exp(-1 / 1_000.0), rng)
    return _HALF * np.exp(log_scale - log_scale_sd**2) * first_order(number, 0.9, rng) + rng.normal(
        0, _HALF, number
    )


def signal_dependent(number: int, rng: np.random.Generator, signal: np.ndarray) -> np.ndarray:
    """White noise whose scale follows the signal, for example of a sensor with an error of gain."""
    if np.shape(signal) != (number,):
        raise ValueError(
            f"Expected a signal of {number} samples. Received: one of shape {np.shape(signal)}."
        )
    slope = float(np.sqrt(0.0075) / _SIGNAL_SD)
    return rng.standard_normal(number) * np.hypot(0.05, slope * np.asarray(signal, np.float64))


class NoiseProcess(NamedTuple):
    """A family of noise: the function that draws it, its overall standard deviation, and whether
    the function needs the signal.
    """

    draw: Callable[..., np.ndarray]
    standard_deviation: float = 0.1
    follows_signal: bool = False


GALLERY = {
    "white": NoiseProcess(white),
    "autoregressive": NoiseProcess(autoregressive),
    "heteroscedastic": NoiseProcess(heteroscedastic),
    "shot": NoiseProcess(shot),
    "fractional": NoiseProcess(fractional),
    # 0.1 but for its last digit
    "bernoulli": NoiseProcess(bernoulli, float(np.sqrt(0.01 * (10 * _HALF) ** 2 + _HALF**2))),
    "one_over_f": NoiseProcess(one_over_f),
    "interference": NoiseProcess(interference),
    "telegraph": NoiseProcess(telegraph),
    # by Sheppard's correction
    "quantised": NoiseProcess(quantised, float(np.sqrt(0.1**2 + 0.05**2 / 12))),
    "bursts": NoiseProcess(bursts),
    "heavy_tails": NoiseProcess(heavy_tails),
    "loudness": NoiseProcess(loudness),
    "signal_dependent": NoiseProcess(signal_dependent, follows_signal=True),
}
"""All families by name."""
