"""A vector autoregression with inputs: what a control engineer would fit to telemetry and commands
without a simulator.
"""

import numpy as np
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from studies.reference_or_source.windows import by_fold

ORDERS = (1, 2, 4, 8)
PENALTIES = (1e-4, 1e-2, 1.0, 100.0)


class Autoregression:
    """Predicts telemetry from its own last samples and from inputs of the same samples.

    Args:
        order: Number of last samples.
        penalty: Penalty of the ridge regression on standardised columns.
    """

    def __init__(self, order: int, penalty: float):
        self.order = order
        self._machine = make_pipeline(StandardScaler(), Ridge(penalty, solver="cholesky"))

    def fit(self, telemetry: np.ndarray, inputs: np.ndarray) -> "Autoregression":
        """Fits nominal windows of shape `(windows, samples, channels)` and `(windows, samples,
        columns)`.
        """
        self._machine.fit(*self._rows(telemetry, inputs))
        return self

    def errors(self, telemetry: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Telemetry less its prediction; the first `order` samples of a window, which nothing
        predicts, are left out.
        """
        rows, targets = self._rows(telemetry, inputs)
        apart = targets - self._machine.predict(rows)
        return apart.reshape(len(telemetry), -1, telemetry.shape[2])

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
    """Errors of each window by the model while it has not learnt from the window's fold."""

    def errors(learnt: np.ndarray, held_out: np.ndarray) -> np.ndarray:
        model.fit(telemetry[learnt], inputs[learnt])
        return model.errors(telemetry[held_out], inputs[held_out])

    return by_fold(folds, errors)
