"""The coarse simulator, steps 1 and 2 of the paper's pipeline, and its degraded modes.

"A square wave can be used for nearly any periodic waveform" (paper, section 1): the simulator is a sum of square
waves, configured by hand or fitted to telemetry. It needs no network and knows none.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.degraded import _NUM_SHIFTS, Degraded, degrade
from enhsim_tf.coarse_simulator.period_search import Box, fit_box
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry, check_telemetry


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


def level_offset_and_scale(coarse: SquareWaveSimulator) -> tuple[float, float]:
    """`(offset, scale)` that put the coarse simulator's lowest and highest level at -1 and 1."""
    low, high = coarse.levels
    return (low + high) / 2, (high - low) / 2 or 1.0
