"""A gallery of noise processes for which no generator of this project was designed, and which of them a designer may look at.

The four environments of the study of robustness were known when the convolutional GAN was designed. A generator that is meant
for noise in general must be judged on noise that its designer did not use. The families are therefore divided before any design
work: half of them may be looked at during the design, and the other half are reported on once. `LOOKED_AT` contains the four known
environments and three of the other ten families, drawn by `numpy.random.default_rng(200812082).permutation(...)[:3]`.
"""

from dataclasses import dataclass

import numpy as np

from studies.common.noise_processes import NOISES, NoiseProcess, first_order

LOOKED_AT = ("white", "autoregressive", "heteroscedastic", "shot", "fractional", "heavy_tails", "one_over_f")


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
        """Draws float64 noise of shape `(num_samples,)` by shaping the spectrum of white noise."""
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
        """Draws float64 noise of shape `(num_samples,)`."""
        phase = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(2 * np.pi / self.period_samples, self.phase_step_sd, num_samples))
        return self.amplitude * np.sin(phase) + rng.normal(0, self.background_sd, num_samples)


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
        """Draws float64 noise of shape `(num_samples,)`."""
        changes = rng.random(num_samples) < 1 / self.dwell_samples
        level = (rng.integers(2) + np.cumsum(changes)) % 2
        return self.step * (level - 0.5) + rng.normal(0, self.background_sd, num_samples)


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
        """Draws float64 noise of shape `(num_samples,)`."""
        return self.step * np.rint(self.unrounded_sd * first_order(num_samples, self.coefficient, rng) / self.step)


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
        """Draws float64 noise of shape `(num_samples,)`."""
        num_pairs = 10 + int(2 * num_samples / (self.burst_samples + self.gap_samples))
        lengths = rng.geometric(np.tile(1 / np.array([self.gap_samples, self.burst_samples]), num_pairs))
        while lengths.sum() < 2 * num_samples:
            lengths = np.concatenate([lengths, rng.geometric(np.tile(1 / np.array([self.gap_samples, self.burst_samples]), num_pairs))])
        is_burst = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
        begin = rng.integers(num_samples)  # by then the chain has forgotten its first state
        return rng.standard_normal(num_samples) * np.where(is_burst[begin : begin + num_samples], self.burst_sd, self.background_sd)


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
        """Draws float64 noise of shape `(num_samples,)`."""
        from scipy.signal import lfilter

        settling = 200
        scale = self.standard_deviation * np.sqrt((1 - self.coefficient**2) * (self.degrees - 2) / self.degrees)
        innovations = scale * rng.standard_t(self.degrees, num_samples + settling)
        return lfilter([1.0], [1.0, -self.coefficient], innovations)[settling:]


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
        """Draws float64 noise of shape `(num_samples,)`."""
        log_scale = self.log_scale_sd * first_order(num_samples, np.exp(-1 / self.correlation_samples), rng)
        coloured = self.coloured_sd * np.exp(log_scale - self.log_scale_sd**2) * first_order(num_samples, self.coefficient, rng)
        return coloured + rng.normal(0, self.background_sd, num_samples)


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
