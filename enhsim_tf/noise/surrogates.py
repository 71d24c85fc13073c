"""Environmental noise, step 6 of the paper's pipeline: what a moving average leaves of telemetry.

Also the plain noises that are fitted to it, against which a learned noise has to prove itself.
"""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError


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

    def generate(self, num_windows: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws noise, float32 of shape `(num_windows, samples)`; the same seed draws the same."""
        return self._draw((num_windows, self.window), seed)

    def generate_series(self, num_samples: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws one series of any length, float32 of shape `(num_samples,)`."""
        return self._draw((1, num_samples), seed)[0]

    def _draw(self, shape: tuple[int, int], seed: int | np.random.Generator) -> np.ndarray:
        return (self.standard_deviation * np.random.default_rng(seed).standard_normal(shape)).astype(np.float32)


class GaussianAutoregression:
    """Gaussian noise of the spectrum of the noise it is fitted to: an autoregression of the order that AIC chooses.

    What a spectrum and an autocorrelation can see of noise, and nothing else of it.

    Args:
        coefficients: Of the last sample, of the one before it and so on; an empty sequence is white noise.
        innovation_sd: Standard deviation of what is new at each sample, in the telemetry's unit.
        window: Samples of a window.

    Raises:
        InputError: If the coefficients grow without bound.
    """

    def __init__(self, coefficients: Sequence[float], innovation_sd: float, window: int):
        self.coefficients, self.innovation_sd, self.window = np.asarray(coefficients, np.float64), float(innovation_sd), int(window)
        self._start = _lower_orders(self.coefficients, self.innovation_sd)

    @classmethod
    def fit(cls, windows: np.ndarray, max_order: int = 40) -> "GaussianAutoregression":
        """Fits to noise windows by least squares of the forward and the backward prediction (Burg 1975), pooled over the windows.

        Burg's coefficients are stationary whatever the noise, and windows of any length weigh the same at each lag.

        Args:
            windows: Noise windows of shape `(windows, samples)`.
            max_order: The largest order that AIC may choose.

        Raises:
            InputError: If the windows are not longer than the largest order, or stand still.
        """
        if windows.shape[1] <= max_order:
            raise InputError(f"Expected windows of more samples than max_order={max_order}. Received: {windows.shape[1]} samples.")
        forward = backward = np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)
        variance, coefficients = np.mean(forward**2), np.zeros(0)
        if not variance > 0:
            raise InputError("Expected noise that varies. Received: windows of one value.")
        fits = [(windows.size * np.log(variance), coefficients, variance)]
        for order in range(1, max_order + 1):
            forward, backward = forward[:, 1:], backward[:, :-1]
            reflection = 2 * np.sum(forward * backward) / (np.sum(forward**2) + np.sum(backward**2))
            forward, backward = forward - reflection * backward, backward - reflection * forward
            coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
            variance *= 1 - reflection**2
            fits.append((windows.size * np.log(variance) + 2 * order, coefficients, variance))
        _, coefficients, variance = min(fits, key=lambda fit: fit[0])
        return cls(coefficients, np.sqrt(variance), windows.shape[1])

    def generate(self, num_windows: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws noise, float32 of shape `(num_windows, samples)`, stationary from its first sample on; the same seed draws the same."""
        return self._draw((num_windows, self.window), seed)

    def generate_series(self, num_samples: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws one series of any length, float32 of shape `(num_samples,)`."""
        return self._draw((1, num_samples), seed)[0]

    def _draw(self, shape: tuple[int, int], seed: int | np.random.Generator) -> np.ndarray:
        from scipy.signal import lfilter

        draws = np.random.default_rng(seed).standard_normal(shape)
        innovations, whitening = self.innovation_sd * draws, np.concatenate([[1.0], -self.coefficients])
        start = np.zeros((shape[0], min(len(self.coefficients), shape[1])))
        for place in range(start.shape[1]):  # each of the first samples is predicted from as many as there are before it
            past, sd = self._start[place]
            start[:, place] = start[:, :place][:, ::-1] @ past + sd * draws[:, place]
        if start.size:  # so that the filter answers with that start
            innovations[:, : start.shape[1]] = lfilter(whitening, [1.0], start, axis=1)
        return lfilter([1.0], whitening, innovations, axis=1).astype(np.float32)


def _lower_orders(coefficients: np.ndarray, innovation_sd: float) -> list[tuple[np.ndarray, float]]:
    """Coefficients and error of the best prediction from the last 0, 1, ... samples, by Levinson's recursion downwards."""
    orders, variance = [], innovation_sd**2
    for _ in range(len(coefficients)):
        reflection = coefficients[-1]
        if not abs(reflection) < 1:
            raise InputError(
                f"Expected coefficients of a stationary autoregression. Received: a reflection of {reflection:.4g}, not within 1."
            )
        coefficients = (coefficients[:-1] + reflection * coefficients[-2::-1]) / (1 - reflection**2)
        variance /= 1 - reflection**2
        orders.append((coefficients, float(np.sqrt(variance))))
    return orders[::-1]


class BlockBootstrap:
    """Blocks of the real noise itself, drawn at random and put end to end: a ceiling that nothing has learnt.

    Within a block all is real; across a seam nothing is. The seams fall anywhere in a window, so that no sample is
    special (Künsch 1989).

    Args:
        windows: Noise windows of shape `(windows, samples)`.
        block: Samples of a block.

    Raises:
        InputError: If a block does not fit into a window.
    """

    def __init__(self, windows: np.ndarray, block: int = 50):
        if not 1 <= block <= windows.shape[1]:
            raise InputError(f"Expected a block of 1 to the {windows.shape[1]} samples of a window. Received: block={block}.")
        self.windows, self.block = np.asarray(windows, np.float32), int(block)

    @classmethod
    def fit(cls, windows: np.ndarray, block: int = 50) -> "BlockBootstrap":
        """Keeps noise windows of shape `(windows, samples)` to cut blocks of `block` samples from."""
        return cls(windows, block)

    def generate(self, num_windows: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws noise, float32 of shape `(num_windows, samples)`; the same seed draws the same."""
        return self._draw((num_windows, self.windows.shape[1]), seed)

    def generate_series(self, num_samples: int, seed: int | np.random.Generator) -> np.ndarray:
        """Draws one series of any length, float32 of shape `(num_samples,)`; it has a seam after each block."""
        return self._draw((1, num_samples), seed)[0]

    def _draw(self, shape: tuple[int, int], seed: int | np.random.Generator) -> np.ndarray:
        rng, (num_rows, samples) = np.random.default_rng(seed), shape
        chain = (num_rows, -(-samples // self.block) + 1)
        sources = rng.integers(0, len(self.windows), chain)
        begins = rng.integers(0, self.windows.shape[1] - self.block + 1, chain)
        places = np.arange(samples) + rng.integers(0, self.block, (num_rows, 1))  # where in its chain of blocks a window begins
        rows, blocks = np.arange(num_rows)[:, None], places // self.block
        return self.windows[sources[rows, blocks], begins[rows, blocks] + places % self.block]
