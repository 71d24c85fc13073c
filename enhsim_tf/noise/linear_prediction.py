"""Linear predictions of noise and of the size of their errors, from the whole past of a window (an alternative to the GAN of section 2.3).

Long correlations, periods and slow changes of loudness are to a large part linear: the next sample is near a weighted sum of those before
it, and the magnitude of the error of this prediction near a weighted sum of those of the predictions before it. The weights are fitted in
closed form, for all lags of up to half a window. The autoregressive network starts from these predictions.
"""

from collections.abc import Mapping

import numpy as np

from enhsim_tf.noise.surrogates import GaussianAutoregression

_MAX_ORDER = 400  # samples
_LEAST_ERROR = 1e-3  # of a prediction, in standard deviations: predictions are float32 numbers
_LEAST_MAGNITUDE = 0.02  # of a predicted magnitude, in standard deviations


class LinearPrediction:
    """Predicts each sample of a window, and the magnitude of the error of this prediction, from the samples before it.

    Args:
        values: Autoregression of the noise, which is in units of its standard deviation.
        magnitudes: Autoregression of the magnitude of its errors, in units of their standard deviation, minus `mean_magnitude`.
        mean_magnitude: Mean of this magnitude.
    """

    def __init__(self, values: GaussianAutoregression, magnitudes: GaussianAutoregression, mean_magnitude: float):
        self.values, self.magnitudes, self.mean_magnitude = values, magnitudes, float(mean_magnitude)
        errors = [values.at(place)[1] for place in range(values.window)]
        self.errors = np.maximum(errors, _LEAST_ERROR).astype(np.float32)
        """Standard deviation of the error of the predicted value at each place of a window, shape `(samples,)`."""

    @classmethod
    def of_white_noise(cls, window: int) -> "LinearPrediction":
        """The predictions of white Gaussian noise, which are constant."""
        return cls(GaussianAutoregression([], 1.0, window), GaussianAutoregression([], 1.0, window), np.sqrt(2 / np.pi))

    @classmethod
    def fit(cls, windows: np.ndarray, held_out: np.ndarray) -> "LinearPrediction":
        """Fits both autoregressions by Burg's method.

        Args:
            windows: Noise windows in units of their standard deviation, shape `(windows, samples)`.
            held_out: Other noise windows, in the order of time, which choose the orders.
        """
        order = min(_MAX_ORDER, windows.shape[1] // 2)
        values = GaussianAutoregression.fit(windows, order, held_out)
        if values.innovation_sd < _LEAST_ERROR:  # a prediction without an error leaves nothing to learn, and cannot be computed exactly
            values = GaussianAutoregression([], 1.0, windows.shape[1])
        found = cls(values, GaussianAutoregression([], 1.0, windows.shape[1]), 0.0)
        loud, held_out_loud = (found.loudness(each, values.predict(each)) for each in (windows, held_out))
        mean_magnitude = float(np.mean(loud, dtype=np.float64))
        loud, held_out_loud = loud - mean_magnitude, held_out_loud - mean_magnitude
        if np.ptp(loud) > 0:
            magnitudes = GaussianAutoregression.fit(loud, order, held_out_loud)
        else:  # two values of equal magnitude
            magnitudes = GaussianAutoregression([], 1.0, windows.shape[1])
        return cls(values, magnitudes, mean_magnitude)

    def predict(self, windows: np.ndarray) -> np.ndarray:
        """Returns the predicted value of each sample, and the logarithm of the predicted magnitude of its error.

        Args:
            windows: Noise windows, float32 of shape `(windows, samples)`.

        Returns:
            float32 array of shape `(windows, samples, 2)`. Magnitudes are in units of the standard deviation of the error.
        """
        predicted = self.values.predict(windows)
        magnitudes = self.magnitudes.predict(self.loudness(windows, predicted))
        return np.stack([predicted, self._log(magnitudes)], axis=2).astype(np.float32)

    def loudness(self, windows: np.ndarray, predicted: np.ndarray, place: int = 0) -> np.ndarray:
        """Returns the magnitude of the errors of predicted values, in units of their standard deviation, minus its mean.

        Args:
            windows: Noise, shape `(windows, samples)`.
            predicted: Its prediction, same shape.
            place: Place of the first sample in a window.
        """
        errors = self.errors[place : place + windows.shape[1]]
        return np.abs(windows - predicted) / errors - self.mean_magnitude

    def next(self, past: np.ndarray, loudness: np.ndarray, place: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns the same for the sample that follows.

        Args:
            past: The last samples, at least as many as a window has but one, zero before the first one; shape `(rows, samples)`.
            loudness: As returned by `loudness`, in the same form.
            place: Number of samples before the one that is predicted.

        Returns:
            Two arrays of shape `(rows,)`.
        """
        found = []
        for model, values in ((self.values, past), (self.magnitudes, loudness)):
            coefficients, _ = model.at(place)
            found.append(values[:, values.shape[1] - len(coefficients) :] @ coefficients[::-1].astype(np.float32))
        return found[0], self._log(found[1])

    def _log(self, magnitudes: np.ndarray) -> np.ndarray:
        return np.log(np.maximum(magnitudes + self.mean_magnitude, _LEAST_MAGNITUDE))

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """What is saved."""
        numbers = [self.values.innovation_sd, self.magnitudes.innovation_sd, self.mean_magnitude]
        return {"values": self.values.coefficients, "magnitudes": self.magnitudes.coefficients, "numbers": np.array(numbers)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], window: int) -> "LinearPrediction":
        """Makes the predictions again from `arrays`.

        Raises:
            ValueError: If the arrays do not belong to predictions within a window.
        """
        values, magnitudes, numbers = (np.asarray(arrays[name], np.float64) for name in ("values", "magnitudes", "numbers"))
        if numbers.shape != (3,) or not (numbers >= 0).all() or any(each.ndim != 1 or len(each) >= window for each in (values, magnitudes)):
            raise ValueError("linear predictions of an impossible form")
        return cls(*(GaussianAutoregression(*each, window) for each in ((values, numbers[0]), (magnitudes, numbers[1]))), numbers[2])
