"""Degraded modes of the coarse simulator (sections 1 and 3): what is simulated when a component fails or ages."""

import dataclasses
from collections.abc import Callable

import numpy as np

from enhsim_tf.common.errors import InputError

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
