"""Windows of a series: splitting by time, window offsets, and cutting windows."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry


def split_by_time(telemetry: Telemetry, fractions: Sequence[float], gap: int) -> list[Telemetry]:
    """Splits a series into consecutive parts with gaps between them, so that windows of different parts do not overlap.

    Args:
        telemetry: The series.
        fractions: Fraction of the samples in each part. They add up to 1.
        gap: Number of samples left out between two parts, at least one window.

    Returns:
        The parts in chronological order.

    Raises:
        InputError: If the fractions are not positive or do not add up to 1, or the series is too short.
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
    """Draws random window offsets: windows "whose beginning and end are offset by a random amount" (paper, section 2.2).

    Args:
        num_samples: Length of the series.
        window: Window length in samples.
        num_windows: Number of windows.
        rng: Random number generator.

    Returns:
        Integer array of shape `(num_windows,)`.

    Raises:
        InputError: If the series is shorter than a window.
    """
    if num_samples < window:
        raise InputError(f"Expected at least one window of {window} samples. Received: {num_samples} samples. Give a longer series.")
    return rng.integers(0, num_samples - window + 1, num_windows)


def disjoint_offsets(num_samples: int, window: int) -> np.ndarray:
    """Offsets of consecutive windows that do not overlap, which are used as the independent units of statistical tests.

    Args:
        num_samples: Length of the series.
        window: Window length in samples.

    Returns:
        Integer array of shape `(windows,)`.
    """
    return np.arange(num_samples // window) * window


def even_offsets(num_samples: int, window: int, num_windows: int) -> np.ndarray:
    """Offsets of windows that are spread evenly over a series, in chronological order.

    Args:
        num_samples: Length of the series.
        window: Window length in samples.
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
        window: Window length in samples.

    Returns:
        Array of shape `(windows, window)` with the dtype of `values`.
    """
    return np.lib.stride_tricks.sliding_window_view(values, window)[offsets]
