"""A vector autoregression with inputs: what a control engineer would fit to telemetry and commands
without a simulator.
"""

import numpy as np

from studies.reference_or_source.windows import by_fold

ORDERS = (1, 2, 4, 8)
PENALTIES = (1e-4, 1e-2, 1.0, 100.0)


class Autoregression:
    """Predicts telemetry from its own last samples and from inputs of the same samples.

    Args:
        order: Number of last samples.
        penalty: Penalty of the ridge regression, a factor of the mean square of a standardised
            column.
    """

    def __init__(self, order: int, penalty: float):
        self.order = order
        self.penalty = penalty

    def fit(self, telemetry: np.ndarray, inputs: np.ndarray) -> "Autoregression":
        """Fits nominal windows of shape `(windows, samples, channels)` and `(windows, samples,
        columns)`.
        """
        rows, targets = self._rows(telemetry, inputs)
        self._mean = rows.mean(axis=0)
        self._middle = targets.mean(axis=0)
        deviation = rows.std(axis=0)
        self._scale = np.where(deviation > 1e-9, deviation, np.inf)
        rows = (rows - self._mean) / self._scale
        gram = rows.T @ rows
        gram[np.diag_indices_from(gram)] += self.penalty + 1e-9 * len(rows)
        self._weights = np.linalg.solve(gram, rows.T @ (targets - self._middle))
        return self

    def errors(self, telemetry: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Telemetry less its prediction; the first `order` samples of a window, which nothing
        predicts, are left out.
        """
        values = np.asarray(telemetry, np.float64)
        rows, targets = self._rows(values, inputs)
        predicted = self._middle + (rows - self._mean) / self._scale @ self._weights
        return (targets - predicted).reshape(len(values), -1, values.shape[2])

    def _rows(self, telemetry: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = np.asarray(telemetry, np.float64)
        order = self.order
        lags = [values[:, order - lag : values.shape[1] - lag] for lag in range(order, 0, -1)]
        rows = np.concatenate([*lags, inputs[:, order:]], axis=2)
        return rows.reshape(-1, rows.shape[2]), values[:, order:].reshape(-1, values.shape[2])


def choose(telemetry: np.ndarray, inputs: np.ndarray, folds: np.ndarray) -> Autoregression:
    """The order and penalty with the least error on folds that were not learnt; unfitted."""
    errors = {}
    for order in ORDERS:
        for penalty in PENALTIES:
            model = Autoregression(order, penalty)
            held_out = held_out_errors(model, telemetry, inputs, folds)
            errors[order, penalty] = float(np.mean(held_out[:, -telemetry.shape[1] // 2 :] ** 2))
    return Autoregression(*min(errors, key=errors.__getitem__))


def held_out_errors(
    model: Autoregression, telemetry: np.ndarray, inputs: np.ndarray, folds: np.ndarray
) -> np.ndarray:
    """Errors of each window by a model like this one that has not learnt from its fold."""

    def errors(learnt: np.ndarray, held_out: np.ndarray) -> np.ndarray:
        fitted = Autoregression(model.order, model.penalty)
        fitted.fit(telemetry[learnt], inputs[learnt])
        return fitted.errors(telemetry[held_out], inputs[held_out])

    return by_fold(folds, errors)
