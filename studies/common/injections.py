"""Anomalies in windows, one in each, with the severities and durations of the experiments."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.datasets.anomalies import INJECTIONS, SPIKE_INTERVAL

SEVERITIES = (0.5, 1.0, 2.0, 4.0, 8.0)  # in units of the standard deviation of the noise
DURATIONS = (25, 100, 250)  # in samples


def inject(
    windows: np.ndarray, kind: str, severity: float, noise_sd: float, seed: Sequence[int]
) -> np.ndarray:
    """Injects one anomaly into each window, at a random position.

    The durations alternate between windows, and are at most the length of a window.

    Args:
        windows: Nominal windows, shape `(windows, samples)`.
        kind: Kind of the anomaly, a key of `INJECTIONS`.
        severity: Severity of the anomaly, in units of `noise_sd`.
        noise_sd: Standard deviation of the noise, in the unit of the telemetry.
        seed: Seed of the draws. The same seed gives the same positions for every kind and severity.

    Returns:
        The float32 windows, those of the first duration first.
    """
    parts = []
    for number, duration in enumerate(DURATIONS):
        part = np.array(windows[number :: len(DURATIONS)], np.float32)
        duration = min(duration, windows.shape[1])
        rng = np.random.default_rng([*seed, number])
        begins = rng.integers(0, windows.shape[1] - duration + 1, len(part))
        rows = np.arange(len(part))[:, None]
        columns = begins[:, None] + np.arange(duration)
        means = np.mean(part, axis=1, dtype=np.float64, keepdims=True)
        nominal = np.asarray(part[rows, columns], np.float64)
        pieces = INJECTIONS[kind](nominal, severity * noise_sd, means, rng)
        step = SPIKE_INTERVAL if kind == "spike" else 1  # the samples between spikes are nominal
        part[rows, columns[:, ::step]] = pieces[:, ::step]
        parts.append(part)
    return np.concatenate(parts)
