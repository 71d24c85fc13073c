"""Training of a stack of wide Dense layers by Adam, a block of rows of each kernel at a time.

A training step of the enhancer is bound by memory: its widest kernel has 10.24 million weights, 41 MB. Keras computes the
kernel's whole gradient, writes it to memory, and reads it again for the update. But the gradient of a Dense kernel is a
product of two small matrices, the layer's inputs and the gradient of its outputs, so that any rows of it can be computed
when they are needed. Here a kernel is held in blocks of some megabytes, and for each block in turn

    the gradient of the layer's inputs     below = upstream @ block^T         with the weights before the update
    the gradient of the block              gradient = inputs[:, rows]^T @ upstream
    Adam's update of the block             `fused_adam.apply_adam`

follow each other, so that a block and its gradient are still in the processor's cache when the update reads them. The
mathematics is that of `keras.Model.fit` with `keras.optimizers.Adam`; only the order of the sums differs, and with it their
rounding: a product with a kernel is the sum of the products with its blocks.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.keras_tools.backend import keras, tf
from enhsim_tf.keras_tools.fused_adam import apply_adam

BLOCK_BYTES = 5_200_000
"""Size of a block: a few of them and their moments fit into a processor's cache, and the operations on one take a millisecond."""

_ACTIVATIONS = (keras.activations.relu, keras.activations.linear)


class _Weight(NamedTuple):
    """A weight, or a block of one, with the moments of Adam."""

    value: tf.Variable
    momentum: tf.Variable
    velocity: tf.Variable


def _weight_of(values: np.ndarray) -> _Weight:
    return _Weight(*(tf.Variable(each) for each in (values, np.zeros_like(values), np.zeros_like(values))))


class _BlockedDense:
    """A Dense layer whose kernel is held in blocks of rows."""

    def __init__(self, layer: keras.layers.Dense):
        self.layer, self.is_relu = layer, layer.activation is keras.activations.relu
        kernel, bias = (np.asarray(weight) for weight in (layer.kernel, layer.bias))
        number = math.ceil(kernel.nbytes / BLOCK_BYTES)
        self.blocks = [_weight_of(rows) for rows in np.array_split(kernel, number)]
        self.bias, self.num_rows = _weight_of(bias), [block.value.shape[0] for block in self.blocks]

    def parts_of(self, inputs: tf.Tensor) -> list[tf.Tensor]:
        """The columns of the inputs that each block is multiplied with."""
        return tf.split(inputs, self.num_rows, axis=1)

    def __call__(self, inputs: tf.Tensor) -> tf.Tensor:
        parts = zip(self.parts_of(inputs), self.blocks, strict=True)
        outputs = tf.add_n([tf.matmul(part, block.value) for part, block in parts]) + self.bias.value
        return tf.nn.relu(outputs) if self.is_relu else outputs

    def update(
        self, inputs: tf.Tensor, outputs: tf.Tensor, upstream: tf.Tensor, adam: keras.optimizers.Adam, is_first: bool
    ) -> tf.Tensor | None:
        """Moves the weights, and returns the gradient of the inputs; the first layer's is not needed."""
        if self.is_relu:
            upstream = tf.where(outputs > 0, upstream, 0.0)
        before, belows = [upstream], []
        for part, block in zip(self.parts_of(inputs), self.blocks, strict=True):
            with tf.control_dependencies(before):  # one block after the other, else all gradients are computed first
                gradient = tf.matmul(part, upstream, transpose_a=True)
                belows += [] if is_first else [tf.matmul(upstream, block.value, transpose_b=True)]
            with tf.control_dependencies(belows[-1:]):  # from the weights as they were
                before = [apply_adam(adam, *block, gradient)]
        apply_adam(adam, *self.bias, tf.reduce_sum(upstream, axis=0))
        return None if is_first else tf.concat(belows, axis=1)

    def write_back(self) -> None:
        """Gives the Keras layer the trained weights."""
        self.layer.set_weights([np.concatenate([block.value.numpy() for block in self.blocks]), self.bias.value.numpy()])


def is_wide_dense_stack(network: keras.Model) -> bool:
    """Whether a model is a stack of Dense layers, relu or linear, with a kernel that is larger than a block."""
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
    """What `fit` is called on in place of a wide stack of Dense layers; `write_back` gives that its trained weights.

    Args:
        network: A model for which `is_wide_dense_stack` holds.
    """

    def __init__(self, network: keras.Sequential):
        super().__init__(name=network.name)
        self._stack = _Stack(network.layers)

    def call(self, inputs: tf.Tensor) -> tf.Tensor:
        """What the network computes."""
        return self._stack.forward(inputs)[-1]

    def train_step(self, data: tuple[tf.Tensor, tf.Tensor]) -> dict[str, tf.Tensor]:
        """A step of training on a batch; Keras calls it."""
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
        """Gives the network the trained weights."""
        for layer in self._stack.layers:
            layer.write_back()


class _Stack:
    """The layers, in an object that Keras does not look into: their variables are none of the model's."""

    def __init__(self, layers: Sequence[keras.layers.Dense]):
        self.layers = [_BlockedDense(layer) for layer in layers]

    def forward(self, inputs: tf.Tensor) -> list[tf.Tensor]:
        """The inputs, and the outputs of each layer."""
        activations = [inputs]
        for layer in self.layers:
            activations.append(layer(activations[-1]))
        return activations

    def update(self, activations: list[tf.Tensor], upstream: tf.Tensor, adam: keras.optimizers.Adam) -> None:
        """Moves all weights by one step of Adam, from the last layer to the first."""
        for number in reversed(range(len(self.layers))):
            upstream = self.layers[number].update(*activations[number : number + 2], upstream, adam, number == 0)
        adam.iterations.assign_add(1)
