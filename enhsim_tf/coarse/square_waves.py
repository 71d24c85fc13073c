"""The coarse simulator, steps 1 and 2 of the paper's pipeline: a sum of square waves, or one
constant level, and the fit to telemetry.

"A square wave can be used for nearly any periodic waveform" (paper, section 1). A wave is found by
box least squares (Kovacs, Zucker and Mazeh 2002): the series is folded at each trial frequency, and
the box that explains the most variance is found from cumulative sums.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.common.errors import InputError
from enhsim_tf.paper.degraded import degrade
from enhsim_tf.telemetry.series import Telemetry, check_telemetry

_NUM_BINS = 200  # bins of a folded period
_NUM_PEAKS = 12  # highest peaks of the periodogram that are used as trial frequencies
_OVERSAMPLING = 4  # frequency oversampling of the periodogram


@dataclasses.dataclass(frozen=True)
class SquareWave:
    """One square wave: `high` for the fraction `duty` of each period, `low` for the rest.

    Args:
        period_s: Period in seconds.
        phase: Phase at time 0 as a fraction of a period, from 0 to 1.
        duty: Fraction of each period spent above the middle level, between 0 and 1.
        low: Lowest level, in the telemetry's unit.
        high: Highest level, in the telemetry's unit.

    Raises:
        InputError: If an argument is out of range.
    """

    period_s: float
    phase: float = 0.0
    duty: float = 0.5
    low: float = -1.0
    high: float = 1.0

    def __post_init__(self):
        numbers = (self.period_s, self.phase, self.duty, self.low, self.high)
        if not np.isfinite(numbers).all() or self.period_s <= 0 or not 0 < self.duty < 1:
            raise InputError(
                f"Expected period_s > 0, 0 < duty < 1 and finite numbers. Received: {self}."
            )

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Evaluates the wave at times in seconds; returns a float64 array of the same shape."""
        cycle = np.asarray(time_s, np.float64) / self.period_s + self.phase
        cycle -= np.floor(cycle)  # the same as a modulus, in a fraction of the time
        return np.where(
            cycle < self.duty, float(self.low + (self.high - self.low)), float(self.low)
        )


class SquareWaveSimulator:
    """The coarse simulator: a sum of square waves.

    Args:
        waves: The square waves, at least one.

    Raises:
        InputError: If `waves` is empty.

    Example:
    >>> orbit = SquareWave(period_s=480, low=-0.5, high=0.5)
    >>> rotation = SquareWave(period_s=120, low=-0.25, high=0.25)
    >>> SquareWaveSimulator([orbit, rotation]).simulate(np.arange(500.0)[None]).shape
    (1, 500)
    """

    columns = ("square waves",)
    is_constant = False
    """Whether the simulator has no shape at all, as `ConstantLevel`."""

    def __init__(self, waves: Sequence[SquareWave]):
        if not waves:
            raise InputError("Expected at least one SquareWave. Received: waves=[].")
        self.waves = tuple(waves)

    @property
    def period_s(self) -> float:
        """The longest period in seconds."""
        return max(wave.period_s for wave in self.waves)

    @property
    def levels(self) -> tuple[float, float]:
        """Lowest and highest level that the sum can reach."""
        return sum(min(wave.low, wave.high) for wave in self.waves), sum(
            max(wave.low, wave.high) for wave in self.waves
        )

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Evaluates the nominal sum at times in seconds; returns a float64 array of the same
        shape.
        """
        return sum(wave(time_s) for wave in self.waves)

    def simulate(
        self,
        time_s: np.ndarray,
        scenario: Degraded | None = None,
        rng: np.random.Generator | None = None,
    ) -> np.ndarray:
        """Simulates windows, float32 of shape `(windows, samples)`; the generator, None: one with
        seed 0, is for `friction` and `dropout`.
        """
        time_s = np.asarray(time_s, np.float64)
        if scenario is None or scenario.severity == 0:
            return self(time_s).astype(np.float32)
        rng = np.random.default_rng(0) if rng is None else rng
        onset = scenario.first_sample(time_s.shape[1])
        shortest_s = min(wave.period_s for wave in self.waves)
        return degrade(
            self, time_s, scenario.mode, scenario.severity, self.levels, shortest_s, rng, onset
        ).astype(np.float32)

    def run(
        self,
        time_s: np.ndarray,
        scenario: Degraded | None = None,
        rng: np.random.Generator | None = None,
    ) -> np.ndarray:
        """Simulates one run, float32 of shape `(samples, 1)`, see
        `interface.CoarseSimulator.run`.
        """
        return self.simulate(np.asarray(time_s, np.float64)[None], scenario, rng)[0][:, None]

    @classmethod
    def fit(cls, telemetry: Telemetry) -> "SquareWaveSimulator":
        """Fits one square wave to telemetry by least squares; raises InputError if it is no
        `Telemetry`, or no period is found twice.
        """
        check_telemetry(telemetry)
        values = telemetry.values[:, 0].astype(np.float64)
        wave = fit_box(values, telemetry.interval_s, telemetry.name)
        # relative to the zero of the series' time axis
        phase = np.mod(wave.phase - telemetry.offset_s / wave.period_s, 1.0)
        return cls([dataclasses.replace(wave, phase=float(phase))])


class ConstantLevel(SquareWaveSimulator):
    """A constant level for channels without a shape that repeats, in the form of a square wave
    whose two levels are equal.

    The degraded modes of the sensor, `drift` and `dropout`, change it. Those of a mechanism do not,
    because nothing moves; but in a series, telemetry that is stuck no longer follows the levels of
    the record.

    Args:
        level: The level, in the unit of the telemetry.
        spread: Standard deviation of the telemetry, above 0. Degraded modes take `level - spread`
            and `level + spread` as the lowest and the highest level.
        period_s: A time without meaning, for code that expects a period.

    Raises:
        InputError: If a number is not finite, or if the spread or the period is not above 0.
    """

    columns = ("constant level",)
    is_constant = True

    def __init__(self, level: float, spread: float, period_s: float = 1.0):
        if not (np.isfinite([level, spread]).all() and spread > 0):
            raise InputError(
                f"Expected a finite level and a spread above 0. Received: level={level}, "
                f"spread={spread}."
            )
        super().__init__([SquareWave(period_s, low=float(level), high=float(level))])
        self.level = float(level)
        self.spread = float(spread)

    @property
    def levels(self) -> tuple[float, float]:
        """Lowest and highest level for degraded modes and units."""
        return self.level - self.spread, self.level + self.spread


def level_offset_and_scale(coarse: SquareWaveSimulator) -> tuple[float, float]:
    """Returns `(offset, scale)`, so that `(values - offset) / scale` maps the lowest level of a
    simulator to -1 and the highest to 1.
    """
    low, high = coarse.levels
    return (low + high) / 2, (high - low) / 2 or 1.0


def fit_box(values: np.ndarray, interval_s: float = 1.0, name: str = "the series") -> SquareWave:
    """Fits a square wave to a series of shape `(samples,)`, which begins at time 0, by least
    squares; raises InputError with its name if no period is found.
    """
    centred = values - values.mean()
    num_samples = len(values)
    index = np.arange(num_samples, dtype=np.float64)

    # trial frequencies: peaks of the periodogram, and one half and one third of each, since
    # harmonics may be stronger than the fundamental
    power = np.abs(np.fft.rfft(centred, _OVERSAMPLING * num_samples)) ** 2
    power[: 2 * _OVERSAMPLING] = 0  # a period must occur at least twice
    peaks = 1 + np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]))
    peaks = peaks[np.argsort(power[peaks])[::-1][:_NUM_PEAKS]]
    trials = {
        peak / (_OVERSAMPLING * num_samples) / divisor for peak in peaks for divisor in (1, 2, 3)
    }
    trials = sorted(trial for trial in trials if 2 / num_samples <= trial <= 0.25)
    if not trials:
        raise InputError(
            "Expected something periodic, at least two periods of at least four samples. "
            f"Received: {name}, in which no period was found."
        )

    def explained(trial: float) -> float:
        return _best_box(index * trial, centred)[0]

    # refine the frequency until a step moves the last cycle by less than a thousandth of a period
    best = max(trials, key=explained)
    step = 1 / (_OVERSAMPLING * num_samples)
    while step * num_samples > 1e-3:
        best = max(best + step * np.arange(-4, 5), key=explained)
        step /= 3
    _, begin, duty = _best_box(index * best, centred)
    inside = np.mod(index * best - begin, 1.0) < duty
    levels = float(values[~inside].mean()), float(values[inside].mean())
    return SquareWave(interval_s / float(best), -begin, duty, *levels)


def _best_box(cycles: np.ndarray, centred: np.ndarray) -> tuple[float, float, float]:
    """Finds the best box of the series folded at `cycles`; returns (explained variance, begin,
    duty) of the box.
    """
    bins = (np.mod(cycles, 1.0) * _NUM_BINS).astype(np.int64)
    counts = np.bincount(bins, minlength=_NUM_BINS)
    sums = np.bincount(bins, centred, minlength=_NUM_BINS)
    totals = np.concatenate([[0], np.cumsum(np.tile(sums, 2))])
    numbers = np.concatenate([[0], np.cumsum(np.tile(counts, 2))])
    begin = np.arange(_NUM_BINS)[:, None]
    width = np.arange(1, _NUM_BINS)[None]
    total = totals[begin + width] - totals[begin]
    number = numbers[begin + width] - numbers[begin]
    rest = len(centred) - number
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where(
            (number > 0) & (rest > 0) & (total > 0), total**2 / number + total**2 / rest, 0
        ) / len(centred)
    row, column = np.unravel_index(np.argmax(explained), explained.shape)
    return float(explained[row, column]), float(row / _NUM_BINS), float((column + 1) / _NUM_BINS)
