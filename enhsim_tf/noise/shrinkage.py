"""Shrinkage of a trained network's outputs towards constants, as far as held-out data ask for it (after section 2.3).

A network that is trained by maximum likelihood follows chance a little. Each group of its outputs, for example the scales of the
components of a mixture, is therefore replaced by a constant plus its deviation from its mean times a number from 0 to 1, its *trust*.
These few numbers maximise the likelihood of held-out data, and the constants that of the training data. White noise gets trusts near
0, and structure that also shows in held-out data gets trusts near 1. Where constants alone are as good, they are used.

References:
    James and Stein, "Estimation with quadratic loss", 1961.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.keras_tools.backend import tf
from enhsim_tf.noise.block_means import block_slices, margin

_NEGLIGIBLE = 1e-4  # mean held-out loss in nats above the least one up to which constants are as good in any case
_MOST_LEARNT = 0.01  # loss above that of shrunk outputs on the training data up to which this counts: little held-out data can be alike
_ROUNDS = 2  # trusts and constants in turn
_STOP = {"ftol": 1e-10, "gtol": 1e-7}  # of L-BFGS; losses are means over samples, so that a small difference counts
_MAX_STEPS = 40
_MORE_STEPS = 200  # where constants may be all there is: rare large samples, which decide the scale, are the last to be fitted

Data = tuple[tf.Tensor, tf.Tensor]
Loss = Callable[[tf.Tensor, tf.Tensor, tf.Tensor], tf.Tensor]


@dataclasses.dataclass(frozen=True)
class Shrunk:
    """How outputs are shrunk: to `offset + trust * output`.

    Args:
        trust: Trust of each output, shape `(outputs,)`.
        offset: Constant of each output, shape `(outputs,)`.
        weights: The other numbers that the constants were fitted with.
    """

    trust: np.ndarray
    offset: np.ndarray
    weights: np.ndarray


def shrink(
    loss: Loss, learnt: Data, held_out: Data, sizes: Sequence[int], weights: np.ndarray, simplest: np.ndarray | None = None
) -> Shrunk:
    """Finds the trust of each group of outputs, and their constants.

    The result is the first of the following whose held-out loss is not surely above the least: the simplest constants, constants that are
    fitted, and outputs that are shrunk. Differences that chance explains do not count (`block_means`), because trusts are
    fitted to the held-out data and always gain a little. Constants must not lose much on the training data either.

    Args:
        loss: Mean loss, given targets, outputs and `weights`.
        learnt: Outputs of shape `(samples, outputs)` and targets of the training data.
        held_out: The same for held-out data, in the order of time.
        sizes: Numbers of outputs of each group.
        weights: Other numbers that depend on no input and are fitted together with the constants.
        simplest: Constants and weights that would be preferred, or None.

    Returns:
        How the outputs are shrunk. Where constants fitted to the training data raise the loss on held-out data, they keep their values.
    """
    from scipy.optimize import minimize

    spread = np.repeat(np.eye(len(sizes), dtype=np.float32), sizes, axis=1)  # from the trusts of groups to those of outputs
    centre, number = np.mean(learnt[0], axis=0), spread.shape[1]
    trust, constants = np.ones(len(sizes)), np.concatenate([centre, weights])

    @tf.function
    def both(trust: tf.Tensor, constants: tf.Tensor, outputs: tf.Tensor, targets: tf.Tensor) -> tuple[tf.Tensor, tf.Tensor, tf.Tensor]:
        with tf.GradientTape() as tape:
            tape.watch([trust, constants])
            shrunk = constants[None, :number] + (trust[None] @ tf.cast(spread, trust.dtype)) * (outputs - tf.cast(centre, trust.dtype))
            value = loss(targets, shrunk, constants[number:])
        return value, *tape.gradient(value, [trust, constants])

    def evaluate(trust: np.ndarray, constants: np.ndarray, data: Data) -> list[np.ndarray]:
        found = both(*(tf.constant(each, data[0].dtype) for each in (trust, constants)), *data)
        return [np.asarray(each, np.float64) for each in found]

    def of_trust(numbers: np.ndarray, constants: np.ndarray) -> list[np.ndarray]:
        return evaluate(numbers, constants, held_out)[:2]

    def of_constants(numbers: np.ndarray, trust: np.ndarray) -> list[np.ndarray]:
        return evaluate(trust, numbers, learnt)[::2]

    limits, steps = [(0, 1)] * len(trust), _STOP | {"maxiter": _MAX_STEPS}
    for _ in range(_ROUNDS):
        trust = minimize(of_trust, trust, (constants,), "L-BFGS-B", jac=True, bounds=limits, options=_STOP).x
        tried = minimize(of_constants, constants, (trust,), "L-BFGS-B", jac=True, options=steps).x
        if of_trust(trust, tried)[0] <= of_trust(trust, constants)[0]:
            constants = tried
    none = np.zeros_like(trust)
    # one row of outputs serves all samples; in double precision, because what rare samples add to a mean loss is small
    alone = tf.constant(centre[None], tf.float64), tf.cast(learnt[1], tf.float64)

    def without_trust(numbers: np.ndarray) -> list[np.ndarray]:
        return evaluate(none, numbers, alone)[::2]

    fitted = minimize(without_trust, constants, (), "L-BFGS-B", jac=True, options=steps).x
    if without_trust(fitted)[0] <= of_constants(constants, trust)[0] + _MOST_LEARNT:
        fitted = minimize(without_trust, fitted, (), "L-BFGS-B", jac=True, options=_STOP | {"maxiter": _MORE_STEPS}).x
    tried = [(none, fitted), (trust, constants)] if simplest is None else [(none, simplest), (none, fitted), (trust, constants)]
    blocks = [tuple(part[block] for part in held_out) for block in block_slices(len(held_out[0]))]
    held = np.array([[evaluate(*each, block)[0] for block in blocks] for each in tried])
    own = [evaluate(*each, learnt)[0] for each in tried]
    best = held[np.argmin(held.mean(axis=1))]
    for each, on_held_out, on_learnt in zip(tried, held, own, strict=True):
        if _nearly_least(on_held_out - best) and on_learnt <= own[-1] + _MOST_LEARNT:
            trust, constants = each
            break
    each = trust @ spread
    return Shrunk(each, constants[:number] - each * centre, constants[number:])


def _nearly_least(differences: np.ndarray) -> bool:
    """Tells whether losses, given as differences from the least one in each block of time, are not surely above it."""
    return bool(np.mean(differences) <= max(_NEGLIGIBLE, margin(differences)))
