"""Anomalies in windows, one in each, with the severities and durations of the experiments."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.anomalies import INJECTIONS, SPIKE_INTERVAL, check_kind

SEVERITIES = (0.5, 1.0, 2.0, 4.0, 8.0)  # in units of the standard deviation of the noise
DURATIONS = (25, 100, 250)  # in samples


def inject(
    windows: np.ndarray,
    kind: str,
    severity: float,
    duration: int,
    noise_sd: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Injects one anomaly into each window, at a random position.

    Args:
        windows: Nominal windows, shape `(windows, samples)`.
        kind: Kind of the anomaly, a key of `INJECTIONS`.
        severity: Severity of the anomaly, in units of `noise_sd`.
        duration: Duration of the anomaly, in samples.
        noise_sd: Standard deviation of the noise, in the unit of the telemetry.
        rng: Random number generator. The same state gives the same positions for every kind and
            severity.

    Returns:
        The float32 windows, and a boolean array that marks the anomalous samples, both of the shape
        of `windows`.
    """
    check_kind(kind, severity)
    if not 1 <= duration <= windows.shape[1]:
        raise InputError(
            f"Expected a duration of 1 to {windows.shape[1]} samples. Received: "
            f"duration={duration}."
        )
    begins = rng.integers(0, windows.shape[1] - duration + 1, len(windows))
    rows = np.arange(len(windows))[:, None]
    columns = begins[:, None] + np.arange(duration)
    means = np.mean(windows, axis=1, dtype=np.float64, keepdims=True)
    pieces = INJECTIONS[kind](
        np.asarray(windows[rows, columns], np.float64), severity * noise_sd, means, rng
    )
    anomalous = np.array(windows, np.float32)
    mask = np.zeros(windows.shape, bool)
    step = SPIKE_INTERVAL if kind == "spike" else 1  # the samples between spikes are nominal
    anomalous[rows, columns[:, ::step]] = pieces[:, ::step]
    mask[rows, columns[:, ::step]] = True
    return anomalous, mask


def inject_durations(
    windows: np.ndarray, kind: str, severity: float, noise_sd: float, seed: Sequence[int]
) -> np.ndarray:
    """Injects one anomaly into each window, see `inject`. The durations alternate between windows,
    which are returned duration by duration; those longer than a window have its length.

    Args:
        windows: Nominal windows, shape `(windows, samples)`.
        kind: Kind of the anomaly.
        severity: Severity of the anomaly.
        noise_sd: Standard deviation of the noise.
        seed: Seed for the positions, to which the number of the duration is added.
    """
    parts = [
        inject(
            windows[number :: len(DURATIONS)],
            kind,
            severity,
            min(duration, windows.shape[1]),
            noise_sd,
            np.random.default_rng([*seed, number]),
        )[0]
        for number, duration in enumerate(DURATIONS)
    ]
    return np.concatenate(parts)
