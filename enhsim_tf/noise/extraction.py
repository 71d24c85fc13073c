"""Noise extraction: the residual of telemetry around its moving average (section 2.3, Figure 8)."""

import numpy as np

from enhsim_tf.common.errors import InputError


def extract_noise(values: np.ndarray, width: int = 25) -> tuple[np.ndarray, np.ndarray]:
    """Splits a series into its centred moving average and the residual noise (section 2.3 of the paper).

    Like the paper, this function uses the rolling mean of pandas. It drops the `width // 2` samples at each end, for which
    the moving average is incomplete. If the series contains white noise of variance s^2, the extracted noise has the
    variance s^2 (1 - 1 / width).

    Args:
        values: Series of shape `(samples,)`.
        width: Width of the moving average in samples, odd.

    Returns:
        `(noise, average)`, two float32 arrays of shape `(samples - width + 1,)`. Their first element belongs to sample
        `width // 2` of the series.

    Raises:
        InputError: If the width is even, smaller than 3 or larger than the length of the series.
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
    """Returns the unit in which the noise has a standard deviation of 0.1, well within the range of a tanh generator.

    Args:
        noise: Noise of any shape.
    """
    return float(np.std(noise, dtype=np.float64)) / 0.1
