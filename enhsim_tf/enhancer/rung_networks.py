"""Keras networks that compute linear maps and sums of maps, so that every enhancer of the ladder is saved in the same way.

A network is saved as the arrays of its weights, and built again from their shapes: a stack of Dense layers, and possibly a linear
layer beside it.
"""

import itertools
from collections.abc import Mapping

import numpy as np

from enhsim_tf.common.backend import keras
from enhsim_tf.common.errors import InputError

_BESIDE = "ridge"  # name of the layer that maps the inputs to the outputs beside the stack
_MOST_LAYERS = 100


def linear_network(kernel: np.ndarray, bias: np.ndarray, name: str) -> keras.Sequential:
    """Builds a network of one linear layer.

    Args:
        kernel: Kernel of shape `(inputs, outputs)`.
        bias: Bias of shape `(outputs,)`.
        name: Name of the network.
    """
    layer = keras.layers.Dense(len(bias), kernel_initializer="zeros", name=f"{name}_linear")
    network = keras.Sequential([keras.Input((len(kernel),)), layer], name=name)
    layer.set_weights([np.asarray(kernel, np.float32), np.asarray(bias, np.float32)])
    return network


def sum_of_networks(linear: keras.Sequential, rest: keras.Sequential, unit: float) -> keras.Model:
    """Builds the network `linear(x) + unit * rest(x)`.

    Args:
        linear: A network of one linear layer.
        rest: A stack of Dense layers whose last layer is linear.
        unit: Factor of `rest`, which is multiplied into the weights of its last layer.
    """
    inputs = keras.Input(linear.input_shape[1:])
    first, *_ = linear.layers
    straight = keras.layers.Dense(first.units, kernel_initializer="zeros", name=_BESIDE)
    outputs = straight(inputs)
    learnt, layers = inputs, []
    for layer in rest.layers:
        copy = keras.layers.Dense(layer.units, layer.activation, kernel_initializer="zeros", name=f"rest_{layer.name}")
        learnt = copy(learnt)
        layers.append(copy)
    network = keras.Model(inputs, outputs + learnt, name="ridge_and_network")
    straight.set_weights(first.get_weights())
    for copy, layer in zip(layers, rest.layers, strict=True):
        factor = np.float32(unit if layer is rest.layers[-1] else 1.0)
        copy.set_weights([factor * weight for weight in layer.get_weights()])
    return network


def weights_of(network: keras.Model) -> dict[str, np.ndarray]:
    """Returns the weights of an enhancer by name: `kernel_0`, `bias_0` and so on, and `kernel_ridge` of the layer beside the stack.

    Args:
        network: The enhancer.

    Raises:
        InputError: If the network is not one that `network_from` can build again.
    """
    layers = [layer for layer in network.layers if not isinstance(layer, keras.layers.InputLayer)]
    stack = [layer for layer in layers if layer.name != _BESIDE]
    kinds = [(type(layer) is keras.layers.Dense and layer.use_bias and layer.activation.__name__) for layer in stack]
    if kinds != ["relu"] * (len(stack) - 1) + ["linear"]:
        raise InputError(
            f"Expected an enhancer of Dense layers with relu, the last one linear. Received: {network.name!r} with other layers, "
            "which cannot be saved. Fit one with `fit`."
        )
    named = {layer.name if layer.name == _BESIDE else str(stack.index(layer)): layer.get_weights() for layer in layers}
    return {f"{what}_{name}": each for name, weights in named.items() for what, each in zip(("kernel", "bias"), weights, strict=True)}


def network_from(weights: Mapping[str, np.ndarray]) -> keras.Model:
    """Builds an enhancer from the weights that `weights_of` returned.

    Args:
        weights: The weights by name.

    Raises:
        ValueError: If they are not the weights of an enhancer; the message gives the reason.
    """
    beside = f"kernel_{_BESIDE}" in weights
    names = [*map(str, range(len(weights) // 2 - beside)), *([_BESIDE] if beside else [])]
    layers = [(weights[f"kernel_{name}"], weights[f"bias_{name}"]) for name in names]
    stack = layers[:-1] if beside else layers
    if not 1 <= len(stack) <= _MOST_LAYERS or len(weights) != 2 * len(layers):
        raise ValueError("an enhancer without layers, or with too many")
    for kernel, bias in layers:
        if kernel.ndim != 2 or not kernel.size or bias.shape != kernel.shape[1:] or {kernel.dtype, bias.dtype} != {np.dtype(np.float32)}:
            raise ValueError("a layer of the enhancer with weights of another shape or type")
        if not (np.isfinite(kernel).all() and np.isfinite(bias).all()):
            raise ValueError("an enhancer whose weights are not finite")
    if any(before.shape[1] != after.shape[0] for (before, _), (after, _) in itertools.pairwise(stack)):
        raise ValueError("layers of the enhancer that do not fit together")
    if beside and layers[-1][0].shape != (stack[0][0].shape[0], stack[-1][0].shape[1]):
        raise ValueError("an enhancer whose two parts do not fit together")
    network = keras.Sequential([keras.Input((len(stack[0][0]),))], name="enhancer")
    for number, (_, bias) in enumerate(stack):
        activation = None if number == len(stack) - 1 else "relu"
        network.add(keras.layers.Dense(len(bias), activation, kernel_initializer="zeros", name=f"dense_{number}"))
    network.set_weights([each for layer in stack for each in layer])
    return sum_of_networks(linear_network(*layers[-1], "ridge"), network, 1.0) if beside else network
