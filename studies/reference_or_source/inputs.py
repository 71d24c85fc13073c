"""What is known from the commands alone: the commands, their running sums, and what a patient
engineer adds to them; and regressions on it in place of a simulator.
"""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.signal import lfilter

from enhsim_tf.enhancer.candidates import Training

_AVERAGES = (0.1, 0.5, 2.0, 5.0)  # time constants of running averages, in windows
Map = Callable[[np.ndarray], np.ndarray]


def inputs_of(commands: np.ndarray, unit_samples: int | None, window: int) -> np.ndarray:
    """Columns that a regression can use in place of a simulator.

    Args:
        commands: Commands of shape `(samples, commands)`, in units of about 1 and around 0.
        unit_samples: Samples after which sums and averages begin anew; None: never.
        window: Samples of a window, the unit of the averages' time constants.

    Returns:
        Float64 of shape `(samples, columns)`, see `columns_of`: the time since the unit began, the
        commands and their running sums; running averages of the commands and of their squares; and
        squares and cubes of commands and sums.
    """
    number = len(commands) if unit_samples is None else unit_samples
    units = np.asarray(commands, np.float64).reshape(-1, number, commands.shape[1])
    sums = np.cumsum(units, axis=1) / window
    # a run that never begins anew has no clock
    clock = np.zeros((len(units), number, 1))
    if unit_samples is not None:
        clock += np.arange(number)[:, None] / window
    averages = []
    for constant in _AVERAGES:
        decay = np.exp(-1 / (constant * window))
        for values in (units, units**2):
            # begins with the first value, as if it had always been there
            first = decay * values[:, :1]
            averages.append(lfilter([1 - decay], [1, -decay], values, axis=1, zi=first)[0])
    powers = [values**power for values in (units, sums) for power in (2, 3)]
    columns = np.concatenate([clock, units, sums, *averages, *powers], axis=2)
    return columns.reshape(-1, columns.shape[2])


def columns_of(num_columns: int) -> dict[str, int]:
    """How many of the first columns of `inputs_of` are plain (time, commands and sums), how many
    are these with averages, and all of them.
    """
    commands = (num_columns - 1) // (6 + 2 * len(_AVERAGES))
    return {
        "plain": 1 + 2 * commands,
        "averages": 1 + (2 + 2 * len(_AVERAGES)) * commands,
        "all": num_columns,
    }


def fit_map(
    coarse: np.ndarray,
    telemetry: np.ndarray,
    starts: np.ndarray,
    name: str = "ridge",
) -> Map:
    """Fits an enhancer of the package to windows; returns a function of coarse windows."""
    return Training(coarse, telemetry, starts).fit(name, 0).predict


def regressions(num_columns: int) -> "Mapping[str, Callable[..., Map]]":
    """The regressions among which held-out windows choose, each a function of inputs, telemetry and
    starts of windows that returns a map.
    """
    number = columns_of(num_columns)

    def of_windows(columns: str, name: str = "ridge") -> Callable[..., Map]:
        first = slice(number[columns])

        def fit(inputs: np.ndarray, telemetry: np.ndarray, starts: np.ndarray) -> Map:
            predict = fit_map(inputs[:, :, first], telemetry, starts, name)
            return lambda windows: predict(windows[:, :, first])

        return fit

    def of_samples(penalty: float) -> Callable[..., Map]:
        first = slice(number["averages"])
        return lambda inputs, telemetry, starts: _quadratic(inputs, telemetry, first, penalty)

    return {
        "plain": of_windows("plain"),
        "averages": of_windows("averages"),
        "averages and random features": of_windows("averages", "ridge and random features"),
        "all": of_windows("all"),
        "quadratic, penalty 1": of_samples(1.0),
        "quadratic, penalty 100": of_samples(100.0),
    }


def _quadratic(inputs: np.ndarray, telemetry: np.ndarray, first: slice, penalty: float) -> Map:
    """Ridge regression of each sample on the columns at its time, their squares and products."""
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler
    from threadpoolctl import threadpool_limits

    def rows(windows: np.ndarray) -> np.ndarray:
        return np.concatenate(windows[:, :, first]).astype(np.float64)

    channels = telemetry.shape[2]
    machine = make_pipeline(
        StandardScaler(),
        PolynomialFeatures(2, include_bias=False),
        StandardScaler(),
        Ridge(penalty, solver="cholesky"),
    )
    with threadpool_limits(1):
        machine.fit(rows(inputs), telemetry.reshape(-1, channels))
    return lambda windows: machine.predict(rows(windows)).reshape(*windows.shape[:2], channels)
