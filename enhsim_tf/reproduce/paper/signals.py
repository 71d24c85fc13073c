"""Closed-form signals that serve as ground truth. `noise_processes` has the noise."""

from collections.abc import Sequence

import numpy as np


def sines(time_s: np.ndarray, periods_s: Sequence[float], amplitudes: Sequence[float]) -> np.ndarray:
    """A sum of sines, the paper's example telemetry without its noise (section 2: periods of 8 and 2 minutes).

    Args:
        time_s: Times in seconds, any shape.
        periods_s: Period of each sine in seconds.
        amplitudes: Amplitude of each sine.

    Returns:
        float64 array of the shape of `time_s`.
    """
    pairs = zip(periods_s, amplitudes, strict=True)
    return sum(amplitude * np.sin(2 * np.pi * np.asarray(time_s) / period) for period, amplitude in pairs)
