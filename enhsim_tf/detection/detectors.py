"""Anomaly detectors, and trivial detectors as controls (title and abstract of the paper).

A detector has `fit(windows)`, which learns what is nominal and returns the detector, and `score(windows)`, which returns one score for each
window; higher is more anomalous. Its threshold is chosen by the caller, with `metrics.threshold`. Windows have the shape
`(windows, samples, channels)`; several channels are given in units of their standard deviations. Where windows are seen channel by channel, a
single channel may do without its axis. `registry` lists all detectors by name.
"""

import numpy as np
from threadpoolctl import threadpool_limits

_WIDTH = 25  # samples of a moving deviation
_BOUND = 1.5  # largest factor by which the scale of nominal residuals may grow
_MEMORY = 64  # past windows whose median size is followed: eight windows that share no sample, at eight windows a length
_OVERLAP = 8  # the last windows, which share samples with the present one, do not count
_LEAST_MEMORY = 16  # with fewer past windows, the scale is that of the nominal residuals
_MOST_ROWS = 40_000  # samples from which the linear prediction of `Innovation` is fitted


def flat(windows: np.ndarray) -> np.ndarray:
    """Windows with the channels one after the other, shape `(windows, channels * samples)`."""
    return windows.swapaxes(1, -1).reshape(len(windows), -1)


class LimitCheck:
    """Limit check, as it is common in ground stations: the distance by which a window leaves the range of the training samples."""

    def fit(self, windows: np.ndarray) -> "LimitCheck":
        """Computes the limits, the quantiles of 0.1 % and 99.9 % of nominal samples."""
        self._limits = np.quantile(windows, [0.001, 0.999], axis=(0, 1))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the largest distance outside the limits, in the unit of the telemetry; within them, minus the remaining margin."""
        beyond = np.maximum(
            self._limits[0] - windows.min(axis=1), windows.max(axis=1) - self._limits[1]
        )
        return beyond.reshape(len(windows), -1).max(axis=1)


class PCAResidual:
    """Residual of a window outside so many principal components of the training windows, also known as Sub-PCA."""

    def __init__(self, num_components: int = 20, seed: int = 0):
        self.num_components, self.seed = num_components, seed

    def fit(self, windows: np.ndarray) -> "PCAResidual":
        """Computes the principal components of nominal windows."""
        from sklearn.decomposition import PCA

        windows = flat(windows)
        with (
            threadpool_limits(1),
            np.errstate(invalid="ignore"),
        ):  # the shares of variance of equal windows are not used
            self._pca = PCA(
                min(self.num_components, *windows.shape),
                svd_solver="randomized",
                random_state=self.seed,
            ).fit(windows)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squared residual of each window."""
        windows = flat(windows)
        with threadpool_limits(1):
            return np.mean(
                (windows - self._pca.inverse_transform(self._pca.transform(windows))) ** 2, axis=1
            )


class JointMeans:
    """Mahalanobis distance of the means of all channels in so many equal parts of a window.

    A small change of one channel against the others is large where they hardly move apart otherwise; shrinkage of the covariance would hide it.
    """

    def __init__(self, num_parts: int = 1):
        self.num_parts = num_parts

    def fit(self, windows: np.ndarray) -> "JointMeans":
        """Estimates mean and covariance from nominal windows."""
        means = self._means(windows)
        self._mean, self._precision = (
            means.mean(axis=0),
            np.linalg.pinv(np.atleast_2d(np.cov(means, rowvar=False)), hermitian=True),
        )
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the squared distance of each window, divided by the number of means: about 1 for nominal windows."""
        apart = self._means(windows) - self._mean
        return np.einsum("wi,ij,wj->w", apart, self._precision, apart) / apart.shape[1]

    def _means(self, windows: np.ndarray) -> np.ndarray:
        values = np.asarray(windows, np.float64)
        parts = np.array_split(values, min(self.num_parts, values.shape[1]), axis=1)
        return np.concatenate([part.mean(axis=1, dtype=np.float64) for part in parts], axis=1)


class JointSize:
    """The larger of two `JointMeans`, of whole windows for faults that last and of quarters for short ones, each in units of its 99 % quantile."""

    def fit(self, windows: np.ndarray) -> "JointSize":
        """Learns nominal windows."""
        self._scales = [JointMeans(number).fit(windows) for number in (1, 4)]
        self._units = [np.quantile(scale.score(windows), 0.99) for scale in self._scales]
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the larger distance of each window."""
        return np.maximum(
            *(
                scale.score(windows) / unit
                for scale, unit in zip(self._scales, self._units, strict=True)
            )
        )


class _Control:
    """A trivial detector without anything to learn. Anomalies that it finds are trivial to detect (Wu and Keogh 2021)."""

    def fit(self, windows: np.ndarray) -> "_Control":
        """Does nothing."""
        return self


class LargestStep(_Control):
    """Control: the largest absolute first difference."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the largest absolute first difference of each window, in the unit of the telemetry."""
        return (
            np.abs(np.diff(windows, axis=1))
            .reshape(len(windows), windows.shape[1] - 1, -1)
            .max(axis=(1, 2))
        )


class MovingDeviation(_Control):
    """Control: the largest standard deviation of 25 neighbouring samples."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the largest moving standard deviation of each window, in the unit of the telemetry."""
        centred = np.asarray(windows, np.float64) - np.mean(
            windows, axis=1, keepdims=True, dtype=np.float64
        )
        centred, width = centred.reshape(*windows.shape[:2], -1), min(_WIDTH, windows.shape[1])
        sums = np.cumsum(np.pad([centred, centred**2], ((0, 0), (0, 0), (1, 0), (0, 0))), axis=2)
        mean, square = (sums[:, :, width:] - sums[:, :, :-width]) / width
        return np.sqrt(np.maximum(square - mean**2, 0).max(axis=(1, 2)))


class Innovation:
    """Size of what a linear prediction from so many past samples of all channels, less in short windows, does not explain.

    The prediction is a vector autoregression, fitted by ridge regression; errors are weighed by the inverse of their covariance. A channel
    that loses its relation to the others, or follows them with another delay, is found although its own values look as before.
    """

    def __init__(self, order: int = 48):
        self.order = order

    def fit(self, windows: np.ndarray) -> "Innovation":
        """Fits the prediction and the covariance of its errors to nominal windows."""
        values = np.asarray(windows, np.float64)
        self._mean, order = values.mean(axis=(0, 1)), max(1, min(self.order, values.shape[1] // 4))
        number = max(1, _MOST_ROWS // (values.shape[1] - order))
        centred = (values - self._mean)[
            np.linspace(0, len(values) - 1, min(number, len(values))).astype(int)
        ]
        view = np.lib.stride_tricks.sliding_window_view(
            centred, order + 1, axis=1
        )  # (windows, places, channels, order + 1)
        past = view[..., :-1].reshape(-1, centred.shape[2] * order)
        now = view[..., -1].reshape(-1, centred.shape[2])
        gram = past.T @ past
        gram[np.diag_indices_from(gram)] += 1e-3 * np.trace(gram) / len(gram) + 1e-12
        self._weights = np.linalg.solve(gram, past.T @ now)
        errors = now - past @ self._weights
        covariance = errors.T @ errors / len(errors)
        covariance[np.diag_indices_from(covariance)] += (
            1e-6 * np.trace(covariance) / len(covariance) + 1e-24
        )
        self._whiten = np.linalg.cholesky(np.linalg.inv(covariance))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean square of the weighed errors of each window, about the number of channels for nominal ones."""
        values = np.asarray(windows, np.float64) - self._mean
        order, channels = len(self._weights) // values.shape[2], values.shape[2]
        kernels = self._weights.reshape(channels, order, channels).astype(
            np.float32
        )  # input, lag from the oldest, output
        scores = np.empty(len(values))
        step = max(1, 2_000_000 // (values.shape[1] * channels))
        for first in range(0, len(values), step):
            some = values[first : first + step].astype(np.float32)
            errors = some[:, order:].copy()
            for lag in range(order):
                errors -= some[:, lag : lag - order] @ kernels[:, lag]
            scores[first : first + step] = np.mean(
                np.sum((errors @ self._whiten.astype(np.float32)) ** 2, axis=2), axis=1
            )
        return scores


def following_drift(sizes: np.ndarray, typical: float, bound: float = _BOUND) -> np.ndarray:
    """Divides sizes of residuals by a factor that follows those of past windows, because nominal ones may change as a channel ages.

    The factor is the median of past sizes in units of the typical one, from 1 to `bound`. So a residual of more than `bound` times the threshold
    is an alarm for as long as it lasts. Sizes are those of windows, evenly spaced in the order of time, shape `(windows,)`.
    """
    import pandas as pd

    factors, first = np.ones(len(sizes)), _OVERLAP + _LEAST_MEMORY
    if typical > 0 and len(sizes) > first:
        past = pd.Series(sizes[: -_OVERLAP - 1]).rolling(_MEMORY, min_periods=1).median()
        factors[first:] = past[_LEAST_MEMORY - 1 :] / typical
    return sizes / np.clip(factors, 1.0, bound)


def root_mean_square(windows: np.ndarray) -> np.ndarray:
    """Returns the root-mean-square of each window, float64 of shape `(windows,)`."""
    return np.sqrt(np.mean(np.asarray(flat(windows), np.float64) ** 2, axis=1))
