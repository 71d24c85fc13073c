"""Averages overlapping windows into a series without seams (step 5 of the paper's pipeline)."""

from collections.abc import Callable

import numpy as np

_CHUNK = 512  # windows enhanced at a time


def run_starts(num_samples: int, window: int, hop: int | None = None) -> np.ndarray:
    """Returns the starts of overlapping windows that cover a run, the last one at its end."""
    hop = max(1, window // 4) if hop is None else hop
    return np.unique(np.append(np.arange(0, num_samples - window + 1, hop), num_samples - window))


def average_windows(windows_at: Callable[[slice], np.ndarray], starts: np.ndarray, window: int, num_samples: int) -> np.ndarray:
    """Averages overlapping windows into one series.

    Args:
        windows_at: Function from a slice of the window numbers to these windows, shape `(windows, window, channels)`.
        starts: Start of each window in samples, shape `(windows,)`.
        window: Length of a window in samples.
        num_samples: Length of the series.

    Returns:
        float32 array of shape `(num_samples, channels)`. The weights are squared sines, which fall to zero at both ends of a window, so that
        the series is continuous.
    """
    fade = (np.sin(np.pi * (np.arange(window) + 0.5) / window) ** 2)[:, None]
    series, total = None, np.zeros((num_samples, 1))
    for first in range(0, len(starts), _CHUNK):
        rows = slice(first, min(first + _CHUNK, len(starts)))
        windows = windows_at(rows)
        series = np.zeros((num_samples, windows.shape[2])) if series is None else series
        for start, values in zip(starts[rows], windows, strict=True):
            series[start : start + window] += fade * values
            total[start : start + window] += fade
    return (series / total).astype(np.float32)
