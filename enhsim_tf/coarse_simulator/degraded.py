"""Degraded modes of the coarse simulator (sections 1 and 3 of the paper): simulates components that fail or age."""

import dataclasses
from collections.abc import Callable

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.paper import square_wave

MODES = {
    "stuck": "the mechanism stands still from the onset, for the fraction `severity` of the remaining time",
    "drift": "adds a ramp that reaches `severity` times the difference between highest and lowest level at the end",
    "gain_loss": "the amplitude around the middle level is multiplied by 1 - `severity`",
    "friction": "motion is delayed by a random lag of up to `severity` times a quarter of the shortest period",
    "dropout": "random runs of 10 samples, half of all runs at severity 1, read the lowest level",
    "period_change": "every period is multiplied by 1 + `severity`",
}


_NUM_SHIFTS = 100  # time shifts tried in each direction by `synchronise`, in steps of 0.5 % of a period


@dataclasses.dataclass(frozen=True)
class Degraded:
    """A degraded mode of the target vehicle (paper, sections 1 and 3).

    Args:
        mode: One of `MODES`: stuck, drift, gain_loss, friction, dropout, period_change.
        severity: Severity from 0 to 1. At 0 the signal is bit-identical to the nominal one.
        onset: Start of the degradation, as a fraction of the window or series: at least 0 and less than 1.
        channel: The only channel that is degraded; None for all.

    Raises:
        InputError: If the mode is unknown or a number is out of range.
    """

    mode: str
    severity: float = 0.5
    onset: float = 0.25
    channel: str | None = None

    def __post_init__(self):
        if self.mode not in MODES:
            raise InputError(f"Expected a mode, one of: {', '.join(MODES)}. Received: mode={self.mode!r}.")
        if not (0 <= self.severity <= 1 and 0 <= self.onset < 1):
            raise InputError(f"Expected 0 <= severity <= 1 and 0 <= onset < 1. Received: {self}.")

    def first_sample(self, num_samples: int) -> int:
        """Sample of a window or series at which the degradation starts.

        The product is rounded before it is truncated, since 0.29 * 100 is 28.999999999999996.

        Args:
            num_samples: Length of the window or series.
        """
        return int(round(self.onset * num_samples, 6))


def degrade(
    signal: Callable[[np.ndarray], np.ndarray],
    time_s: np.ndarray,
    scenario: Degraded | None,
    levels: tuple[float, float],
    shortest_period_s: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Applies a degraded mode to a signal.

    The signal is given as a function of time. The coarse simulator and, if it is known in closed form, the true vehicle are
    therefore degraded in the same way by the same scenario and the same state of `rng`.

    Args:
        signal: The nominal signal, a function from times in seconds to values of the same shape.
        time_s: Times in seconds, shape `(windows, samples)`.
        scenario: The degraded mode, or None for the nominal signal.
        levels: Lowest and highest nominal level.
        shortest_period_s: Shortest period of the signal in seconds.
        rng: Random number generator for the lags of `friction` and the gaps of `dropout`.

    Returns:
        float64 array of shape `(windows, samples)`.
    """
    if scenario is None or scenario.severity == 0:
        return signal(time_s)
    onset = min(scenario.first_sample(time_s.shape[1]), time_s.shape[1] - 1)
    return square_wave.degrade(signal, time_s, scenario.mode, scenario.severity, levels, shortest_period_s, rng, onset)
