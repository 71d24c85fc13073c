"""Views: simple scores of windows, each of which sees another kind of anomaly. `scorer.Scorer` adds
them up (title and abstract of the paper: "anomaly detection").

To add a view, write its class and add one line to `VIEWS` or `JOINT_VIEWS`; the contract is tested
for all of them.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

_SHARE = 0.95  # of the variance, which the components of `Subspace` hold
_SHRINKAGE = 0.01  # of the covariance of `Level` towards independent channels
_ORDER = 16  # past samples from which `Relation` predicts, fewer in short windows
_PENALTY = 1e-3  # of its ridge regression
_MOST_PREDICTED = 20_000  # samples to which it is fitted
_FLAT = 1e-6  # standard deviation that counts as none


class View(Protocol):
    """What every view does. It learns nominal windows, shape `(windows, samples, channels)`, each
    channel in units of its nominal standard deviation, and scores others.
    """

    def fit(self, windows: np.ndarray) -> "View":
        """Learns nominal windows, and returns the view."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the score of each window, shape `(windows,)`: 0 or more, higher is more
        anomalous, in any unit.
        """


def _flat(windows: np.ndarray) -> np.ndarray:
    return windows.reshape(len(windows), -1)


def _centred(windows: np.ndarray) -> np.ndarray:
    return _flat(windows - windows.mean(axis=1, keepdims=True))


class Shape:
    """Distance of the shape, the window without its means, to the nearest nominal one."""

    def fit(self, windows: np.ndarray) -> "Shape":
        """Keeps the shapes."""
        self._shapes = _centred(windows)
        self._squares = np.sum(self._shapes**2, axis=1)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the Euclidean distances."""
        shapes = _centred(windows)
        nearest = np.argmin(self._squares - 2 * shapes @ self._shapes.T, axis=1)
        # not from the squares: a small difference of large numbers would be rounding error
        return np.linalg.norm(shapes - self._shapes[nearest], axis=1)


class Subspace:
    """Distance from the principal components that hold 95 % of the nominal variance. Of several
    channels, they hold how the channels move together.
    """

    def fit(self, windows: np.ndarray) -> "Subspace":
        """Computes the components."""
        values = _flat(windows)
        self._mean = values.mean(axis=0)
        _, sizes, components = np.linalg.svd(values - self._mean, full_matrices=False)
        shares = np.cumsum(sizes**2) / max(np.sum(sizes**2), _FLAT)
        number = 1 + np.searchsorted(shares, _SHARE)
        self._components = components[:number][sizes[:number] > _FLAT]
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the distances."""
        values = _flat(windows) - self._mean
        inside = values @ self._components.T @ self._components
        return np.linalg.norm(values - inside, axis=1)


class Level:
    """Mahalanobis distance of the means of the channels from the middle of the nominal ones."""

    def fit(self, windows: np.ndarray) -> "Level":
        """Computes mean and covariance of the means."""
        means = windows.mean(axis=1, dtype=np.float64)
        self._mean = means.mean(axis=0)
        covariance = np.atleast_2d(np.cov(means, rowvar=False))
        size = np.trace(covariance) / len(covariance)
        apart = (_SHRINKAGE * size + _FLAT**2) * np.eye(len(covariance))
        self._precision = np.linalg.inv(covariance + apart)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the distances."""
        apart = windows.mean(axis=1, dtype=np.float64) - self._mean
        return np.sqrt(np.maximum(np.sum(apart @ self._precision * apart, axis=1), 0.0))


class Spread:
    """How far the logarithms of the standard deviations are from the nominal medians, the mean over
    the channels. It sees a channel that stands still.
    """

    def fit(self, windows: np.ndarray) -> "Spread":
        """Computes the medians."""
        self._median = np.median(self._logarithms(windows), axis=0)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the distances."""
        return np.abs(self._logarithms(windows) - self._median).mean(axis=1)

    def _logarithms(self, windows: np.ndarray) -> np.ndarray:
        return np.log(windows.std(axis=1) + _FLAT)


class Step:
    """The largest step from one sample to the next, of any channel in units of the largest nominal
    one.
    """

    def fit(self, windows: np.ndarray) -> "Step":
        """Measures the largest nominal step of each channel."""
        self._unit = np.maximum(self._steps(windows).max(axis=0), _FLAT)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the steps."""
        return (self._steps(windows) / self._unit).max(axis=1)

    def _steps(self, windows: np.ndarray) -> np.ndarray:
        return np.abs(np.diff(windows, axis=1)).max(axis=1)


class Relation:
    """What a linear prediction from the past samples of all channels does not explain, the mean
    square in units of its covariance (a vector autoregression by ridge regression). It sees a
    channel that is late, or of another time, although its own values look as before.
    """

    def fit(self, windows: np.ndarray) -> "Relation":
        """Fits the prediction and the covariance of its errors."""
        self._mean = windows.mean(axis=(0, 1))
        self._order = min(_ORDER, windows.shape[1] // 4)
        number = min(len(windows), max(1, _MOST_PREDICTED // windows.shape[1]))
        some = windows[np.linspace(0, len(windows) - 1, number).astype(int)] - self._mean
        past, now = self._past(some)
        past = past.reshape(-1, past.shape[2])
        now = now.reshape(-1, now.shape[2])
        weights = np.linalg.solve(_ridged(past.T @ past, _PENALTY), past.T @ now)
        errors = now - past @ weights
        covariance = _ridged(errors.T @ errors / len(errors), _FLAT)
        self._whiten = np.linalg.cholesky(np.linalg.inv(covariance)).astype(np.float32)
        self._weights = weights.astype(np.float32)
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squares of the errors."""
        centred = windows - self._mean
        errors = centred[:, self._order :].copy()
        # oldest sample first
        for lag, weights in enumerate(np.split(self._weights, self._order)):
            errors -= centred[:, lag : lag - self._order] @ weights
        return np.mean((errors @ self._whiten) ** 2, axis=(1, 2))

    def _past(self, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The samples before each sample, oldest first, and the sample itself."""
        length = windows.shape[1] - self._order
        past = [windows[:, lag : lag + length] for lag in range(self._order)]
        return np.concatenate(past, axis=2, dtype=np.float64), windows[:, self._order :]


def _ridged(matrix: np.ndarray, penalty: float) -> np.ndarray:
    size = penalty * np.trace(matrix) / len(matrix) + _FLAT**2
    return matrix + size * np.eye(len(matrix))


VIEWS: dict[str, Callable[[], View]] = {
    "shape": Shape,
    "subspace": Subspace,
    "level": Level,
    "spread": Spread,
    "step": Step,
}
"""Makes each view by its name."""
JOINT_VIEWS: dict[str, Callable[[], View]] = {"relation": Relation}
"""Makes the views that are added if there are several channels."""
