"""Resampled residuals: a noise model without a network that draws whole windows of real noise (a baseline of section 2.3)."""

import numpy as np

from enhsim_tf.common.errors import InputError


class WindowBootstrap:
    """Draws whole windows of real noise, with replacement (Efron 1979).

    Within a window, the noise is real, with all its correlations. A longer series consists of windows that overlap by a quarter
    and are cross-faded with a sine and a cosine. The squares of these weights add up to one, which preserves the variance,
    because two windows that are drawn independently are uncorrelated.

    Args:
        windows: Windows of real noise, float32 of shape `(windows, samples)`.

    Raises:
        InputError: If there is no window, or a value is not finite.
    """

    def __init__(self, windows: np.ndarray):
        self.windows = np.asarray(windows, np.float32)
        if self.windows.ndim != 2 or self.windows.shape[0] < 1 or self.windows.shape[1] < 4 or not np.isfinite(self.windows).all():
            raise InputError(
                f"Expected finite windows of noise of at least 4 samples. Received: shape {self.windows.shape}. Extract noise first."
            )

    @classmethod
    def fit(cls, windows: np.ndarray) -> "WindowBootstrap":
        """Stores noise windows of shape `(windows, samples)`."""
        return cls(windows)

    @property
    def scale(self) -> float:
        """Standard deviation of the noise."""
        return float(np.std(self.windows, dtype=np.float64))

    def generate(self, num_windows: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws windows, float32 of shape `(num_windows, samples)`. The same seed gives the same windows."""
        rng = np.random.default_rng(seed)
        return self.windows[rng.integers(0, len(self.windows), num_windows)]

    def generate_series(self, num_samples: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws a series of any length without seams, float32 of shape `(num_samples,)`. The same seed gives the same series."""
        rng, window = np.random.default_rng(seed), self.windows.shape[1]
        fade = window // 4
        hop = window - fade
        lead = int(rng.integers(0, hop))  # a random beginning, so that every sample of the series has the same distribution
        num_windows = -(-(num_samples + lead + fade) // hop)
        rise = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade)
        weights = np.concatenate([rise, np.ones(window - 2 * fade), rise[::-1]])
        series = np.zeros(num_windows * hop + fade)
        for number, drawn in enumerate(self.generate(num_windows, rng)):
            series[number * hop : number * hop + window] += weights * drawn
        begin = fade + lead
        return series[begin : begin + num_samples].astype(np.float32)
