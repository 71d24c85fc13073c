"""A ladder of enhancers, from the coarse simulator itself to the paper's network, evaluated on held-out time (section 2.2).

The paper's network is one of several maps from coarse to realistic windows. This module fits several of them, measures the
error of each on blocks of time that it was not trained on, and chooses the simplest map that is not measurably worse than the
best one. Each map is a rung of the ladder. Every rung is expressed as a Keras network, so that all of them are saved and loaded in
the same way.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.backend import keras
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.training import dense_stack, fit_windows, predict_windows
from enhsim_tf.enhancer import network as enhancer_network
from enhsim_tf.enhancer.held_out_blocks import block_edges, split_fold
from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.enhancer.rung_networks import linear_network, sum_of_networks
from enhsim_tf.enhancer.scaling import Scaling

COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_NETWORK, NETWORK = RUNGS = (
    "coarse",
    "level and gain",
    "ridge",
    "ridge and network",
    "network",
)
"""The rungs, the simplest first: the coarse simulator itself; one level and one gain; ridge regression on all coarse columns;
ridge regression plus a small network that learns what it leaves; the paper's network."""

_SMALL_UNITS = 256  # units of each hidden layer of the network on what ridge regression leaves
_SMALL_RATE, _PAPER_RATE = 5e-4, 1e-3  # initial learning rates, which fall to zero along a cosine
_BATCH_SIZE = 15  # of both networks, as in the paper


@dataclasses.dataclass(frozen=True)
class Rung:
    """One fitted enhancer.

    Args:
        name: One of `RUNGS`.
        network: Keras network from flattened, scaled inputs to scaled targets.
        scaling: Units of the network.
    """

    name: str
    network: keras.Model
    scaling: Scaling

    def predict(self, inputs: np.ndarray, batch_size: int = 1_024) -> np.ndarray:
        """Maps coarse windows to enhanced windows.

        Args:
            inputs: Coarse windows, shape `(windows, samples, columns)` or, for one column, `(windows, samples)`.
            batch_size: Number of windows in each call of the network.

        Returns:
            float32 array of shape `(windows, outputs)`, in the unit of the targets.
        """
        return self.scaling.unscale_target(predict_windows(self.network, self.scaling.scale_inputs(inputs), batch_size))


@dataclasses.dataclass(frozen=True)
class Judged:
    """The error of one rung on held-out time.

    Args:
        name: One of `RUNGS`.
        error: Root-mean-square error on held-out time, divided by the standard deviation of the targets (NRMSE).
        standard_error: Standard error of `error`, from its variation between disjoint stretches of one window each.
        behind: Mean squared error minus that of the best rung, divided by the targets' variance.
        behind_standard_error: Standard error of `behind`, from the same stretches. It is smaller than that of the two errors,
            because both rungs are judged on the same stretches.
    """

    name: str
    error: float
    standard_error: float
    behind: float
    behind_standard_error: float

    @property
    def is_within(self) -> bool:
        """Whether the rung is within one standard error of the best one."""
        return self.behind <= self.behind_standard_error


@dataclasses.dataclass(frozen=True)
class Ladder:
    """Rungs that were fitted to the same windows, and their errors on held-out time.

    Args:
        rungs: Rungs fitted to all windows, by name: all rungs, or the chosen one.
        judged: The held-out error of each rung, in the order of `RUNGS`.
        chosen: Name of the simplest rung within one standard error of the best one.
        num_stretches: Number of disjoint held-out stretches of one window each.
        edges: Edges of the blocks of time; the blocks of fold 0 were held out, see `held_out_blocks`.
        before_refit: The rungs as they were judged, fitted without the held-out blocks.
    """

    rungs: Mapping[str, Rung]
    judged: tuple[Judged, ...]
    chosen: str
    num_stretches: int
    edges: np.ndarray
    before_refit: Mapping[str, Rung]

    @property
    def errors(self) -> dict[str, float]:
        """The held-out error (NRMSE) of each rung."""
        return {each.name: each.error for each in self.judged}

    @property
    def standard_errors(self) -> dict[str, float]:
        """The standard error of each rung's held-out error."""
        return {each.name: each.standard_error for each in self.judged}

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Maps coarse windows to enhanced windows with the chosen rung; see `Rung.predict`."""
        return self.rungs[self.chosen].predict(inputs)


def fit_ladder(
    inputs: np.ndarray,
    targets: np.ndarray,
    starts: np.ndarray,
    rungs: Sequence[str] = RUNGS,
    seed: int = 0,
    epochs: int = 6,
    refit: str = "all",
    wanted: str | None = None,
    scaling: Scaling | None = None,
    on_rung: Callable[[str], None] | None = None,
) -> Ladder:
    """Judges rungs on held-out time and fits them to all windows.

    Every third of up to nine blocks of time is held out once for all rungs. Training windows that overlap it are left
    out, see `held_out_blocks`.

    Args:
        inputs: Coarse windows, shape `(windows, samples, columns)` or, for one column, `(windows, samples)`.
        targets: Telemetry windows, shape `(windows, outputs)`.
        starts: First sample of each window on a common clock, shape `(windows,)`, in any order.
        rungs: Names of the rungs to judge.
        seed: Random seed of the networks.
        epochs: Passes of the networks over the training windows.
        refit: Which rungs are fitted again to all windows: `all` or `chosen`.
        wanted: Name of a rung to choose whatever the errors are. None: the simplest within one standard error of the best.
        scaling: Units of the networks. None: the mean and the standard deviation of each column.
        on_rung: Called with the name of each rung before it is judged.

    Returns:
        The ladder.

    Raises:
        InputError: If a name is unknown, shapes do not match, a value is not finite, or there is too little time.
    """
    inputs, targets, starts = check_windows(inputs, targets, starts)
    chosen_rungs = [name for name in RUNGS if name in rungs]
    if not chosen_rungs or set(rungs) - set(RUNGS) or refit not in ("all", "chosen") or wanted not in (None, *chosen_rungs):
        raise InputError(f"Expected rungs among {', '.join(RUNGS)}, refit all or chosen. Received: {tuple(rungs)}, {refit!r}.")
    window = inputs.shape[1]
    edges = block_edges(int(starts.min()), int(starts.max()) + window, window)
    learnt, held_out = split_fold(starts, window, edges, fold=0)
    if len(learnt) < 2 or len(held_out) < 2:
        raise InputError(
            f"Expected at least two training windows and two held-out windows. Received: {len(learnt)} and {len(held_out)} of {len(starts)}. "
            "Give more windows, or longer telemetry."
        )
    stretches = np.unique(starts[held_out] // window, return_inverse=True)[1]
    variance = float(np.var(targets[held_out], dtype=np.float64)) or 1.0
    squared, before_refit = {}, {}
    for name in chosen_rungs:
        if on_rung is not None:
            on_rung(name)
        before_refit[name] = rung = fit_rung(name, inputs[learnt], targets[learnt], starts[learnt], seed, epochs, scaling)
        errors = np.mean((rung.predict(inputs[held_out]) - targets[held_out]) ** 2, axis=1, dtype=np.float64)
        squared[name] = np.bincount(stretches, errors) / np.bincount(stretches) / variance
    judged = judge(squared)
    chosen = wanted or next(each.name for each in judged if each.is_within)
    refitted = chosen_rungs if refit == "all" else [chosen]
    fitted = {name: fit_rung(name, inputs, targets, starts, seed, epochs, scaling) for name in refitted}
    return Ladder(fitted, judged, chosen, int(stretches.max()) + 1, edges, before_refit)


def judge(squared: Mapping[str, np.ndarray]) -> tuple[Judged, ...]:
    """Compares the rungs by their errors on the same held-out stretches of time.

    Args:
        squared: For each rung, the mean squared error on each stretch, divided by the targets' variance, shape `(stretches,)`.

    Returns:
        The comparison of each rung, in the given order.
    """
    best = min(squared, key=lambda name: np.mean(squared[name]))
    judged = []
    for name, errors in squared.items():
        error, apart = float(np.sqrt(np.mean(errors))), errors - squared[best]
        spread = _standard_error(errors) / (2 * error) if error else 0.0  # the derivative of the root
        judged.append(Judged(name, error, spread, float(np.mean(apart)), _standard_error(apart)))
    return tuple(judged)


def _standard_error(values: np.ndarray) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0


def fit_rung(
    name: str,
    inputs: np.ndarray,
    targets: np.ndarray,
    starts: np.ndarray,
    seed: int = 0,
    epochs: int = 6,
    scaling: Scaling | None = None,
) -> Rung:
    """Fits one rung to all of the given windows.

    Args:
        name: One of `RUNGS`.
        inputs: Coarse windows, shape `(windows, samples, columns)` or, for one column, `(windows, samples)`.
        targets: Telemetry windows, shape `(windows, outputs)`.
        starts: First sample of each window, shape `(windows,)`.
        seed: Random seed of the networks.
        epochs: Passes of the networks over the windows.
        scaling: Units of the networks. None: the mean and the standard deviation of each column.

    Returns:
        The fitted rung.
    """
    inputs, targets, starts = check_windows(inputs, targets, starts)
    scaling = Scaling.fit(inputs, targets) if scaling is None else scaling
    rows, wanted = scaling.scale_inputs(inputs), scaling.scale_target(targets)
    window, columns = inputs.shape[1:]
    if name in (COARSE, LEVEL_AND_GAIN):
        return Rung(name, _level_and_gain(name, inputs, targets, scaling), scaling)
    if name == NETWORK:
        network = enhancer_network.build_enhancer(window, seed=seed, columns=columns)
        return Rung(name, _train(network, rows, wanted, epochs, seed, _PAPER_RATE), scaling)
    ridge = fit_ridge(rows.reshape(inputs.shape), wanted, starts)
    linear = ridge.weights, ridge.target_mean - ridge.input_mean.ravel() @ ridge.weights
    if name == RIDGE:
        return Rung(name, linear_network(*linear, "ridge"), scaling)
    left = wanted - (rows @ linear[0] + linear[1])
    unit = float(np.std(left, dtype=np.float64)) or 1.0
    small = dense_stack(window * columns, (_SMALL_UNITS, _SMALL_UNITS, targets.shape[1]), seed, "rest")
    small = _train(small, rows, (left / unit).astype(np.float32), epochs, seed, _SMALL_RATE)
    return Rung(name, sum_of_networks(linear_network(*linear, "ridge"), small, unit), scaling)


def _level_and_gain(name: str, inputs: np.ndarray, targets: np.ndarray, scaling: Scaling) -> keras.Model:
    """Returns the network of the two simplest rungs: the most similar coarse column, unchanged or with a level and a gain."""
    means = inputs.mean(axis=(0, 1), dtype=np.float64)
    if inputs.shape[1] != targets.shape[1]:
        raise InputError(f"Expected targets as long as the coarse windows for the rung {name!r}. Received: {targets.shape[1]} samples.")
    centred, target = inputs - means, targets - targets.mean(dtype=np.float64)
    covariance = np.einsum("wsc,ws->c", centred, target)
    power = np.einsum("wsc,wsc->c", centred, centred)
    safe = np.where(power > 0, power, 1.0)
    main = int(np.argmax(covariance**2 / safe))
    gain = covariance[main] / safe[main] if name == LEVEL_AND_GAIN else 1.0
    level = float(targets.mean(dtype=np.float64)) - gain * means[main] if name == LEVEL_AND_GAIN else 0.0
    # in the units of the network: level + gain * (centre + scale * x), minus the target's centre, divided by its scale
    kernel = np.zeros((inputs.shape[1], inputs.shape[2], targets.shape[1]))
    kernel[np.arange(inputs.shape[1]), main, np.arange(targets.shape[1])] = gain * scaling.input_scale[main] / scaling.target_scale
    bias = (level + gain * scaling.input_centre[main] - scaling.target_centre) / scaling.target_scale
    return linear_network(kernel.reshape(-1, targets.shape[1]), np.full(targets.shape[1], bias), "level_and_gain")


def _train(network: keras.Model, rows: np.ndarray, wanted: np.ndarray, epochs: int, seed: int, rate: float) -> keras.Model:
    falling = keras.optimizers.schedules.CosineDecay(rate, epochs * -(-len(rows) // _BATCH_SIZE))
    fit_windows(network, rows, wanted, epochs, _BATCH_SIZE, seed, falling, verbose=0)
    return network


def check_windows(inputs: Any, targets: Any, starts: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Checks training windows and adds the axis of the columns if it is missing.

    Args:
        inputs: Coarse windows, shape `(windows, samples, columns)` or `(windows, samples)`.
        targets: Telemetry windows, shape `(windows, outputs)`.
        starts: First sample of each window, shape `(windows,)`.

    Returns:
        Inputs of shape `(windows, samples, columns)`, targets and starts.

    Raises:
        InputError: If the shapes do not match, there is no window, or a value is not finite.
    """
    inputs, targets, starts = np.asarray(inputs), np.asarray(targets), np.asarray(starts)
    inputs = inputs[:, :, None] if inputs.ndim == 2 else inputs
    if inputs.ndim != 3 or targets.ndim != 2 or starts.shape != (len(inputs),) or len(targets) != len(inputs) or not inputs.size:
        raise InputError(
            "Expected inputs of shape (windows, samples, columns), targets (windows, outputs) and starts (windows,). "
            f"Received: {inputs.shape}, {targets.shape}, {starts.shape}."
        )
    if not (np.isfinite(inputs).all() and np.isfinite(targets).all()):
        raise InputError("Expected finite windows. Received: NaN or infinite values. Fill or cut them.")
    return inputs, targets, starts
