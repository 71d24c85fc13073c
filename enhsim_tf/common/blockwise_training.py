"""Cache-efficient training of wide Dense layers, such as those of the paper's enhancer (section 2.2), by Adam.

Memory bandwidth limits a training step of the enhancer: its widest kernel has 10.24 million weights, or 41 MB. Keras
computes the gradient of the whole kernel, writes it to memory, and reads it again for the update. However, the gradient of a
Dense kernel is a product of two small matrices, the layer's inputs and the gradient of its outputs. Any block of its rows
can therefore be computed when it is needed. This module splits each kernel into blocks of a few megabytes, and performs
three operations for one block after the other:

    the gradient of the layer's inputs     below = upstream @ block^T         with the weights before the update
    the gradient of the block              gradient = inputs[:, rows]^T @ upstream
    Adam's update of the block             `fused_adam.apply_adam`

The block and its gradient are thus still in the processor's cache when the update reads them. The mathematics is the same as
that of `keras.Model.fit` with `keras.optimizers.Adam`. Only the order of summation differs, and therefore the rounding,
because a product with a kernel is computed as the sum of the products with its blocks.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.fused_adam import AdamStep, adam_step, apply_adam

BLOCK_BYTES = 5_200_000
"""Maximum size of a block. A few blocks of this size, with their moments, fit into a processor's cache."""

_ACTIVATIONS = (keras.activations.relu, keras.activations.linear)


class _Weight(NamedTuple):
    """A weight, or a block of a weight, with its moments in Adam."""

    value: tf.Variable
    momentum: tf.Variable
    velocity: tf.Variable


def _weight_of(values: np.ndarray) -> _Weight:
    return _Weight(*(tf.Variable(each) for each in (values, np.zeros_like(values), np.zeros_like(values))))


class _BlockedDense:
    """A Dense layer whose kernel is stored in blocks of rows."""

    def __init__(self, layer: keras.layers.Dense):
        self.layer, self.is_relu = layer, layer.activation is keras.activations.relu
        kernel, bias = (np.asarray(weight) for weight in (layer.kernel, layer.bias))
        number = math.ceil(kernel.nbytes / BLOCK_BYTES)
        self.blocks = [_weight_of(rows) for rows in np.array_split(kernel, number)]
        self.bias, self.num_rows = _weight_of(bias), [block.value.shape[0] for block in self.blocks]

    def parts_of(self, inputs: tf.Tensor) -> list[tf.Tensor]:
        """Splits the inputs into the columns by which the individual blocks are multiplied."""
        return tf.split(inputs, self.num_rows, axis=1)

    def __call__(self, inputs: tf.Tensor) -> tf.Tensor:
        parts = zip(self.parts_of(inputs), self.blocks, strict=True)
        outputs = tf.add_n([tf.matmul(part, block.value) for part, block in parts]) + self.bias.value
        return tf.nn.relu(outputs) if self.is_relu else outputs

    def update(
        self, inputs: tf.Tensor, outputs: tf.Tensor, upstream: tf.Tensor, adam: keras.optimizers.Adam, step: AdamStep, is_first: bool
    ) -> tf.Tensor | None:
        """Updates the weights and returns the gradient of the inputs, or None for the first layer, where it is not needed."""
        if self.is_relu:
            upstream = tf.where(outputs > 0, upstream, 0.0)
        before, belows = [upstream], []
        for part, block in zip(self.parts_of(inputs), self.blocks, strict=True):
            # process the blocks one after the other; otherwise all gradients would be computed first
            with tf.control_dependencies(before):
                gradient = tf.matmul(part, upstream, transpose_a=True)
                belows += [] if is_first else [tf.matmul(upstream, block.value, transpose_b=True)]
            with tf.control_dependencies(belows[-1:]):  # the gradient of the inputs needs the weights before the update
                before = [apply_adam(adam, *block, gradient, step)]
        apply_adam(adam, *self.bias, tf.reduce_sum(upstream, axis=0), step)
        return None if is_first else tf.concat(belows, axis=1)

    def write_back(self) -> None:
        """Copies the trained weights to the Keras layer."""
        self.layer.set_weights([np.concatenate([block.value.numpy() for block in self.blocks]), self.bias.value.numpy()])


def is_wide_dense_stack(network: keras.Model) -> bool:
    """Returns whether a model is a stack of relu or linear Dense layers, at least one with a kernel larger than `BLOCK_BYTES`."""
    if type(network) is not keras.Sequential:
        return False
    return all(map(_is_plain_dense, network.layers)) and any(
        layer.kernel.shape[0] * layer.kernel.shape[1] * 4 > BLOCK_BYTES for layer in network.layers
    )


def _is_plain_dense(layer: keras.layers.Layer) -> bool:
    if type(layer) is not keras.layers.Dense or not layer.trainable or not layer.use_bias or layer.activation not in _ACTIVATIONS:
        return False
    extras = (layer.kernel_regularizer, layer.bias_regularizer, layer.activity_regularizer, layer.kernel_constraint, layer.bias_constraint)
    is_plain = not any(extras) and layer.lora_rank is None and layer.quantization_mode is None
    return is_plain and layer.kernel.dtype == layer.compute_dtype == "float32"


class BlockwiseTraining(keras.Model):
    """A model that is trained instead of a wide stack of Dense layers. After `fit`, `write_back` copies the weights back.

    Args:
        network: A model for which `is_wide_dense_stack` returns True.
    """

    def __init__(self, network: keras.Sequential):
        super().__init__(name=network.name)
        self._stack = _Stack(network.layers)

    def call(self, inputs: tf.Tensor) -> tf.Tensor:
        """Computes the outputs of the network."""
        return self._stack.forward(inputs)[-1]

    def train_step(self, data: tuple[tf.Tensor, tf.Tensor]) -> dict[str, tf.Tensor]:
        """Runs one training step on a batch. Keras calls this method."""
        inputs, targets = data
        activations = self._stack.forward(inputs)
        outputs = activations[-1]
        with tf.GradientTape() as tape:
            tape.watch(outputs)
            loss = self.compute_loss(inputs, targets, outputs)
        self._stack.update(activations, tape.gradient(loss, outputs), self.optimizer)
        for metric in self.metrics:
            metric.update_state(loss, sample_weight=tf.shape(inputs)[0])
        return {metric.name: metric.result() for metric in self.metrics}

    def write_back(self) -> None:
        """Copies the trained weights to the network."""
        for layer in self._stack.layers:
            layer.write_back()


class _Stack:
    """The layers, wrapped in an object that Keras does not inspect, so that their variables are not tracked by the model."""

    def __init__(self, layers: Sequence[keras.layers.Dense]):
        self.layers = [_BlockedDense(layer) for layer in layers]

    def forward(self, inputs: tf.Tensor) -> list[tf.Tensor]:
        """Returns a list of the inputs and the outputs of each layer."""
        activations = [inputs]
        for layer in self.layers:
            activations.append(layer(activations[-1]))
        return activations

    def update(self, activations: list[tf.Tensor], upstream: tf.Tensor, adam: keras.optimizers.Adam) -> None:
        """Updates all weights by one step of Adam, from the last layer to the first."""
        step = adam_step(adam)
        for number in reversed(range(len(self.layers))):
            upstream = self.layers[number].update(*activations[number : number + 2], upstream, adam, step, number == 0)
        adam.iterations.assign_add(1)
