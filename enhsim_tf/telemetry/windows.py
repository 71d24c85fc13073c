"""Windows of a series: splits by time, offsets, and the windows that begin there."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry


def split_by_time(telemetry: Telemetry, fractions: Sequence[float], gap: int) -> list[Telemetry]:
    """Splits a series into consecutive parts with a gap between them, so that no window of one part touches another.

    Args:
        telemetry: The series.
        fractions: Share of each part; they add up to 1.
        gap: Samples left out between two parts, at least a window.
    """
    if abs(sum(fractions) - 1) > 1e-9 or min(fractions) <= 0:
        raise InputError(f"Expected positive fractions that add up to 1. Received: fractions={tuple(fractions)}. Correct them.")
    usable = len(telemetry) - gap * (len(fractions) - 1)
    lengths = [int(usable * fraction) for fraction in fractions]
    if min(lengths) < 1:
        raise InputError(
            f"Expected a series longer than its gaps. Received: {len(telemetry)} samples with gaps of {gap}. Give a longer one."
        )
    starts = np.cumsum([0] + [length + gap for length in lengths[:-1]])
    return [telemetry.part(start, start + length) for start, length in zip(starts.tolist(), lengths, strict=True)]


def random_offsets(num_samples: int, window: int, num_windows: int, rng: np.random.Generator) -> np.ndarray:
    """First samples of windows "whose beginning and end are offset by a random amount" (paper, section 2.2).

    Args:
        num_samples: Length of the series.
        window: Samples of a window.
        num_windows: Number of windows.
        rng: Draws the offsets.

    Returns:
        Integer array of shape `(num_windows,)`.

    Raises:
        InputError: If the series is shorter than a window.
    """
    if num_samples < window:
        raise InputError(f"Expected at least one window of {window} samples. Received: {num_samples} samples. Give a longer series.")
    return rng.integers(0, num_samples - window + 1, num_windows)


def disjoint_offsets(num_samples: int, window: int) -> np.ndarray:
    """First samples of windows that share no sample: the independent units of a test."""
    return np.arange(num_samples // window) * window


def even_offsets(num_samples: int, window: int, num_windows: int) -> np.ndarray:
    """First samples of windows spread evenly over a series, in the order of time.

    Args:
        num_samples: Length of the series.
        window: Samples of a window.
        num_windows: Number of windows.

    Returns:
        Integer array of shape `(num_windows,)`.
    """
    return np.linspace(0, num_samples - window, num_windows).astype(np.int64)


def cut_windows(values: np.ndarray, offsets: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows out of a series.

    Args:
        values: Series of shape `(samples,)`.
        offsets: First sample of each window, shape `(windows,)`.
        window: Samples of a window.

    Returns:
        Array of shape `(windows, window)`, of the type of `values`.
    """
    return np.lib.stride_tricks.sliding_window_view(values, window)[offsets]
