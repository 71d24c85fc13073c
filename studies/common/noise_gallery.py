"""A gallery of noise processes for which no generator of this project was designed, and which of them a designer may look at.

The four environments of the robustness experiment were known when the convolutional GAN was designed. A generator that is meant
for noise in general must be judged on noise that its designer did not use. The families are therefore divided before any design
work: half of them may be looked at during the design, and the other half are reported on once. `LOOKED_AT` contains the four known
environments and three of the other ten families, drawn by `numpy.random.default_rng(200812082).permutation(...)[:3]`.
"""

from dataclasses import dataclass

import numpy as np

from studies.common.noise_processes import NOISES, NoiseProcess, WhiteNoise, first_order

LOOKED_AT = ("white", "autoregressive", "heteroscedastic", "shot", "fractional", "heavy_tails", "one_over_f")
UNSEEN = ("interference", "telegraph", "quantised", "bursts", "loudness", "signal_dependent", "bernoulli")


@dataclass(frozen=True)
class OneOverFNoise:
    """Gaussian noise whose power falls with a power of the frequency.

    Args:
        exponent: The power of one over the frequency: 1 for flicker noise.
        longest_samples: Period in samples below whose frequency the spectrum is flat.
        standard_deviation: Overall, in the unit of the signal.
    """

    exponent: float
    longest_samples: float
    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)` by shaping the spectrum of white noise; it does not depend on `signal`."""
        from scipy.fft import irfft, next_fast_len, rfftfreq

        # A shaped spectrum is that of a circular series. A series that is longer than needed by twice the longest period keeps
        # its two ends from being neighbours.
        length = next_fast_len(num_samples + 2 * int(self.longest_samples), real=True)
        frequency = np.maximum(rfftfreq(length), 1 / self.longest_samples)
        amplitude = frequency ** (-self.exponent / 2)
        amplitude[0] = 0
        spectrum = amplitude * (rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency)))
        # irfft divides by the length and counts each frequency twice: the variance of the series is 4 * sum(a^2) / length^2.
        sd = 2 * np.sqrt(np.sum(amplitude**2)) / length
        return self.standard_deviation / sd * irfft(spectrum, length)[:num_samples]

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates the exponent by a line through the logarithm of the mean periodogram (Hann taper), and the sd."""
        values = np.asarray(windows, np.float64)
        samples = values.shape[1]
        power = np.mean(np.abs(np.fft.rfft(values * np.hanning(samples), axis=1)) ** 2, axis=0)
        fitted = slice(4, samples // 4)  # the lowest frequencies leak; close to the highest the bins are many and tell little
        slope = np.polyfit(np.log(np.fft.rfftfreq(samples)[fitted]), np.log(power[fitted]), 1)[0]
        return {"exponent": float(-slope)} | WhiteNoise.estimate(windows)


@dataclass(frozen=True)
class InterferenceNoise:
    """A sine whose phase wanders, on white noise: for example the mains, or a reaction wheel.

    Args:
        period_samples: Period of the sine.
        phase_step_sd: Standard deviation of the step of the phase from one sample to the next, in radians.
        amplitude: Amplitude of the sine, in the unit of the signal.
        background_sd: Standard deviation of the white noise.
    """

    period_samples: float
    phase_step_sd: float
    amplitude: float
    background_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation."""
        return float(np.sqrt(self.amplitude**2 / 2 + self.background_sd**2))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; it does not depend on `signal`."""
        phase = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(2 * np.pi / self.period_samples, self.phase_step_sd, num_samples))
        return self.amplitude * np.sin(phase) + rng.normal(0, self.background_sd, num_samples)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates from the covariance at lags of 1 and more, to which white noise does not contribute: a decaying cosine."""
        from scipy.optimize import curve_fit

        covariance = _covariance(windows)
        lag = np.arange(1, len(covariance))

        def decaying(lag: np.ndarray, power: float, decay: float, period: float) -> np.ndarray:
            return power * np.exp(-decay * lag) * np.cos(2 * np.pi * lag / period)

        spectrum = np.abs(np.fft.rfft(covariance[1:], 8 * len(lag)))
        period = 8 * len(lag) / (1 + np.argmax(spectrum[1:]))
        (power, decay, period), _ = curve_fit(decaying, lag, covariance[1:], (np.max(covariance[1:]), 0.5 / len(lag), period))
        return {
            "period_samples": float(period),
            "phase_step_sd": float(np.sqrt(max(2 * decay, 0))),
            "amplitude": float(np.sqrt(max(2 * power, 0))),
            "background_sd": float(np.sqrt(max(covariance[0] - power, 0))),
        }


@dataclass(frozen=True)
class TelegraphNoise:
    """A level that jumps between two values after random, exponentially distributed times, on white noise.

    Args:
        step: Difference of the two levels, in the unit of the signal.
        dwell_samples: Mean time in a level.
        background_sd: Standard deviation of the white noise.
    """

    step: float
    dwell_samples: float
    background_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation."""
        return float(np.sqrt(self.step**2 / 4 + self.background_sd**2))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; it does not depend on `signal`."""
        changes = rng.random(num_samples) < 1 / self.dwell_samples
        level = (rng.integers(2) + np.cumsum(changes)) % 2
        return self.step * (level - 0.5) + rng.normal(0, self.background_sd, num_samples)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates from the covariance at lags of 1 and more, an exponential to which white noise does not contribute."""
        power, decay, background = _exponential(_covariance(windows))
        # a level changes with probability p in a sample, so its correlation is (1 - 2 p)^lag
        return {"step": float(2 * np.sqrt(power)), "dwell_samples": float(2 / (1 - np.exp(-decay))), "background_sd": background}


@dataclass(frozen=True)
class QuantisedNoise:
    """Gaussian AR(1) noise, rounded to multiples of a step, as an analogue-to-digital converter does.

    Args:
        step: Distance of two values, in the unit of the signal.
        coefficient: Lag-1 correlation before rounding.
        unrounded_sd: Standard deviation before rounding.
    """

    step: float
    coefficient: float
    unrounded_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation (Sheppard's correction: rounding adds a twelfth of the squared step)."""
        return float(np.sqrt(self.unrounded_sd**2 + self.step**2 / 12))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; it does not depend on `signal`."""
        return self.step * np.rint(self.unrounded_sd * first_order(num_samples, self.coefficient, rng) / self.step)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates the step as the smallest distance of two values; rounding adds to the variance and to no covariance."""
        step = float(np.min(np.diff(np.unique(np.asarray(windows, np.float64).round(9)))))
        covariance = _covariance(windows, 1)
        variance = covariance[0] - step**2 / 12
        return {"step": step, "coefficient": float(covariance[1] / variance), "unrounded_sd": float(np.sqrt(variance))}


@dataclass(frozen=True)
class BurstNoise:
    """White noise that is louder during bursts, which begin and end at random (a Markov chain of two states).

    Args:
        burst_samples: Mean length of a burst.
        gap_samples: Mean time between two bursts.
        burst_sd: Standard deviation during bursts, in the unit of the signal.
        background_sd: Standard deviation between bursts.
    """

    burst_samples: float
    gap_samples: float
    burst_sd: float
    background_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation."""
        share = self.burst_samples / (self.burst_samples + self.gap_samples)
        return float(np.sqrt(share * self.burst_sd**2 + (1 - share) * self.background_sd**2))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; it does not depend on `signal`."""
        num_pairs = 10 + int(2 * num_samples / (self.burst_samples + self.gap_samples))
        lengths = rng.geometric(np.tile(1 / np.array([self.gap_samples, self.burst_samples]), num_pairs))
        while lengths.sum() < 2 * num_samples:
            lengths = np.concatenate([lengths, rng.geometric(np.tile(1 / np.array([self.gap_samples, self.burst_samples]), num_pairs))])
        is_burst = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
        begin = rng.integers(num_samples)  # by then the chain has forgotten its first state
        return rng.standard_normal(num_samples) * np.where(is_burst[begin : begin + num_samples], self.burst_sd, self.background_sd)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates the two scales and the share by maximum likelihood, and the lengths by the covariance of the squares."""
        from studies.common.noise_processes import BernoulliGaussianNoise

        mixture = BernoulliGaussianNoise.estimate(windows)
        share, background = mixture["probability"], mixture["background_sd"]
        squares = np.asarray(windows, np.float64) ** 2
        _, decay, _ = _exponential(_covariance(squares - squares.mean(), squares.shape[1] // 4))
        leaving = 1 - np.exp(-decay)  # the sum of both probabilities of a change
        return {
            "burst_samples": float(1 / (leaving * (1 - share))),
            "gap_samples": float(1 / (leaving * share)),
            "burst_sd": float(np.hypot(mixture["impulse_sd"], background)),
            "background_sd": float(background),
        }


@dataclass(frozen=True)
class HeavyTailedNoise:
    """AR(1) noise whose innovations have Student's t distribution: large values are not rare, and they ring.

    Args:
        degrees: Degrees of freedom, above 2.
        coefficient: Autoregressive coefficient.
        standard_deviation: Overall, in the unit of the signal.
    """

    degrees: float
    coefficient: float
    standard_deviation: float

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; it does not depend on `signal`."""
        from scipy.signal import lfilter

        settling = 200
        scale = self.standard_deviation * np.sqrt((1 - self.coefficient**2) * (self.degrees - 2) / self.degrees)
        innovations = scale * rng.standard_t(self.degrees, num_samples + settling)
        return lfilter([1.0], [1.0, -self.coefficient], innovations)[settling:]

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates the coefficient by least squares, and the degrees of freedom of the innovations by maximum likelihood."""
        from scipy.stats import t

        values = np.asarray(windows, np.float64)
        coefficient = float(np.sum(values[:, 1:] * values[:, :-1]) / np.sum(values[:, :-1] ** 2))
        innovations = (values[:, 1:] - coefficient * values[:, :-1]).ravel()[:50_000]
        degrees, _, _ = t.fit(innovations, floc=0)
        return {"degrees": float(degrees), "coefficient": coefficient} | WhiteNoise.estimate(windows)


@dataclass(frozen=True)
class LoudnessNoise:
    """White noise and a coloured component (AR(1)) whose loudness varies slowly.

    Args:
        coefficient: Autoregressive coefficient of the coloured component.
        coloured_sd: Standard deviation of the coloured component, in the unit of the signal.
        log_scale_sd: Standard deviation of the logarithm of its scale.
        correlation_samples: Samples after which the correlation of that logarithm has fallen to 1 / e.
        background_sd: Standard deviation of the white noise.
    """

    coefficient: float
    coloured_sd: float
    log_scale_sd: float
    correlation_samples: float
    background_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation."""
        return float(np.hypot(self.coloured_sd, self.background_sd))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)`; it does not depend on `signal`."""
        log_scale = self.log_scale_sd * first_order(num_samples, np.exp(-1 / self.correlation_samples), rng)
        coloured = self.coloured_sd * np.exp(log_scale - self.log_scale_sd**2) * first_order(num_samples, self.coefficient, rng)
        return coloured + rng.normal(0, self.background_sd, num_samples)

    @staticmethod
    def estimate(windows: np.ndarray) -> dict[str, float]:
        """Estimates the coloured component by the covariance, and its varying loudness by the covariance of products.

        The product of neighbouring samples has the mean `c` = coefficient times the squared `coloured_sd`. Where the coloured
        component itself is forgotten, the covariance of two such products is `c^2 (exp(4 s^2 r) - 1)`, with the correlation
        `r` of the logarithm of the scale and its standard deviation `s`.
        """
        from scipy.optimize import curve_fit

        values = np.asarray(windows, np.float64)
        power, decay, background = _exponential(_covariance(values, 60))
        products = values[:, 1:] * values[:, :-1]
        covariance = _covariance(products - products.mean(), products.shape[1] // 2)
        lag = np.arange(len(covariance))[100:]

        def excess(lag: np.ndarray, log_scale_sd: float, correlation_samples: float) -> np.ndarray:
            return np.expm1(4 * log_scale_sd**2 * np.exp(-lag / correlation_samples))

        start, bounds = (0.5, float(values.shape[1])), ([0.0, 1.0], [3.0, 1000.0 * values.shape[1]])
        (log_scale_sd, correlation), _ = curve_fit(excess, lag, covariance[100:] / products.mean() ** 2, start, bounds=bounds)
        return {
            "coefficient": float(np.exp(-decay)),
            "coloured_sd": float(np.sqrt(power)),
            "log_scale_sd": float(log_scale_sd),
            "correlation_samples": float(correlation),
            "background_sd": background,
        }


@dataclass(frozen=True)
class SignalDependentNoise:
    """White noise whose scale follows the signal, for example of a sensor with an error of gain.

    Args:
        offset_sd: Standard deviation where the signal is 0.
        slope: Further standard deviation for each unit of the signal; the two variances add up.
        signal_sd: Root mean square of the signal, on which the overall standard deviation depends.
    """

    offset_sd: float
    slope: float
    signal_sd: float

    @property
    def standard_deviation(self) -> float:
        """Overall standard deviation."""
        return float(np.hypot(self.offset_sd, self.slope * self.signal_sd))

    def draw(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws float64 noise of shape `(num_samples,)` for a `signal` of this shape."""
        if signal is None or np.shape(signal) != (num_samples,):
            raise ValueError(f"Expected a signal of {num_samples} samples. Received: one of shape {np.shape(signal)}.")
        return rng.standard_normal(num_samples) * np.hypot(self.offset_sd, self.slope * np.asarray(signal, np.float64))

    @staticmethod
    def estimate(windows: np.ndarray, signal: np.ndarray) -> dict[str, float]:
        """Estimates by maximum likelihood, from noise and the signal of the same shape."""
        from scipy.optimize import minimize

        squares, signals = (np.asarray(each, np.float64).ravel() ** 2 for each in (windows, signal))

        def loss(logs: np.ndarray) -> float:
            variance = np.exp(2 * logs[0]) + np.exp(2 * logs[1]) * signals
            return float(np.mean(np.log(variance) + squares / variance))

        start = np.full(2, 0.5 * np.log(squares.mean() / 2))
        offset, slope = np.exp(minimize(loss, start, method="Nelder-Mead").x)
        return {"offset_sd": float(offset), "slope": float(slope), "signal_sd": float(np.sqrt(signals.mean()))}


def _covariance(windows: np.ndarray, num_lags: int | None = None) -> np.ndarray:
    """Computes the covariance at the lags 0 to `num_lags` (half a window) for noise of mean zero."""
    from enhsim_tf.realism.measures import lagged_products

    values = np.asarray(windows, np.float64)
    return lagged_products(values, num_lags or values.shape[1] // 2).mean(axis=0)


def _exponential(covariance: np.ndarray) -> tuple[float, float, float]:
    """Fits `power * exp(-decay * lag)` to lags of 1 and more.

    Returns:
        The power, the decay, and the standard deviation of what is left at lag 0: the white noise.
    """
    from scipy.optimize import curve_fit

    lag = np.arange(1.0, len(covariance))
    start = (max(covariance[1], 1e-12), 2 / len(lag))
    (power, decay), _ = curve_fit(lambda k, power, decay: power * np.exp(-decay * k), lag, covariance[1:], start, bounds=(0, np.inf))
    return float(power), float(decay), float(np.sqrt(max(covariance[0] - power, 0)))


_HALF = float(np.sqrt(0.005))  # half the variance of noise of standard deviation 0.1
_SIGNAL_SD = float(np.sqrt(0.5**2 / 2 + 0.25**2 / 2))  # of the two waves of the example telemetry
GALLERY: dict[str, NoiseProcess] = {
    **NOISES,
    "one_over_f": OneOverFNoise(1.0, 4_000.0, 0.1),
    "interference": InterferenceNoise(17.3, 0.02, 0.1, _HALF),
    "telegraph": TelegraphNoise(2 * _HALF, 300.0, _HALF),
    "quantised": QuantisedNoise(0.05, 0.8, 0.1),
    "bursts": BurstNoise(40.0, 360.0, float(np.sqrt(0.055)), _HALF),
    "heavy_tails": HeavyTailedNoise(3.0, 0.5, 0.1),
    "loudness": LoudnessNoise(0.9, _HALF, 0.6, 1_000.0, _HALF),
    "signal_dependent": SignalDependentNoise(0.05, float(np.sqrt(0.0075) / _SIGNAL_SD), _SIGNAL_SD),
}
