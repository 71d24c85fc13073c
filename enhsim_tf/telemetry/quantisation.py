"""Quantised telemetry: the levels of a channel, and rounding to them."""

import dataclasses
from collections.abc import Sequence

import numpy as np

_OFTEN = 3  # a value of quantised telemetry counts as a level if it occurs at least this often
_LEAST_SHARE = 0.99  # of the values that must be levels; the others may be interpolated
_UNEVEN = 0.1  # largest deviation of a level from a multiple of the step, in steps
# values closer than this share of their range are one level: the difference of two float32 series
# is not exactly on the grid
_SAME = 1e-6


@dataclasses.dataclass(frozen=True)
class Levels:
    """Evenly spaced levels of a quantised channel."""

    step: float  # distance between neighbouring levels, in the unit of the telemetry
    origin: float  # one of the levels
    count: int  # number of levels that occur

    @classmethod
    def find(cls, values: np.ndarray) -> "Levels | None":
        """Finds the levels of telemetry.

        Args:
            values: The telemetry, of any shape. A few values between the levels, such as
                interpolated ones, are ignored.

        Returns:
            The levels, or None if the telemetry is not quantised.
        """
        levels, counts = _distinct(values)
        often = levels[counts >= _OFTEN]
        if not 2 <= len(often) <= np.size(values) // 10 or counts[
            counts >= _OFTEN
        ].sum() < _LEAST_SHARE * np.size(values):
            return None
        step = float(np.diff(often).min())
        multiples = (often - often[0]) / step
        # values of a noise-free wave repeat too, but are not evenly spaced
        if np.abs(multiples - np.round(multiples)).max() >= _UNEVEN:
            return None
        # float32 values deviate from the grid; the longest distance gives the step most precisely
        steps = round(multiples[-1])
        return cls(float(often[-1] - often[0]) / steps, float(often[0]), len(often))

    def round(self, values: np.ndarray) -> np.ndarray:
        """Rounds values to the nearest level, which may lie beyond those that occurred; float32 of
        the same shape.
        """
        return (
            self.origin
            + self.step * np.rint((np.asarray(values, np.float64) - self.origin) / self.step)
        ).astype(np.float32)


def _distinct(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the distinct values in rising order and how often each occurs. Values that differ by
    a rounding error are one value.

    A run of many values, each close to the next, is not one value: where values are that dense,
    they are returned as they are.
    """
    distinct, counts = np.unique(np.asarray(values, np.float64), return_counts=True)
    same = _SAME * (distinct[-1] - distinct[0])
    first = np.flatnonzero(np.diff(distinct, prepend=-np.inf) > same)
    last = np.append(first[1:], len(distinct)) - 1
    if np.max(distinct[last] - distinct[first]) > 2 * same:
        return distinct, counts
    numbers = np.add.reduceat(counts, first)
    return np.add.reduceat(distinct * counts, first) / numbers, numbers


def rounded(values: np.ndarray, quantisation: Sequence[Levels | None]) -> np.ndarray:
    """Rounds quantised channels, the last axis, to their levels in place, and returns the
    values.
    """
    for channel, levels in enumerate(quantisation):
        if levels is not None:
            values[..., channel] = levels.round(values[..., channel])
    return values
