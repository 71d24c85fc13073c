"""Gaussian noise models that are fitted to extracted noise: baselines for the paper's GAN and for
residual windows (section 2.3).
"""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.registry import MATCHED, NONE, RESIDUAL_WINDOWS, NoiseModel, noise_model

CANDIDATES = (NONE, "gaussian", "autoregression", RESIDUAL_WINDOWS, MATCHED)
"""The noise models that need no training, the simplest first."""
_MOST_ORDER = 200  # of the autoregression


def fit_candidate(name: str, noise: np.ndarray, signal: np.ndarray) -> "GaussianNoise | NoiseModel":
    """Fits one of `CANDIDATES` to windows of noise and the enhanced signal below them, both of
    shape `(windows, samples, channels)`.
    """
    if name == "gaussian":
        return GaussianNoise.fit(noise)
    if name == "autoregression":
        return GaussianNoise.fit_autoregressions(noise, min(_MOST_ORDER, noise.shape[1] - 1))
    return noise_model(name).fit(noise, signal)


class GaussianNoise:
    """Stationary Gaussian noise: white draws that are mixed between channels, and an autoregression
    of each channel, if there are any.

    Args:
        root: Matrix by which independent draws are mixed, shape `(channels, channels)`: their
            covariance is `root @ root.T`.
        window: Number of samples in a window.
        processes: The autoregression of each channel, of which the mixed draws are the innovations.
            Empty: the noise is white.
    """

    def __init__(
        self, root: np.ndarray, window: int, processes: "Sequence[GaussianAutoregression]" = ()
    ):
        self.root = np.asarray(root, np.float64)
        self.window = int(window)
        self.processes = tuple(processes)

    @classmethod
    def fit(cls, windows: np.ndarray) -> "GaussianNoise":
        """Fits white noise to windows of noise of shape `(windows, samples, channels)`."""
        return cls(
            _root(np.cov(windows.reshape(-1, windows.shape[2]), rowvar=False, bias=True)),
            windows.shape[1],
        )

    @classmethod
    def fit_autoregressions(cls, windows: np.ndarray, max_order: int = 40) -> "GaussianNoise":
        """Fits an autoregression to each channel, see `GaussianAutoregression.fit`, and the
        correlation of their innovations.
        """
        from scipy.signal import lfilter

        found = [
            GaussianAutoregression.fit(windows[:, :, channel], max_order)
            for channel in range(windows.shape[2])
        ]
        most = max(len(each.coefficients) for each in found)
        left = [
            lfilter([1.0, *-each.coefficients], [1.0], windows[:, :, k], axis=1)[:, most:].ravel()
            for k, each in enumerate(found)
        ]
        return cls(_root(np.corrcoef(left)), windows.shape[1], found)

    def generate(
        self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None
    ) -> np.ndarray:
        """Draws windows of noise, float32 of shape `(number, samples, channels)`. The signal has no
        effect.
        """
        draws = rng.standard_normal((number, self.window, len(self.root))) @ self.root.T
        if self.processes:
            draws = np.stack(
                [
                    each.filtered(draws[:, :, channel])
                    for channel, each in enumerate(self.processes)
                ],
                axis=2,
            )
        return draws.astype(np.float32)


def _root(covariance: np.ndarray) -> np.ndarray:
    """Returns the symmetric root of a covariance, which may be singular, or of the variance of a
    single channel.
    """
    values, vectors = np.linalg.eigh(np.atleast_2d(covariance))
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


class GaussianAutoregression:
    """Gaussian autoregressive noise of one channel: it has the spectrum of the real noise, and no
    other property of it.

    Args:
        coefficients: Autoregressive coefficients, from lag 1 upwards. An empty sequence gives white
            noise.
        innovation_sd: Standard deviation of the innovations, in the unit of the telemetry.

    Raises:
        InputError: If the coefficients do not belong to a stationary process, or the standard
            deviation is negative.
    """

    def __init__(self, coefficients: Sequence[float], innovation_sd: float):
        self.coefficients = np.asarray(coefficients, np.float64)
        self.innovation_sd = float(innovation_sd)
        if not self.innovation_sd >= 0:
            raise InputError(
                "Expected innovations with a standard deviation of 0 or more. Received: "
                f"{self.innovation_sd}."
            )
        self._start = _lower_orders(self.coefficients, self.innovation_sd)

    @classmethod
    def fit(cls, windows: np.ndarray, max_order: int = 40) -> "GaussianAutoregression":
        """Fits to windows of shape `(windows, samples)` by Burg's method (1975), which always gives
        a stationary process.

        The Akaike information criterion chooses the order, at most `max_order`, which is below the
        number of samples. Raises InputError if the windows are constant.
        """
        forward = backward = np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)
        variance = np.mean(forward**2)
        coefficients = np.zeros(0)
        if not variance > 0:
            raise InputError("Expected noise that varies. Received: windows of one value.")
        orders = [(coefficients, variance)]
        criteria = [windows.size * np.log(variance)]
        for order in range(1, max_order + 1):
            forward = forward[:, 1:]
            backward = backward[:, :-1]
            power = np.sum(forward**2) + np.sum(backward**2)
            if not power > 0:  # the noise is predicted without an error
                break
            reflection = 2 * np.sum(forward * backward) / power
            forward, backward = forward - reflection * backward, backward - reflection * forward
            coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
            variance *= 1 - reflection**2
            orders.append((coefficients, variance))
            criteria.append(windows.size * np.log(variance) + 2 * order)
        coefficients, variance = orders[int(np.argmin(criteria))]
        return cls(coefficients, np.sqrt(variance))

    def filtered(self, draws: np.ndarray) -> np.ndarray:
        """Returns the noise whose innovations are `draws`, standard normal of shape `(windows,
        samples)`; float32 of that shape.
        """
        from scipy.signal import lfilter

        shape = draws.shape
        innovations = self.innovation_sd * draws
        whitening = np.concatenate([[1.0], -self.coefficients])
        start = np.zeros((shape[0], min(len(self.coefficients), shape[1])))
        # each of the first samples is predicted from all earlier ones
        for place in range(start.shape[1]):
            past, sd = self._start[place]
            start[:, place] = start[:, :place][:, ::-1] @ past + sd * draws[:, place]
        if start.size:  # the innovations for which the filter returns these first samples
            innovations[:, : start.shape[1]] = lfilter(whitening, [1.0], start, axis=1)
        return lfilter([1.0], whitening, innovations, axis=1).astype(np.float32)


def _lower_orders(coefficients: np.ndarray, innovation_sd: float) -> list[tuple[np.ndarray, float]]:
    """Returns the best linear predictors of the orders 0, 1, ... and their errors, by the reversed
    Levinson recursion.
    """
    orders = []
    variance = innovation_sd**2
    for _ in range(len(coefficients)):
        reflection = coefficients[-1]
        if not abs(reflection) < 1:
            raise InputError(
                "Expected coefficients of a stationary autoregression. "
                f"Received: a reflection coefficient of {reflection:.4g}, whose magnitude is not "
                "below 1."
            )
        coefficients = (coefficients[:-1] + reflection * coefficients[-2::-1]) / (1 - reflection**2)
        variance /= 1 - reflection**2
        orders.append((coefficients, float(np.sqrt(variance))))
    return orders[::-1]
