"""Extraction of the noise: what a moving average leaves of telemetry (section 2.3, Figure 8)."""

import numpy as np

from enhsim_tf.common.errors import InputError


def extract_noise(values: np.ndarray, width: int = 25) -> tuple[np.ndarray, np.ndarray]:
    """Splits a series into its centred moving average and the noise around it (paper, section 2.3).

    The paper cites pandas' rolling mean. The `width - 1` samples at the edges that have no full average are cut.
    White noise of variance s^2 leaves noise of variance s^2 (1 - 1 / width).

    Args:
        values: Series of shape `(samples,)`.
        width: Width of the moving average in samples, odd.

    Returns:
        `(noise, average)`, float32 arrays of shape `(samples - width + 1,)`; both begin at sample `width // 2`.

    Raises:
        InputError: If the width is even, below 3 or longer than the series.
    """
    import pandas as pd

    if width < 3 or width % 2 == 0 or width > len(values):
        raise InputError(f"Expected an odd width from 3 to the {len(values)} samples of the series. Received: width={width}.")
    series = pd.Series(np.asarray(values, np.float64))
    average = series.rolling(width, center=True).mean()
    noise = (series - average).to_numpy()
    half = width // 2
    return noise[half : len(noise) - half].astype(np.float32), average.to_numpy()[half : len(noise) - half].astype(np.float32)


def noise_unit(noise: np.ndarray) -> float:
    """The scale at which noise has a standard deviation of 0.1, well inside the range of a tanh generator."""
    return float(np.std(noise, dtype=np.float64)) / 0.1
