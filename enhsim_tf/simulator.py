"""The coarse simulator, steps 1 and 2 of the paper's pipeline, and its degraded modes.

"A square wave can be used for nearly any periodic waveform" (paper, section 1): the simulator is a sum of square
waves, configured by hand or fitted to telemetry. It needs no network and knows none.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.errors import InputError
from enhsim_tf.periodicity import Box, fit_box
from enhsim_tf.telemetry import Telemetry, check_telemetry, cut_windows


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
_NUM_SHIFTS = 100  # tried to each side when a clock is set: steps of half a per cent of a period


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

    def first_sample(self, num_samples: int) -> int:
        """The sample of a window or series at which it sets in; rounded first, since 0.29 times 100 is 28.999999999999996."""
        return int(round(self.onset * num_samples, 6))


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
    onset = min(scenario.first_sample(num_samples), num_samples - 1)
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

        Args:
            telemetry: The series, at least two periods long.
            max_waves: Most square waves. One suits most channels; more follow harmonics, not mechanisms.
            min_explained: A further wave must explain this share of the series' variance.
            num_levels: Levels of each wave; the search itself uses two.

        Returns:
            The fitted simulator.

        Raises:
            InputError: If it is no telemetry, or nothing periodic is found.
        """
        check_telemetry(telemetry)
        residual = telemetry.values.astype(np.float64)
        variance, waves = residual.var(), []
        while len(waves) < max_waves:
            box = fit_box(residual, telemetry.name)
            wave, explained = cls._wave_of(box, telemetry), box.explained
            if explained < min_explained * variance and waves:
                break
            residual = residual - wave(telemetry.time_s)
            waves.append(dataclasses.replace(wave, num_levels=num_levels))
        return cls(waves)

    @staticmethod
    def _wave_of(box: Box, telemetry: Telemetry) -> SquareWave:
        period_s = telemetry.interval_s / box.frequency
        phase = np.mod(-box.begin - telemetry.offset_s / period_s, 1.0)  # on the series' own clock
        return SquareWave(period_s, float(phase), box.duty, box.low, box.high)

    def synchronise(self, time_s: np.ndarray, windows: np.ndarray) -> np.ndarray:
        """Sets the simulator's clock for each window, so that its phase is the window's; nothing else is adapted.

        A simulator that runs beside a vehicle is set to the vehicle's clock; one that runs free drifts away from it.

        Args:
            time_s: Times of the windows, shape `(windows, samples)`.
            windows: The telemetry of those times, same shape.

        Returns:
            The shifted times at which `simulate` correlates best with each window.
        """
        time_s, centred = np.asarray(time_s, np.float64), windows - windows.mean(axis=1, keepdims=True)
        longest_s = max(wave.period_s for wave in self.waves)
        shifts = np.linspace(-0.5, 0.5, 2 * _NUM_SHIFTS + 1) * longest_s
        agreement = [np.sum(self(time_s + shift) * centred, axis=1) for shift in shifts]
        return time_s + shifts[np.argmax(agreement, axis=0)][:, None]

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
    """Coarse and true windows of the same times (steps 3 and 4).

    Args:
        telemetry: The true series.
        coarse: The coarse simulator.
        offsets: First sample of each window, shape `(windows,)`.
        window: Samples of a window.

    Returns:
        `(coarse, true)`, two float32 arrays of shape `(windows, window)`.
    """
    times = telemetry.offset_s + telemetry.interval_s * (np.asarray(offsets)[:, None] + np.arange(window))
    return coarse.simulate(times), cut_windows(telemetry.values, offsets, window)
