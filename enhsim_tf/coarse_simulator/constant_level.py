"""A coarse simulator for channels without a shape that repeats: one constant level (step 1 of the paper's pipeline).

Everything else that the telemetry does is noise to it, so its enhanced simulator generates noise around levels that occurred.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError


class ConstantLevel(SquareWaveSimulator):
    """A constant level, in the form of a square wave whose two levels are equal.

    The degraded modes of the sensor, `drift` and `dropout`, change it. Those of a mechanism do not, because nothing moves; but in a
    series, telemetry that is stuck no longer follows the levels of the record.

    Args:
        level: The level, in the unit of the telemetry.
        spread: Standard deviation of the telemetry, above 0. Degraded modes take `level - spread` and `level + spread` as the
            lowest and the highest level.
        period_s: A time without meaning, for code that expects a period.

    Raises:
        InputError: If a number is not finite, or if the spread or the period is not above 0.
    """

    columns = ("constant level",)

    def __init__(self, level: float, spread: float, period_s: float = 1.0):
        if not (np.isfinite([level, spread]).all() and spread > 0):
            raise InputError(f"Expected a finite level and a spread above 0. Received: level={level}, spread={spread}.")
        super().__init__([SquareWave(period_s, low=float(level), high=float(level))])
        self.level, self.spread = float(level), float(spread)

    @property
    def is_constant(self) -> bool:
        """True: no window of this simulator has a shape."""
        return True

    @property
    def levels(self) -> tuple[float, float]:
        """Lowest and highest level for degraded modes and units."""
        return self.level - self.spread, self.level + self.spread

    def get_config(self) -> dict:
        """The settings as plain JSON types, from which `waves_or_level` restores the simulator."""
        return {"level": self.level, "spread": self.spread, "period_s": self.waves[0].period_s}


def waves_or_level(config: Mapping[str, Any]) -> SquareWaveSimulator:
    """Restores a simulator from the output of `get_config`: a constant level, or square waves."""
    return ConstantLevel(**config) if "level" in config else SquareWaveSimulator.from_config(config)
