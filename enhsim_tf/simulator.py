"""The coarse simulator, steps 1 and 2 of the paper's pipeline, and its degraded modes.

"A square wave can be used for nearly any periodic waveform" (paper, section 1): the simulator is a sum of square
waves, configured by hand or fitted to telemetry. It needs no network and knows none.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.errors import InputError
from enhsim_tf.telemetry import Telemetry, cut_windows


@dataclasses.dataclass(frozen=True)
class SquareWave:
    """One square wave: `high` for the share `duty` of each period, `low` for the rest.

    With more than two levels it becomes the staircase that a quantised sine of the same period, phase and duty makes.

    Args:
        period_s: Period in seconds.
        phase: Share of a period by which the wave is ahead at time 0, from 0 to 1.
        duty: Share of each period spent above the middle, between 0 and 1.
        low: Lowest level, in the telemetry's unit.
        high: Highest level, in the telemetry's unit.
        num_levels: Number of levels, at least 2.

    Raises:
        InputError: If an argument is out of its range.
    """

    period_s: float
    phase: float = 0.0
    duty: float = 0.5
    low: float = -1.0
    high: float = 1.0
    num_levels: int = 2

    def __post_init__(self):
        numbers = (self.period_s, self.phase, self.duty, self.low, self.high, self.num_levels)
        if not np.isfinite(numbers).all() or self.period_s <= 0 or not 0 < self.duty < 1 or self.num_levels < 2:
            raise InputError(f"Expected period_s > 0, 0 < duty < 1, num_levels >= 2 and finite numbers. Received: {self}.")

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """The wave at the given times, float64 of the same shape."""
        cycle = np.mod(np.asarray(time_s, np.float64) / self.period_s + self.phase, 1.0)
        above = cycle < self.duty
        if self.num_levels == 2:
            share = above.astype(np.float64)
        else:
            half_wave = np.where(above, np.sin(np.pi * cycle / self.duty), -np.sin(np.pi * (cycle - self.duty) / (1 - self.duty)))
            step = np.floor(self.num_levels * (half_wave + 1) / 2)
            share = np.minimum(step, self.num_levels - 1) / (self.num_levels - 1)
        return self.low + (self.high - self.low) * share


MODES = {
    "stuck": "the mechanism stands still from the onset, for the share `severity` of the time that is left",
    "drift": "a ramp is added that reaches `severity` times the span of the levels at the end",
    "gain_loss": "the amplitude about the middle level falls to 1 - `severity` of itself",
    "friction": "motion comes late by a random lag of up to `severity` times a quarter of the shortest period",
    "dropout": "runs of 10 samples, half of all at severity 1, read the lowest level",
    "period_change": "every period grows to 1 + `severity` times itself",
}
_DROPOUT_RUN = 10  # samples


@dataclasses.dataclass(frozen=True)
class Degraded:
    """A degraded mode of the target vehicle (paper, sections 1 and 3), to be simulated.

    Args:
        mode: One of `MODES`: stuck, drift, gain_loss, friction, dropout, period_change.
        severity: From 0 (nominal to the bit) to 1.
        onset: When it sets in, as a share of the window or series, from 0 to before 1.

    Raises:
        InputError: If the mode is unknown or a number is out of its range.
    """

    mode: str
    severity: float = 0.5
    onset: float = 0.25

    def __post_init__(self):
        if self.mode not in MODES:
            raise InputError(f"Expected a mode, one of: {', '.join(MODES)}. Received: mode={self.mode!r}.")
        if not (0 <= self.severity <= 1 and 0 <= self.onset < 1):
            raise InputError(f"Expected severity from 0 to 1 and onset from 0 to before 1. Received: {self}.")


def degrade(
    signal: Callable[[np.ndarray], np.ndarray],
    time_s: np.ndarray,
    scenario: Degraded | None,
    levels: tuple[float, float],
    shortest_period_s: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Plays a signal through a degraded mode.

    The mode acts on the signal as a function of time, so the same scenario and the same state of `rng` degrade the
    coarse simulator and, where it is known in closed form, the true vehicle alike.

    Args:
        signal: The nominal signal, from times in seconds to values of the same shape.
        time_s: Times, shape `(windows, samples)`.
        scenario: The mode, or None for the nominal signal.
        levels: Lowest and highest nominal level.
        shortest_period_s: The shortest period of the signal in seconds.
        rng: Draws the lags of `friction` and the gaps of `dropout`.

    Returns:
        float64 array of shape `(windows, samples)`.
    """
    if scenario is None or scenario.severity == 0:
        return signal(time_s)
    severity, (low, high) = scenario.severity, levels
    num_windows, num_samples = time_s.shape
    onset = int(scenario.onset * num_samples)
    time_s, late = time_s.copy(), time_s[:, onset:]
    begin = late[:, :1]

    # what happens to the mechanism: its own time runs differently after the onset
    if scenario.mode == "stuck":
        until = begin + severity * (late[:, -1:] - begin)
        time_s[:, onset:] = np.where(late <= until, begin, late)
    elif scenario.mode == "period_change":
        time_s[:, onset:] = begin + (late - begin) / (1 + severity)
    elif scenario.mode == "friction":
        knots = np.arange(0, late[0, -1] - late[0, 0] + shortest_period_s, shortest_period_s / 4)
        lags = rng.uniform(0, severity * shortest_period_s / 4, (num_windows, len(knots)))
        lags[:, 0] = 0
        elapsed = late[0] - late[0, 0]
        time_s[:, onset:] = late - np.stack([np.interp(elapsed, knots, lag) for lag in lags])
    values = signal(time_s)

    # what happens to the reading
    after = values[:, onset:]
    if scenario.mode == "drift":
        after += severity * (high - low) * np.linspace(0, 1, after.shape[1])
    elif scenario.mode == "gain_loss":
        middle = (low + high) / 2
        after[:] = middle + (1 - severity) * (after - middle)
    elif scenario.mode == "dropout":
        runs = rng.random((num_windows, -(-after.shape[1] // _DROPOUT_RUN))) < severity / 2
        after[np.repeat(runs, _DROPOUT_RUN, axis=1)[:, : after.shape[1]]] = low
    return values


class SquareWaveSimulator:
    """A sum of square waves: the coarse simulator.

    Args:
        waves: Its square waves.

    Example:
    >>> orbit = SquareWave(period_s=480, low=-0.5, high=0.5)
    >>> rotation = SquareWave(period_s=120, low=-0.25, high=0.25)
    >>> SquareWaveSimulator([orbit, rotation]).simulate(np.arange(500.0)[None]).shape
    (1, 500)
    """

    def __init__(self, waves: Sequence[SquareWave]):
        if not waves:
            raise InputError("Expected at least one SquareWave. Received: waves=[].")
        self.waves = tuple(waves)

    @property
    def levels(self) -> tuple[float, float]:
        """Lowest and highest level of the sum."""
        return sum(min(wave.low, wave.high) for wave in self.waves), sum(max(wave.low, wave.high) for wave in self.waves)

    @property
    def shortest_period_s(self) -> float:
        """The shortest period in seconds."""
        return min(wave.period_s for wave in self.waves)

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """The nominal sum at the given times, float64 of the same shape."""
        return sum(wave(time_s) for wave in self.waves)

    def simulate(self, time_s: np.ndarray, scenario: Degraded | None = None, rng: np.random.Generator | None = None) -> np.ndarray:
        """Simulates windows.

        Args:
            time_s: Times in seconds, shape `(windows, samples)`.
            scenario: A degraded mode, or None for nominal.
            rng: Draws what the mode leaves to chance; needed for `friction` and `dropout`.

        Returns:
            float32 array of shape `(windows, samples)`.
        """
        rng = np.random.default_rng(0) if rng is None else rng
        return degrade(self, np.asarray(time_s, np.float64), scenario, self.levels, self.shortest_period_s, rng).astype(np.float32)

    @classmethod
    def fit(cls, telemetry: Telemetry, max_waves: int = 1, min_explained: float = 0.05, num_levels: int = 2) -> "SquareWaveSimulator":
        """Fits square waves to telemetry by least squares, one after another, each to what the ones before left.

        The search is box least squares (Kovacs, Zucker and Mazeh 2002): for each trial period the series is folded and
        the box that explains most variance is read off cumulative sums.

        Args:
            telemetry: The series, at least two periods long.
            max_waves: Most square waves. One suits most channels; more follow harmonics, not mechanisms.
            min_explained: A further wave must explain this share of the series' variance.
            num_levels: Levels of each wave; the search itself uses two.

        Returns:
            The fitted simulator.

        Raises:
            InputError: If nothing periodic is found.
        """
        residual = telemetry.values.astype(np.float64)
        variance, waves = residual.var(), []
        while len(waves) < max_waves:
            wave, explained = _fit_square_wave(residual, telemetry)
            if explained < min_explained * variance and waves:
                break
            residual = residual - wave(telemetry.time_s)
            waves.append(dataclasses.replace(wave, num_levels=num_levels))
        return cls(waves)

    def get_config(self) -> dict:
        """The settings as plain JSON types; `from_config` takes them back."""
        return {"waves": [dataclasses.asdict(wave) for wave in self.waves]}

    @classmethod
    def from_config(cls, config: dict) -> "SquareWaveSimulator":
        """The simulator that `get_config` described."""
        return cls([SquareWave(**wave) for wave in config["waves"]])


def units_of(coarse: SquareWaveSimulator) -> tuple[float, float]:
    """`(offset, scale)` that put the coarse simulator's lowest and highest level at -1 and 1."""
    low, high = coarse.levels
    return (low + high) / 2, (high - low) / 2 or 1.0


def paired_windows(telemetry: Telemetry, coarse: SquareWaveSimulator, offsets: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Coarse and true windows of the same times (steps 3 and 4): two float32 arrays of shape `(windows, samples)`."""
    times = telemetry.offset_s + telemetry.interval_s * (np.asarray(offsets)[:, None] + np.arange(window))
    return coarse.simulate(times), cut_windows(telemetry.values, offsets, window)


_NUM_BINS = 200  # of a folded period
_NUM_PEAKS = 12  # of the periodogram, followed up


def _fit_square_wave(values: np.ndarray, telemetry: Telemetry) -> tuple[SquareWave, float]:
    """The square wave that explains most of `values` in the least-squares sense, and the variance it explains."""
    centred, num_samples = values - values.mean(), len(values)
    index = np.arange(num_samples, dtype=np.float64)
    # trial frequencies (cycles a sample): peaks of the periodogram and their halves and thirds, for a wave whose
    # harmonics are stronger than its fundamental
    power = np.abs(np.fft.rfft(centred, 4 * num_samples)) ** 2
    power[: 4 * 2] = 0  # below two cycles nothing is periodic
    frequencies = np.arange(len(power)) / (4 * num_samples)
    peaks = 1 + np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]))
    peaks = peaks[np.argsort(power[peaks])[::-1][:_NUM_PEAKS]]
    trials = {frequency / divisor for frequency in frequencies[peaks] for divisor in (1, 2, 3)}
    trials = sorted(trial for trial in trials if 2 / num_samples <= trial <= 0.25)
    if not trials:
        raise InputError(
            f"Expected something periodic, at least two periods and four samples a period. Received: {telemetry.name}, where none was found."
        )
    # refine: the step of each grid is fine enough that the last cycle moves by less than a bin of the next
    best = max(trials, key=lambda trial: _box(index * trial, centred)[0])
    step = 0.25 / num_samples
    while step * num_samples > 1e-3:
        best = max(best + step * np.arange(-4, 5), key=lambda trial: _box(index * trial, centred)[0])
        step /= 3
    explained, first, duty = _box(index * best, centred)
    # levels: means inside and outside the box; phase on the series' own clock
    cycle = np.mod(index * best - first, 1.0)
    inside = cycle < duty
    period_s = telemetry.interval_s / best
    phase = np.mod(-first - telemetry.offset_s / period_s, 1.0)
    low, high = values[~inside].mean(), values[inside].mean()
    return SquareWave(float(period_s), float(phase), float(duty), float(low), float(high)), explained


def _box(cycles: np.ndarray, centred: np.ndarray) -> tuple[float, float, float]:
    """The best high box of a series folded on `cycles`: (variance explained, where it begins, its duty)."""
    bins = (np.mod(cycles, 1.0) * _NUM_BINS).astype(np.int64)
    counts = np.bincount(bins, minlength=_NUM_BINS)
    sums = np.bincount(bins, centred, minlength=_NUM_BINS)
    totals = np.concatenate([[0], np.cumsum(np.tile(sums, 2))])
    numbers = np.concatenate([[0], np.cumsum(np.tile(counts, 2))])
    begin, width = np.arange(_NUM_BINS)[:, None], np.arange(1, _NUM_BINS)[None]
    total, number = totals[begin + width] - totals[begin], numbers[begin + width] - numbers[begin]
    rest = len(centred) - number
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where((number > 0) & (rest > 0) & (total > 0), total**2 / number + total**2 / rest, 0) / len(centred)
    row, column = np.unravel_index(np.argmax(explained), explained.shape)
    return float(explained[row, column]), row / _NUM_BINS, (column + 1) / _NUM_BINS
