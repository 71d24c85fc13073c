"""Environmental noise, step 6 of the paper's pipeline: what a moving average leaves of telemetry.

Also the plain noises that are fitted to it, against which a learned noise has to prove itself.
"""

import numpy as np

from enhsim_tf.errors import InputError


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


class GaussianNoise:
    """Independent Gaussian noise of the standard deviation of the noise it is fitted to: the plainest surrogate.

    Args:
        standard_deviation: In the telemetry's unit.
        window: Samples of a window.
    """

    def __init__(self, standard_deviation: float, window: int):
        self.standard_deviation, self.window = float(standard_deviation), int(window)

    @classmethod
    def fit(cls, windows: np.ndarray) -> "GaussianNoise":
        """Fits to noise windows of shape `(windows, samples)`."""
        return cls(np.std(windows, dtype=np.float64), windows.shape[1])

    def generate(self, num_windows: int, seed: int) -> np.ndarray:
        """Draws noise, float32 of shape `(num_windows, samples)`; the same seed draws the same."""
        rng = np.random.default_rng(seed)
        return (self.standard_deviation * rng.standard_normal((num_windows, self.window))).astype(np.float32)
