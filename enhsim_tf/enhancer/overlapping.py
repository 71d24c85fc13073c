"""Enhances runs of any length, without seams, by averaging overlapping windows (step 5 of the paper's pipeline)."""

from collections.abc import Callable

import numpy as np

from enhsim_tf.telemetry.windows import cut_windows

_CHUNK = 512  # windows enhanced at a time


def enhance_run(enhance: Callable[[np.ndarray], np.ndarray], coarse: np.ndarray, window: int, hop: int | None = None) -> np.ndarray:
    """Enhances a run: windows that overlap are enhanced and averaged with weights that are largest in the middle of a window.

    The weights are squared sines, which fall to zero at both ends of a window, so that the result is continuous. A weighted
    mean of windows that agree is what they agree on, so no scale changes between windows.

    Args:
        enhance: Function from coarse windows, shape `(windows, window, columns)`, to enhanced windows, `(windows, window)`.
        coarse: The coarse run, shape `(samples, columns)`, with at least `window` samples.
        window: Length of a window in samples.
        hop: Number of samples from one window to the next. None: a quarter of a window.

    Returns:
        float32 array of shape `(samples,)`.
    """
    starts = run_starts(len(coarse), window, hop)
    return average_windows(lambda rows: enhance(cut_run(coarse, starts[rows], window)), starts, window, len(coarse))


def run_starts(num_samples: int, window: int, hop: int | None = None) -> np.ndarray:
    """Returns the starts of overlapping windows that cover a run, the last one at its end."""
    hop = max(1, window // 4) if hop is None else hop
    return np.unique(np.append(np.arange(0, num_samples - window + 1, hop), num_samples - window))


def cut_run(coarse: np.ndarray, starts: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows of all columns out of a run; returns an array of shape `(windows, window, columns)`."""
    return np.stack([cut_windows(coarse[:, column], starts, window) for column in range(coarse.shape[1])], axis=2)


def average_windows(windows_at: Callable[[slice], np.ndarray], starts: np.ndarray, window: int, num_samples: int) -> np.ndarray:
    """Averages overlapping windows into one series.

    Args:
        windows_at: Function from a slice of the window numbers to these windows, shape `(windows, window)`.
        starts: Start of each window in samples, shape `(windows,)`.
        window: Length of a window in samples.
        num_samples: Length of the series.

    Returns:
        float32 array of shape `(num_samples,)`.
    """
    fade = np.sin(np.pi * (np.arange(window) + 0.5) / window) ** 2
    series, total = np.zeros((2, num_samples))
    for first in range(0, len(starts), _CHUNK):
        rows = slice(first, min(first + _CHUNK, len(starts)))
        for start, values in zip(starts[rows], windows_at(rows), strict=True):
            series[start : start + window] += fade * values
            total[start : start + window] += fade
    return (series / total).astype(np.float32)
