"""Quantised telemetry: the levels of a channel, and rounding to them."""

import dataclasses

import numpy as np

_OFTEN = 3  # a value of quantised telemetry counts as a level if it occurs at least this often
_LEAST_SHARE = 0.99  # of the values that must be levels; the others may be interpolated
_UNEVEN = 0.1  # largest deviation of a level from a multiple of the step, in steps


@dataclasses.dataclass(frozen=True)
class Levels:
    """Evenly spaced levels of a quantised channel.

    Args:
        step: Distance between neighbouring levels, in the unit of the telemetry.
        origin: One of the levels.
        count: Number of levels that occur.
    """

    step: float
    origin: float
    count: int

    @classmethod
    def find(cls, values: np.ndarray) -> "Levels | None":
        """Finds the levels of telemetry.

        Args:
            values: The telemetry, shape `(samples,)`. A few values between the levels, such as interpolated ones, are ignored.

        Returns:
            The levels, or None if the telemetry is not quantised.
        """
        levels, counts = np.unique(values, return_counts=True)
        often = levels[counts >= _OFTEN].astype(np.float64)
        if not 2 <= len(often) <= len(values) // 10 or counts[counts >= _OFTEN].sum() < _LEAST_SHARE * len(values):
            return None
        step = float(np.diff(often).min())
        multiples = (often - often[0]) / step
        if np.abs(multiples - np.round(multiples)).max() >= _UNEVEN:  # values of a noise-free wave repeat too, but are not evenly spaced
            return None
        # float32 values deviate from the grid; the longest distance gives the step most precisely
        steps = round(multiples[-1])
        return cls(float(often[-1] - often[0]) / steps, float(often[0]), len(often))

    def round(self, values: np.ndarray) -> np.ndarray:
        """Rounds values to the nearest level, which may lie beyond those that occurred; float32 of the same shape."""
        return (self.origin + self.step * np.rint((np.asarray(values, np.float64) - self.origin) / self.step)).astype(np.float32)
