"""The coarse simulator, steps 1 and 2 of the paper's pipeline.

"A square wave can be used for nearly any periodic waveform" (paper, section 1): the simulator is a sum of square waves, which
are configured by hand or fitted to telemetry. It does not use a neural network.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.degraded import Degraded, degrade
from enhsim_tf.coarse_simulator.period_search import fit_box
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry, check_telemetry


@dataclasses.dataclass(frozen=True)
class SquareWave:
    """One square wave: `high` for the fraction `duty` of each period, `low` for the rest.

    With more than two levels, the wave is a quantised sine of the same period, phase and duty.

    Args:
        period_s: Period in seconds.
        phase: Phase at time 0 as a fraction of a period, from 0 to 1.
        duty: Fraction of each period spent above the middle level, between 0 and 1.
        low: Lowest level, in the telemetry's unit.
        high: Highest level, in the telemetry's unit.
        num_levels: Number of levels, at least 2.

    Raises:
        InputError: If an argument is out of range.
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
        """Evaluates the wave at times in seconds; returns a float64 array of the same shape."""
        cycle = np.asarray(time_s, np.float64) / self.period_s + self.phase
        cycle -= np.floor(cycle)  # the same as a modulus, in a fraction of the time
        above = cycle < self.duty
        if self.num_levels == 2:
            return np.where(above, float(self.low + (self.high - self.low)), float(self.low))
        half_wave = np.where(above, np.sin(np.pi * cycle / self.duty), -np.sin(np.pi * (cycle - self.duty) / (1 - self.duty)))
        step = np.floor(self.num_levels * (half_wave + 1) / 2)
        share = np.minimum(step, self.num_levels - 1) / (self.num_levels - 1)
        return self.low + (self.high - self.low) * share


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

    def __init__(self, waves: Sequence[SquareWave]):
        if not waves:
            raise InputError("Expected at least one SquareWave. Received: waves=[].")
        self.waves = tuple(waves)

    @property
    def levels(self) -> tuple[float, float]:
        """Lowest and highest level that the sum can reach."""
        return sum(min(wave.low, wave.high) for wave in self.waves), sum(max(wave.low, wave.high) for wave in self.waves)

    @property
    def is_constant(self) -> bool:
        """Whether the simulator has no shape at all, as `constant_level.ConstantLevel`."""
        return False

    @property
    def shortest_period_s(self) -> float:
        """The shortest period in seconds."""
        return min(wave.period_s for wave in self.waves)

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Evaluates the nominal sum at times in seconds; returns a float64 array of the same shape."""
        return sum(wave(time_s) for wave in self.waves)

    def simulate(self, time_s: np.ndarray, scenario: Degraded | None = None, rng: np.random.Generator | None = None) -> np.ndarray:
        """Simulates windows.

        Args:
            time_s: Times in seconds, shape `(windows, samples)`.
            scenario: A degraded mode, or None for nominal behaviour.
            rng: Random number generator, used by `friction` and `dropout`. None: a generator with seed 0.

        Returns:
            float32 array of shape `(windows, samples)`.
        """
        rng = np.random.default_rng(0) if rng is None else rng
        return degrade(self, np.asarray(time_s, np.float64), scenario, self.levels, self.shortest_period_s, rng).astype(np.float32)

    def run(self, time_s: np.ndarray, scenario: Degraded | None = None, rng: np.random.Generator | None = None) -> np.ndarray:
        """Simulates one run, see `interface.CoarseSimulator.run`; returns a float32 array of shape `(samples, 1)`."""
        return self.simulate(np.asarray(time_s, np.float64)[None], scenario, rng)[0][:, None]

    @classmethod
    def fit(cls, telemetry: Telemetry) -> "SquareWaveSimulator":
        """Fits one square wave to telemetry by least squares.

        Args:
            telemetry: The series, at least two periods long.

        Raises:
            InputError: If `telemetry` is not a `Telemetry`, or no period is found.
        """
        check_telemetry(telemetry)
        box = fit_box(telemetry.values.astype(np.float64), telemetry.name)
        period_s = telemetry.interval_s / box.frequency
        phase = np.mod(-box.begin - telemetry.offset_s / period_s, 1.0)  # relative to the zero of the series' time axis
        return cls([SquareWave(period_s, float(phase), box.duty, box.low, box.high)])

    def get_config(self) -> dict:
        """The settings as plain JSON types, from which `from_config` restores the simulator."""
        return {"waves": [dataclasses.asdict(wave) for wave in self.waves]}

    @classmethod
    def from_config(cls, config: dict) -> "SquareWaveSimulator":
        """Restores a simulator from the output of `get_config`."""
        return cls([SquareWave(**wave) for wave in config["waves"]])


def level_offset_and_scale(coarse: SquareWaveSimulator) -> tuple[float, float]:
    """Returns `(offset, scale)`, so that `(values - offset) / scale` maps the lowest level of a simulator to -1 and the highest to 1."""
    low, high = coarse.levels
    return (low + high) / 2, (high - low) / 2 or 1.0
