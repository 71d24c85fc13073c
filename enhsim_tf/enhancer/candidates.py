"""The candidates for the enhancer, from the coarse simulator itself to the paper's network, and the
choice among them (section 2.2).

Each is judged on blocks of time that it was not fitted to. The simplest one whose error is within
one standard error, or within 1 %, of the best is used. What no linear map can learn is left to
random rectified features (Rahimi and Recht 2007): a network whose hidden layer is drawn and whose
output layer is a ridge regression. The paper's network is trained only if it is asked for.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse.pairing import covariance_and_power, most_similar
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.enhancer.names import (
    BEST,
    CANDIDATES,
    COARSE,
    LEVEL_AND_GAIN,
    NETWORK,
    RIDGE,
    RIDGE_AND_FEATURES,
)
from enhsim_tf.enhancer.ridge import Ridge, fit_ridge
from enhsim_tf.paper.settings import Settings

_NUM_FEATURES = 1_000  # random rectified features
_NEGLIGIBLE = 0.02  # share of the best candidate's squared error: 1 % of its error
# folds of interleaved blocks, so that each fold covers the beginning, the middle and the end of the
# time
NUM_FOLDS = 3
_MOST_BLOCKS = 9
_WINDOWS_IN_BLOCK = 3  # preferred minimum length of a block, in windows


@dataclasses.dataclass(frozen=True)
class Judged:
    """The error of one candidate on held-out time, with standard errors from disjoint stretches of
    one window each.
    """

    name: str  # one of `CANDIDATES`
    # root-mean-square error, divided by the standard deviation of the targets (NRMSE), over all
    # channels
    error: float
    standard_error: float
    # mean squared error minus that of the best candidate, divided by the targets' variance
    behind: float
    behind_standard_error: float

    @property
    def is_within(self) -> bool:
        """Whether the candidate is within one standard error of the best one, or behind by 1 % of
        its error at most.
        """
        return self.behind <= max(
            self.behind_standard_error, _NEGLIGIBLE * (self.error**2 - self.behind)
        )


@dataclasses.dataclass(frozen=True)
class Choice:
    """The chosen enhancer."""

    enhancer: Enhancer  # fitted to all windows
    judged: tuple[Judged, ...]  # the held-out error of each candidate that was tried
    edges: np.ndarray  # of the blocks of time; the blocks of fold 0 were held out
    # the chosen candidate as it was judged, fitted without the held-out blocks
    without_fold: Enhancer
    # of ridge regression, one for each channel, chosen without the held-out blocks
    penalties: tuple[float, ...]


def choose_enhancer(
    inputs: np.ndarray,
    targets: np.ndarray,
    starts: np.ndarray,
    wanted: str = BEST,
    seed: int = 0,
    epochs: int = 6,
    progress: Progress = SILENT,
) -> Choice:
    """Judges candidates on held-out time and fits the chosen one to all windows.

    Args:
        inputs: Coarse windows, shape `(windows, samples, columns)`.
        targets: Telemetry windows, shape `(windows, samples, channels)`.
        starts: First sample of each window on a common clock, shape `(windows,)`.
        wanted: Name of a candidate to use whatever the errors are, or `best`.
        seed: Random seed of the network and the random features.
        epochs: Passes of the network over the windows.
        progress: Tells the name of each candidate before it is fitted.

    Raises:
        InputError: If the name is unknown, or there is too little time.
    """
    window = inputs.shape[1]
    edges = block_edges(int(starts.min()), int(starts.max()) + window, window)
    rows, held_out = split_fold(starts, window, edges, fold=0)
    if len(rows) < 2 or len(held_out) < 2:
        raise InputError(
            "Expected at least two training windows and two held-out windows. Received: "
            f"{len(rows)} and {len(held_out)} of {len(starts)}. "
            "Give more windows, or longer telemetry."
        )
    stretches = np.unique(starts[held_out] // window, return_inverse=True)[1]
    variance = np.var(targets[held_out], axis=(0, 1), dtype=np.float64)
    variance = np.where(variance > 0, variance, 1.0)
    learnt = Training(inputs[rows], targets[rows], starts[rows])
    fitted = {}
    squared = {}
    for name in CANDIDATES[:-1] if wanted == BEST else dict.fromkeys([COARSE, RIDGE, wanted]):
        progress.step(f"enhancer {name}")
        fitted[name] = learnt.fit(name, seed, epochs)
        apart = (fitted[name].predict(inputs[held_out]) - targets[held_out]) ** 2
        errors = np.mean(apart, axis=1, dtype=np.float64) / variance
        squared[name] = np.bincount(stretches, errors.mean(axis=1)) / np.bincount(stretches)
    judged = judge(squared)
    penalties = learnt.ridge.chosen
    chosen = wanted
    if wanted == BEST:
        chosen = next(candidate.name for candidate in judged if candidate.is_within)
    enhancer = Training(inputs, targets, starts, penalties).fit(chosen, seed, epochs)
    return Choice(enhancer, judged, edges, fitted[chosen], penalties)


def judge(squared: Mapping[str, np.ndarray]) -> tuple[Judged, ...]:
    """Compares candidates by their mean squared errors, in units of the targets' variance, on the
    same held-out stretches of time.
    """
    best = min(squared, key=lambda name: np.mean(squared[name]))
    judged = []
    for name, errors in squared.items():
        error = float(np.sqrt(np.mean(errors)))
        apart = errors - squared[best]
        # the derivative of the root
        spread = _standard_error(errors) / (2 * error) if error else 0.0
        judged.append(Judged(name, error, spread, float(np.mean(apart)), _standard_error(apart)))
    return tuple(judged)


def _standard_error(values: np.ndarray) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0


class Training:
    """Windows that candidates are fitted to; the ridge regression on them is fitted once, for both
    candidates with one.

    Args:
        inputs: Coarse windows, shape `(windows, samples, columns)`.
        targets: Telemetry windows, shape `(windows, samples, channels)`.
        starts: First sample of each window, shape `(windows,)`.
        penalties: Penalty of each channel, as `Choice.penalties` of similar windows; None: chosen
            by blocks of time.
    """

    def __init__(
        self,
        inputs: np.ndarray,
        targets: np.ndarray,
        starts: np.ndarray,
        penalties: Sequence[float] | None = None,
    ):
        self.inputs = inputs
        self.targets = targets
        self.starts = starts
        self.penalties = penalties
        self.centre = inputs.mean(axis=(0, 1), dtype=np.float64)
        self.middle = targets.mean(axis=(0, 1), dtype=np.float64)
        self.scale = _deviations(inputs)
        self.unit = _deviations(targets)
        self.rows = ((inputs - self.centre) / self.scale).astype(np.float32)
        outputs = ((targets - self.middle) / self.unit).astype(np.float32)
        self.outputs = outputs.reshape(len(targets), -1)

    @functools.cached_property
    def ridge(self) -> Ridge:
        """Ridge regression in units of standard deviations."""
        return fit_ridge(
            self.rows, self.outputs, self.starts, num_channels=len(self.unit), chosen=self.penalties
        )

    def fit(self, name: str, seed: int = 0, epochs: int = 6) -> Enhancer:
        """Fits one of `CANDIDATES` to all windows, as in `choose_enhancer`; raises InputError if
        there is none, or the training diverges.
        """
        if name in (COARSE, LEVEL_AND_GAIN):
            return self._keeping_the_shape(name)
        if name not in CANDIDATES:
            raise InputError(
                f"Expected an enhancer, one of: {', '.join(CANDIDATES)}. Received: {name!r}."
            )
        window = self.rows.shape[1]
        flat = self.rows.reshape(len(self.rows), -1)
        column_scale = np.tile(self.scale, window)
        output_unit = np.tile(self.unit, window)
        linear = np.zeros(self.outputs.shape[1])
        factors = ()
        layers = ()
        if name == NETWORK:
            layers = _train(flat, self.outputs, seed, epochs)
        else:
            ridge = self.ridge
            maps = list(self.ridge.factors)
            linear = ridge.target_mean - functools.reduce(np.matmul, maps, ridge.input_mean.ravel())
            maps[0] = maps[0] / column_scale[:, None]
            maps[-1] = maps[-1] * output_unit
            factors = tuple(matrix.astype(np.float32) for matrix in maps)
        if name == RIDGE_AND_FEATURES:
            layers = _random_features(
                flat, self.outputs - ridge.predict(self.rows), self.starts, len(self.unit), seed
            )
        if layers:
            (kernel, bias), *between, (last, last_bias) = layers
            scaled = (
                (kernel / column_scale[:, None], bias),
                *between,
                (last * output_unit, last_bias * output_unit),
            )
            layers = tuple(tuple(np.float32(weights) for weights in layer) for layer in scaled)
            if not all(np.isfinite(weights).all() for layer in layers for weights in layer):
                raise InputError(
                    "Expected telemetry from which the enhancer can learn. Received: a training "
                    "that diverged. "
                    "Look for values far from all others, or use --enhancer ridge."
                )
        return self._enhancer(
            name, np.tile(self.middle, window) + output_unit * linear, factors, layers
        )

    def _keeping_the_shape(self, name: str) -> Enhancer:
        """Fits the two simplest candidates: the most similar coarse column of each channel,
        unchanged or with a level and a gain.
        """
        column = most_similar(self.inputs, self.targets)
        gain = np.ones(len(column))
        level = self.centre[column]
        if name == LEVEL_AND_GAIN:
            covariance, power = covariance_and_power(self.inputs, self.targets)
            safe = np.where(power > 0, power, 1.0)
            gain = covariance[np.arange(len(column)), column] / safe[column]
            level = self.middle
        bias = np.tile(level, self.inputs.shape[1])
        return self._enhancer(name, bias, main=(column, gain.astype(np.float32)))

    def _enhancer(self, name: str, bias: np.ndarray, *parts: Any, **others: Any) -> Enhancer:
        sizes = *self.inputs.shape[1:], self.targets.shape[2]
        return Enhancer(
            name, *sizes, self.centre.astype(np.float32), bias.astype(np.float32), *parts, **others
        )


def _train(
    rows: np.ndarray, wanted: np.ndarray, seed: int, epochs: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Trains the paper's network, whose learning rate falls to zero here; returns kernel and bias
    of each Dense layer.
    """
    from enhsim_tf.common.backend import keras
    from enhsim_tf.paper.enhancer import build_enhancer, train_enhancer

    settings = Settings(seed=seed, epochs=epochs, window=wanted.shape[1])
    falling = keras.optimizers.schedules.CosineDecay(
        settings.learning_rate, epochs * -(-len(rows) // settings.batch_size)
    )
    network = build_enhancer(settings, num_inputs=rows.shape[1])
    train_enhancer(network, rows, wanted, dataclasses.replace(settings, learning_rate=falling))
    return [tuple(layer.get_weights()) for layer in network.layers]


def _random_features(
    rows: np.ndarray, left: np.ndarray, starts: np.ndarray, channels: int, seed: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Fits ridge regression on random rectified features to what the first regression leaves."""
    rng = np.random.default_rng([seed, 11])
    kernel = rng.standard_normal((rows.shape[1], _NUM_FEATURES)) / np.sqrt(rows.shape[1])
    shift = rng.uniform(-1, 1, _NUM_FEATURES)
    ridge = fit_ridge(
        np.maximum(rows @ kernel + shift, 0)[:, None, :], left, starts, num_channels=channels
    )
    weights = functools.reduce(np.matmul, ridge.factors)
    return [(kernel, shift), (weights, ridge.target_mean - ridge.input_mean.ravel() @ weights)]


def _deviations(windows: np.ndarray) -> np.ndarray:
    """Standard deviation of each column, 1 where it is only rounding, shape `(columns,)`."""
    deviation = np.std(windows, axis=(0, 1), dtype=np.float64)
    return np.where(deviation > 1e-6 * np.abs(windows).max(axis=(0, 1), initial=0), deviation, 1.0)


def block_edges(begin: int, end: int, window: int) -> np.ndarray:
    """Returns the edges of contiguous blocks of about equal length between two samples; raises
    InputError if one is shorter than a window.
    """
    num_blocks = int(
        np.clip((end - begin) // (_WINDOWS_IN_BLOCK * window), NUM_FOLDS, _MOST_BLOCKS)
    )
    edges = np.linspace(begin, end, num_blocks + 1).round().astype(np.int64)
    if np.diff(edges).min() < window:
        raise InputError(
            f"Expected at least {NUM_FOLDS} windows of {window} samples, one after another. "
            f"Received: {end - begin} samples. "
            "Give longer telemetry or a smaller window."
        )
    return edges


def split_fold(
    starts: np.ndarray, window: int, edges: np.ndarray, fold: int
) -> tuple[np.ndarray, np.ndarray]:
    """Splits windows, which may overlap, into training windows and held-out windows that share no
    sample; returns the indices of both.

    Block `b` is held out if `b % NUM_FOLDS == fold`. A window across the edge of a held-out block
    is in neither set.
    """
    starts = np.asarray(starts)
    inside, touched = np.zeros((2, len(starts)), bool)
    for block in range(fold, len(edges) - 1, NUM_FOLDS):
        low = edges[block]
        high = edges[block + 1]
        inside |= (starts >= low) & (starts + window <= high)
        touched |= (starts < high) & (starts + window > low)
    return np.flatnonzero(~touched), np.flatnonzero(inside)
