"""Degraded configurations (sections 1 and 3): six modes, which are this project's."""

import numpy as np

from enhsim_tf.paper.square_wave import Signal

MODES = ("stuck", "drift", "gain_loss", "friction", "dropout", "period_change")
"""Degraded modes: the mechanism stands still, the sensor drifts or loses gain, motion lags, samples
are lost, periods grow.
"""
RUN = 10  # samples that `dropout` loses at a time


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

    The signal is a function of time, so that the true signal and the simulation are degraded alike
    by the same state of `rng`.

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
        raise ValueError(
            f"Expected a mode, nominal or one of {', '.join(MODES)}. Received: {mode!r}."
        )
    late = time[:, onset:]
    time = time.copy()
    low, high = levels
    begin = late[:, :1]

    # what ails the mechanism changes when the signal happens
    if mode == "stuck":
        until = begin + severity * (late[:, -1:] - begin)
        time[:, onset:] = np.where(late <= until, begin, late)
    elif mode == "period_change":
        time[:, onset:] = begin + (late - begin) / (1 + severity)
    elif mode == "friction":
        quarter = shortest_period / 4
        elapsed = late[0] - late[0, 0]
        knots = np.arange(0, elapsed[-1] + shortest_period, quarter)
        lags = rng.uniform(0, severity * quarter, (len(time), len(knots)))
        lags[:, 0] = 0
        time[:, onset:] = late - np.stack([np.interp(elapsed, knots, lag) for lag in lags])
    values = signal(time)

    # what ails the sensor changes its values
    after = values[:, onset:]
    middle = (low + high) / 2
    if mode == "drift":
        after += severity * (high - low) * np.linspace(0, 1, after.shape[1])
    elif mode == "gain_loss":
        after[:] = middle + (1 - severity) * (after - middle)
    elif mode == "dropout":
        lost = rng.random((len(time), -(-after.shape[1] // RUN))) < severity / 2
        after[np.repeat(lost, RUN, axis=1)[:, : after.shape[1]]] = low
    return values
