"""Ridge regression from coarse windows to telemetry windows: what a network has to beat as an
enhancer (section 2.2).

Its penalty is chosen by cross-validation over blocks of time, and the result does not depend on the
units of the windows.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.telemetry.windows import time_blocks

# of standardised inputs, so they fit every unit
PENALTIES = tuple(float(penalty) for penalty in np.logspace(-3, 6, 19))
_NUM_BLOCKS = 5  # of time, for cross-validation
_ROUNDING = 1e-12  # a column whose deviation is below this share of its largest value is constant


@dataclasses.dataclass(frozen=True)
class Ridge:
    """A fitted ridge regression from input windows to target windows; all arrays are float64."""

    # their product is of shape `(samples * columns, outputs)`: one, or two that hold fewer numbers
    factors: tuple[np.ndarray, ...]
    input_mean: np.ndarray  # mean training window, shape `(samples, columns)`
    target_mean: np.ndarray  # mean training target, shape `(outputs,)`
    chosen: tuple[float, ...]  # the penalty of each channel

    @property
    def penalty(self) -> float:
        """The chosen penalty; of several channels, the smallest."""
        return min(self.chosen)

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Predicts the targets of windows as in training, float32 of shape `(windows, outputs)`."""
        mapped = np.asarray(inputs, np.float64).reshape(len(inputs), -1) - self.input_mean.ravel()
        for factor in self.factors:
            mapped = mapped @ factor
        return (self.target_mean + mapped).astype(np.float32)


def fit_ridge(
    inputs: np.ndarray,
    targets: np.ndarray,
    starts: np.ndarray | None = None,
    *,
    penalties: Sequence[float] = PENALTIES,
    num_channels: int = 1,
    chosen: Sequence[float] | None = None,
) -> Ridge:
    """Fits ridge regression, with a penalty for each channel chosen by cross-validation over blocks
    of time.

    Inputs are centred per sample and divided by one standard deviation per column, so that the
    result does not depend on units. Samples are not scaled one by one, because that would blow up
    the rounding errors of constant ones. Among penalties with the same error, the largest is
    chosen.

    Args:
        inputs: Input windows of shape `(windows, samples)` or `(windows, samples, columns)`.
        targets: Target windows of shape `(windows, outputs)`.
        starts: First sample of each window, shape `(windows,)`. None: the windows are in the order
            of time and share no sample.
        penalties: Penalties to choose from: factors of the sum of squared weights of the
            standardised inputs.
        num_channels: Number of channels of the targets. Output `o` belongs to channel `o %
            num_channels`.
        chosen: Penalty of each channel, if it was chosen before; nothing is cross-validated then.

    Returns:
        The regression, fitted to all windows.
    """
    windows = np.asarray(inputs, np.float64)
    targets = np.asarray(targets, np.float64)
    windows = windows[:, :, None] if windows.ndim == 2 else windows
    starts = np.arange(len(windows)) * windows.shape[1] if starts is None else np.asarray(starts)
    if chosen is None:
        chosen = _choose_penalties(
            windows, targets, starts, np.asarray(penalties, np.float64), num_channels
        )
    solution = RidgeSolution(windows, targets)
    of_outputs = np.tile(chosen, targets.shape[1] // num_channels)
    left = solution.basis / solution.scale[:, None]
    right = solution.coefficients(of_outputs)
    is_low_rank = left.size + right.size < len(left) * right.shape[1]
    factors = (left, right) if is_low_rank else (left @ right,)
    return Ridge(factors, solution.input_mean, solution.target_mean, tuple(map(float, chosen)))


def _choose_penalties(
    windows: np.ndarray,
    targets: np.ndarray,
    starts: np.ndarray,
    penalties: np.ndarray,
    num_channels: int,
) -> list[float]:
    """Returns the penalty of each channel with the least error on held-out blocks of time; of a
    single window, the largest.
    """
    squares = np.zeros((len(penalties), num_channels))
    power = np.zeros(num_channels)
    for training, held_out in time_blocks(starts, _NUM_BLOCKS, windows.shape[1]):
        solution = RidgeSolution(windows[training], targets[training])
        inner = solution.project(windows[held_out])
        centred = targets[held_out] - solution.target_mean
        power += _by_channel((targets[held_out] - targets.mean(axis=0)) ** 2, num_channels)
        for number, penalty in enumerate(penalties):
            squares[number] += _by_channel(
                (centred - inner @ solution.coefficients(penalty)) ** 2, num_channels
            )
    errors = np.sqrt(squares / np.where(power > 0, power, 1.0))
    return [penalties[channel_errors == channel_errors.min()].max() for channel_errors in errors.T]


def _by_channel(squares: np.ndarray, num_channels: int) -> np.ndarray:
    """Sums squares of outputs, shape `(windows, outputs)`, over windows and samples; returns shape
    `(channels,)`.
    """
    return squares.sum(axis=0).reshape(-1, num_channels).sum(axis=0)


class RidgeSolution:
    """Ridge regression at every penalty, from one eigendecomposition; windows and targets are those
    of `fit_ridge`, in float64.

    The smaller of the two Gram matrices is decomposed: that of the inputs, or that of the windows
    if there are fewer windows.
    """

    def __init__(self, windows: np.ndarray, targets: np.ndarray):
        self.input_mean = windows.mean(axis=0)
        self.target_mean = targets.mean(axis=0)
        # of each column about its mean window
        deviation = np.sqrt(np.mean((windows - self.input_mean) ** 2, axis=(0, 1)))
        is_constant = deviation <= _ROUNDING * np.abs(windows).max(axis=(0, 1))
        self.scale = np.tile(np.where(is_constant, 1.0, deviation), windows.shape[1])
        design = self._standardised(windows)
        outputs = targets - self.target_mean
        if len(design) >= design.shape[1]:
            self.values, self.basis = np.linalg.eigh(design.T @ design)
            self.moments = self.basis.T @ (design.T @ outputs)
        else:
            self.values, vectors = np.linalg.eigh(design @ design.T)
            self.basis = design.T @ vectors
            self.moments = vectors.T @ outputs

    def _standardised(self, windows: np.ndarray) -> np.ndarray:
        return (windows - self.input_mean).reshape(len(windows), -1) / self.scale

    def project(self, windows: np.ndarray) -> np.ndarray:
        """Returns what `coefficients` weigh: the prediction is their product plus `target_mean`."""
        return self._standardised(windows) @ self.basis

    def coefficients(self, penalty: float | np.ndarray) -> np.ndarray:
        """Returns the weights for one penalty, or for a penalty of each output."""
        return self.moments / (np.maximum(self.values, 0.0)[:, None] + penalty)
