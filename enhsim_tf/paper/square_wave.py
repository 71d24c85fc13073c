"""Sections 1 and 2.1: the simple, fast simulation, and degraded configurations, whose six modes are this project's.

"This simulation can be quite coarse - for example a square wave can be used for nearly any periodic waveform" (introduction).
"""

from collections.abc import Callable

import numpy as np

from enhsim_tf.paper.settings import Settings

Signal = Callable[[np.ndarray], np.ndarray]

MODES = ("stuck", "drift", "gain_loss", "friction", "dropout", "period_change")
"""Degraded modes: the mechanism stands still, the sensor drifts or loses gain, motion lags, samples are lost, periods grow."""
RUN = 10  # samples that `dropout` loses at a time


def square_wave(time: np.ndarray, period: float, amplitude: float) -> np.ndarray:
    """A square wave at times in seconds: `amplitude` in the first half of each period and `-amplitude` in the second."""
    return np.where(np.mod(time / period, 1.0) < 0.5, amplitude, -amplitude)


def simulator(settings: Settings) -> Signal:
    """Step 1: the simulator of the example, here a square wave in place of each sine, as a function of the time in seconds."""

    def simulate(time: np.ndarray) -> np.ndarray:
        orbit = square_wave(time, settings.orbit_period, settings.orbit_amplitude)
        return orbit + square_wave(time, settings.rotation_period, settings.rotation_amplitude)

    return simulate


def degrade(
    signal: Signal,
    time: np.ndarray,
    mode: str,
    severity: float,
    levels: tuple[float, float],
    shortest_period: float,
    rng: np.random.Generator,
    onset: int,
) -> np.ndarray:
    """A signal in a degraded mode.

    The signal is a function of time, so that the true signal and the simulation are degraded alike by the same state of `rng`.

    Args:
        signal: The nominal signal.
        time: Times in seconds, shape `(windows, samples)`.
        mode: One of `MODES`, or `nominal`.
        severity: Severity from 0 to 1.
        levels: Lowest and highest nominal level.
        shortest_period: Shortest period of the signal in seconds.
        rng: Draws the lags of `friction` and the losses of `dropout`.
        onset: The first sample that is degraded.

    Returns:
        float64 array of shape `(windows, samples)`.

    Raises:
        ValueError: If there is no such mode.
    """
    if mode not in ("nominal", *MODES):
        raise ValueError(f"Expected a mode, nominal or one of {', '.join(MODES)}. Received: {mode!r}.")
    time, late, (low, high) = time.copy(), time[:, onset:], levels
    begin = late[:, :1]

    # what ails the mechanism changes when the signal happens
    if mode == "stuck":
        until = begin + severity * (late[:, -1:] - begin)
        time[:, onset:] = np.where(late <= until, begin, late)
    elif mode == "period_change":
        time[:, onset:] = begin + (late - begin) / (1 + severity)
    elif mode == "friction":
        quarter, elapsed = shortest_period / 4, late[0] - late[0, 0]
        knots = np.arange(0, elapsed[-1] + shortest_period, quarter)
        lags = rng.uniform(0, severity * quarter, (len(time), len(knots)))
        lags[:, 0] = 0
        time[:, onset:] = late - np.stack([np.interp(elapsed, knots, lag) for lag in lags])
    values = signal(time)

    # what ails the sensor changes its values
    after, middle = values[:, onset:], (low + high) / 2
    if mode == "drift":
        after += severity * (high - low) * np.linspace(0, 1, after.shape[1])
    elif mode == "gain_loss":
        after[:] = middle + (1 - severity) * (after - middle)
    elif mode == "dropout":
        lost = rng.random((len(time), -(-after.shape[1] // RUN))) < severity / 2
        after[np.repeat(lost, RUN, axis=1)[:, : after.shape[1]]] = low
    return values
