"""Gaussian noise models that are fitted to extracted noise: baselines for the paper's GAN and for
residual windows (section 2.3).
"""

from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.registry import MATCHED, NONE, RESIDUAL_WINDOWS, noise_model

CANDIDATES = (NONE, "gaussian", "autoregression", RESIDUAL_WINDOWS, MATCHED)
"""The noise models that need no training, the simplest first."""
_MOST_ORDERS = {"gaussian": 0, "autoregression": 200}
Draw = Callable[[np.ndarray, np.random.Generator], np.ndarray]
"""Draws noise below windows of the signal, both of shape `(windows, samples)`."""


def fit_candidate(name: str, noise: np.ndarray, signal: np.ndarray) -> Draw:
    """Fits one of `CANDIDATES` to windows of noise and the enhanced signal below them, both of
    shape `(windows, samples)`.
    """
    if name in _MOST_ORDERS:
        most = min(_MOST_ORDERS[name], noise.shape[1] - 1)
        process = GaussianAutoregression.fit(noise, most)
        return lambda clean, rng: process.generate(len(clean), rng)
    model = noise_model(name).fit(noise[:, :, None], signal[:, :, None])
    return lambda clean, rng: model.generate(len(clean), rng, clean[:, :, None])[:, :, 0]


class GaussianAutoregression:
    """Gaussian autoregressive noise of one channel: it has the spectrum of the real noise, and no
    other property of it.

    Args:
        coefficients: Autoregressive coefficients, from lag 1 upwards. An empty sequence gives white
            noise.
        innovation_sd: Standard deviation of the innovations, in the unit of the telemetry.
        window: Number of samples in a window.

    Raises:
        InputError: If the coefficients do not belong to a stationary process.
    """

    def __init__(self, coefficients: Sequence[float], innovation_sd: float, window: int):
        self.coefficients = np.asarray(coefficients, np.float64)
        self.innovation_sd = float(innovation_sd)
        self.window = window
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
        return cls(coefficients, np.sqrt(variance), windows.shape[1])

    def generate(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Draws windows of noise, float32 of shape `(number, samples)`."""
        from scipy.signal import lfilter

        draws = rng.standard_normal((number, self.window))
        innovations = self.innovation_sd * draws
        whitening = np.concatenate([[1.0], -self.coefficients])
        start = np.zeros((number, min(len(self.coefficients), self.window)))
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
