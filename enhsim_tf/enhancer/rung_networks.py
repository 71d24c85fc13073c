"""Keras networks that compute linear maps and sums of maps, so that every enhancer of the ladder is saved in the same way."""

import numpy as np

from enhsim_tf.keras_tools.backend import keras


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
    straight = keras.layers.Dense(first.units, kernel_initializer="zeros", name="ridge")
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
