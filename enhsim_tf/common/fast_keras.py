"""What makes training fast: Adam in one operation, Dense layers by blocks, and a convolution with
its maximum as one function.

Each gives the numbers of plain Keras up to rounding, and tests compare them; only the masks of
dropout are drawn otherwise. Memory bandwidth limits a training step of the paper's enhancer
(section 2.2) with its 13.7 million weights, and one of its discriminator (section 2.3), so each
reads and writes less memory.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.common.backend import keras, tf

# -- Adam as one fused operation -----------------------------------------------------------------
#
#     m += (1 - beta_1) * (g - m)      v += (1 - beta_2) * (g^2 - v)
#     w -= learning_rate * sqrt(1 - beta_2^t) / (1 - beta_1^t) * m / (sqrt(v) + epsilon)
#
# In Keras, these are about ten operations, each of which reads and writes arrays of the weights'
# size. TensorFlow's fused operation computes 1 - beta_2 from beta_2 in float32, which for 0.999
# gives 0.001 times 0.99998713. That scales v, for which the learning rate and epsilon are
# corrected.


def adam_step(
    adam: keras.optimizers.Adam, learning_rate: tf.Tensor | None = None
) -> Callable[[tf.Variable, tf.Variable, tf.Variable, tf.Tensor], tf.Operation]:
    """Returns the optimiser's next step, with its own learning rate if none is given: a function
    that updates a variable and its two moments by a gradient. It does not advance the optimiser's
    iteration counter.
    """
    # the scalars are the same for all variables
    rounding = float(np.sqrt((1 - np.float32(adam.beta_2)) / (1 - adam.beta_2)))
    number = tf.cast(adam.iterations + 1, tf.float32)
    rate = adam.learning_rate if learning_rate is None else learning_rate
    rate = tf.cast(rate, tf.float32) * rounding
    beta1_power = tf.pow(adam.beta_1, number)
    beta2_power = tf.pow(adam.beta_2, number)

    def update(
        weight: tf.Variable, momentum: tf.Variable, velocity: tf.Variable, gradient: tf.Tensor
    ) -> tf.Operation:
        return tf.raw_ops.ResourceApplyAdam(
            var=weight.handle,
            m=momentum.handle,
            v=velocity.handle,
            beta1_power=beta1_power,
            beta2_power=beta2_power,
            lr=rate,
            beta1=adam.beta_1,
            beta2=adam.beta_2,
            epsilon=adam.epsilon * rounding,
            grad=gradient,
        )

    return update


def fused_adam(
    learning_rate: float | keras.optimizers.schedules.LearningRateSchedule,
) -> keras.optimizers.Adam:
    """Creates a Keras Adam optimiser that updates each variable by one fused operation, and is in
    all else standard.
    """
    adam = keras.optimizers.Adam(learning_rate)

    def update_step(gradient: tf.Tensor, variable: tf.Variable, learning_rate: tf.Tensor) -> None:
        index = adam._get_variable_index(variable)
        # the fused operation needs the handles of the TensorFlow variables, which Keras wraps
        held = (
            getattr(weights, "_value", weights)
            for weights in (variable, adam._momentums[index], adam._velocities[index])
        )
        adam_step(adam, learning_rate)(*held, gradient)

    adam.update_step = update_step
    return adam


# -- Dense layers by blocks ----------------------------------------------------------------------
#
# The enhancer's widest kernel has 10.24 million weights, or 41 MB. Keras computes the gradient of
# the whole kernel, writes it to memory, and reads it again for the update. However, the gradient of
# a Dense kernel is a product of two small matrices, so that any block of its rows can be computed
# when it is needed. For one block after the other:
#
#     the gradient of the layer's inputs  below = upstream @ block^T, with the weights before
#     the gradient of the block           gradient = inputs[:, rows]^T @ upstream
#     Adam's update of the block          `adam_step`
#
# The block and its gradient are still in the processor's cache when the update reads them. Only the
# order of summation differs.

BLOCK_BYTES = 5_200_000
"""Maximum size of a block. A few blocks of this size, with their moments, fit into a processor's
cache.
"""


class _Weight(NamedTuple):
    """A weight, or a block of a weight, with its moments in Adam."""

    value: tf.Variable
    momentum: tf.Variable
    velocity: tf.Variable


def _weight_of(values: np.ndarray) -> _Weight:
    zeros = np.zeros_like(values)
    return _Weight(tf.Variable(values), tf.Variable(zeros), tf.Variable(zeros))


class _BlockedDense:
    """A Dense layer whose kernel is stored in blocks of rows."""

    def __init__(self, layer: keras.layers.Dense):
        self.layer = layer
        self.is_relu = layer.activation is keras.activations.relu
        kernel, bias = (np.asarray(weight) for weight in (layer.kernel, layer.bias))
        number = math.ceil(kernel.nbytes / BLOCK_BYTES)
        self.blocks = [_weight_of(rows) for rows in np.array_split(kernel, number)]
        self.bias = _weight_of(bias)
        self.num_rows = [block.value.shape[0] for block in self.blocks]

    def parts_of(self, inputs: tf.Tensor) -> list[tf.Tensor]:
        """Splits the inputs into the columns by which the individual blocks are multiplied."""
        return tf.split(inputs, self.num_rows, axis=1)

    def __call__(self, inputs: tf.Tensor) -> tf.Tensor:
        parts = zip(self.parts_of(inputs), self.blocks, strict=True)
        outputs = (
            tf.add_n([tf.matmul(part, block.value) for part, block in parts]) + self.bias.value
        )
        return tf.nn.relu(outputs) if self.is_relu else outputs

    def update(
        self,
        inputs: tf.Tensor,
        outputs: tf.Tensor,
        upstream: tf.Tensor,
        step: Callable[..., tf.Operation],
        is_first: bool,
    ) -> tf.Tensor | None:
        """Updates the weights by a step of Adam, see `adam_step`, and returns the gradient of the
        inputs, or None for the first layer, where it is not needed.
        """
        if self.is_relu:
            upstream = tf.where(outputs > 0, upstream, 0.0)
        before = [upstream]
        belows = []
        for part, block in zip(self.parts_of(inputs), self.blocks, strict=True):
            # process the blocks one after the other; otherwise all gradients would be computed
            # first
            with tf.control_dependencies(before):
                gradient = tf.matmul(part, upstream, transpose_a=True)
                belows += [] if is_first else [tf.matmul(upstream, block.value, transpose_b=True)]
            # the gradient of the inputs needs the weights before the update
            with tf.control_dependencies(belows[-1:]):
                before = [step(*block, gradient)]
        step(*self.bias, tf.reduce_sum(upstream, axis=0))
        return None if is_first else tf.concat(belows, axis=1)


class _Stack:
    """The layers, wrapped in an object that Keras does not inspect, so that their variables are not
    tracked by the model.
    """

    def __init__(self, layers: Sequence[keras.layers.Dense]):
        self.layers = [_BlockedDense(layer) for layer in layers]

    def forward(self, inputs: tf.Tensor) -> list[tf.Tensor]:
        """Returns a list of the inputs and the outputs of each layer."""
        activations = [inputs]
        for layer in self.layers:
            activations.append(layer(activations[-1]))
        return activations


class BlockwiseTraining(keras.Model):
    """A model that is trained instead of a wide stack of Dense layers. After `fit`, `write_back`
    copies the weights back.

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
        """Runs one training step on a batch, from the last layer to the first. Keras calls this
        method.
        """
        inputs, targets = data
        activations = self._stack.forward(inputs)
        outputs = activations[-1]
        with tf.GradientTape() as tape:
            tape.watch(outputs)
            loss = self.compute_loss(inputs, targets, outputs)
        upstream = tape.gradient(loss, outputs)
        step = adam_step(self.optimizer)
        for number, layer in reversed(list(enumerate(self._stack.layers))):
            upstream = layer.update(*activations[number : number + 2], upstream, step, number == 0)
        self.optimizer.iterations.assign_add(1)
        for metric in self.metrics:
            metric.update_state(loss, sample_weight=tf.shape(inputs)[0])
        return {metric.name: metric.result() for metric in self.metrics}

    def write_back(self) -> None:
        """Copies the trained weights to the network."""
        for dense in self._stack.layers:
            dense.layer.set_weights(
                [
                    np.concatenate([block.value.numpy() for block in dense.blocks]),
                    dense.bias.value.numpy(),
                ]
            )


def fit_blockwise(
    network: keras.Sequential,
    learning_rate: float,
    loss: str,
    pairs: keras.utils.PyDataset,
    **options: Any,
) -> dict[str, list[float]]:
    """Trains a wide stack of Dense layers as `compile` with Adam and `fit` of Keras do.

    Args:
        network: A model for which `is_wide_dense_stack` returns True.
        learning_rate: Adam's learning rate.
        loss: Name of the loss.
        pairs: Batches of inputs and targets.
        **options: Arguments of `fit`.

    Returns:
        The history of Keras.
    """
    trained = BlockwiseTraining(network)
    trained.compile(fused_adam(learning_rate), loss, jit_compile=False)
    history = trained.fit(pairs, **options)
    trained.write_back()
    return history.history


def is_wide_dense_stack(network: keras.Model) -> bool:
    """Returns whether a model is a stack of plain relu or linear Dense layers, at least one with a
    kernel larger than `BLOCK_BYTES`.
    """
    activations = (keras.activations.relu, keras.activations.linear)
    are_plain = all(
        type(layer) is keras.layers.Dense and layer.use_bias and layer.activation in activations
        for layer in network.layers
    )
    # losses are those of regularisers
    if not are_plain or network.losses or len(network.trainable_weights) < len(network.weights):
        return False
    return any(math.prod(layer.kernel.shape) * 4 > BLOCK_BYTES for layer in network.layers)


# -- Convolution with its maximum ----------------------------------------------------------------
#
# Let `y[t, k] = frame[t] @ kernel[:, k]` for one row, where a frame is the part of the row under
# filter k at position t.
#
# - Adding the bias and applying relu are monotonic, so they commute with the maximum: `max_t
#   relu(y[t, k] + b[k])` equals `relu(max_t y[t, k] + b[k])`. They are thus applied to one number
#   for each filter instead of 121.
# - Dropout sets outputs of relu to 0, and relu is never negative. Dropout at rate p is therefore
#   the same as excluding frames from the maximum: `relu(max over kept t of y[t, k] + b[k]) / (1 -
#   p)`.
# - The gradient of a maximum is nonzero only at the frames that attain it. Let `g = dL/dout` where
#   relu is active and 0 elsewhere, and let n be the number of frames that attain the maximum. Then
#   `dL/dy[t, k] = g[k] / n[k]` at these frames and 0 elsewhere. The gradient of the kernel is `sum
#   over rows of g[k] / n[k] * (sum of these frames)`. That sum and n are computed in the forward
#   pass, by one product of `[frame, 1]` with the indicator of these frames. The gradient of the
#   rows is `dL/dy @ kernel^T`, summed where frames overlap.
# - For 200 rows, y takes 48 MB. Ten rows at a time, it fits into the processor's cache.
#
# In a `tf.function`, gradients that are not requested are not computed, because TensorFlow prunes
# operations without effect.

_BLOCK_ROWS = 10  # number of rows in a block, whose products take 2.4 MB with 500 filters


def convolution_maximum(
    rows: tf.Tensor,
    kernel: tf.Tensor,
    bias: tf.Tensor,
    stride: int,
    rate: float = 0.0,
    seed: tf.Tensor | None = None,
) -> tf.Tensor:
    """Computes `GlobalMaxPooling1D()(Dropout(rate)(Conv1D(filters, width, stride,
    activation="relu")(rows)))`.

    Args:
        rows: float32 of shape `(rows, samples)`, with a single channel and a static number of rows.
        kernel: float32 of shape `(width, filters)`. The width must be a multiple of the stride.
        bias: float32 of shape `(filters,)`.
        stride: Stride of the convolution in samples.
        rate: Dropout rate, rounded to a multiple of 1/65,536. 0 means no dropout.
        seed: Seed for the dropout, an integer tensor of shape `(2,)`. It is required if the rate is
            above 0.

    Returns:
        float32 of shape `(rows, filters)`.
    """
    blocks = [rows[first : first + _BLOCK_ROWS] for first in range(0, rows.shape[0], _BLOCK_ROWS)]
    seeds = tf.unstack(tf.random.split(seed, len(blocks))) if rate else [None] * len(blocks)
    highest = [
        _block(block, kernel, bias, stride, rate, seed)
        for block, seed in zip(blocks, seeds, strict=True)
    ]
    return tf.concat(highest, axis=0) / (1 - rate)


class ConvolutionMaximum(keras.layers.Layer):
    """Conv1D with relu, optionally Dropout, and GlobalMaxPooling1D as one layer, which holds the
    weights of the convolution.

    Args:
        convolution: The built Conv1D.
        dropout: The Dropout after it, or None.
    """

    def __init__(
        self, convolution: keras.layers.Conv1D, dropout: keras.layers.Dropout | None = None
    ):
        super().__init__()
        self.convolution = convolution
        self.dropout = dropout

    def compute_output_shape(self, input_shape: tuple[int | None, ...]) -> tuple[int | None, int]:
        """Returns `(rows, filters)`."""
        return input_shape[0], self.convolution.filters

    def call(self, rows: tf.Tensor, training: bool = False) -> tf.Tensor:
        """Applies `convolution_maximum` to rows of shape `(rows, samples, 1)`, whose number is
        static.
        """
        kernel, bias = (
            tf.convert_to_tensor(weight)
            for weight in (self.convolution.kernel, self.convolution.bias)
        )
        drops = (
            {"rate": self.dropout.rate, "seed": self.dropout.seed_generator.next()}
            if self.dropout and training
            else {}
        )
        return convolution_maximum(
            tf.squeeze(rows, 2), tf.squeeze(kernel, 1), bias, self.convolution.strides[0], **drops
        )


def with_fast_convolution(discriminator: keras.Sequential) -> keras.Sequential:
    """Returns a network of the same layers and weights, whose first layers are computed as one.

    Args:
        discriminator: A network that begins with a Conv1D of one channel with relu, optionally
            Dropout, and GlobalMaxPooling1D. If the convolution's width is not a multiple of its
            stride, it is returned as it is.
    """
    convolution, *others = discriminator.layers
    if convolution.kernel_size[0] % convolution.strides[0]:
        return discriminator
    dropouts = others[: isinstance(others[0], keras.layers.Dropout)]
    fast = ConvolutionMaximum(convolution, *dropouts)
    rest = others[len(dropouts) + 1 :]
    return keras.Sequential(
        [keras.Input(discriminator.input_shape[1:]), fast, *rest], name=discriminator.name
    )


def _block(
    rows: tf.Tensor,
    kernel: tf.Tensor,
    bias: tf.Tensor,
    stride: int,
    rate: float,
    seed: tf.Tensor | None,
) -> tf.Tensor:
    width, filters = kernel.shape
    num_rows, samples = rows.shape
    num_frames = (samples - width) // stride + 1
    num_parts = width // stride  # number of parts of a frame, each `stride` samples long
    num_row_parts = num_frames - 1 + num_parts  # number of parts of a row, of the same length

    def frames_of(rows: tf.Tensor) -> tf.Tensor:
        row_parts = tf.reshape(rows[:, : num_row_parts * stride], (num_rows, num_row_parts, stride))
        return tf.concat(
            [row_parts[:, part : part + num_frames] for part in range(num_parts)], axis=2
        )

    def add_frames(frames: tf.Tensor) -> tf.Tensor:
        parts = tf.split(frames, num_parts, axis=2)
        placed = [
            tf.pad(part, ((0, 0), (number, num_parts - 1 - number), (0, 0)))
            for number, part in enumerate(parts)
        ]
        left_over = samples - num_row_parts * stride
        return tf.pad(
            tf.reshape(tf.add_n(placed), (num_rows, num_row_parts * stride)),
            ((0, 0), (0, left_over)),
        )

    @tf.custom_gradient
    def forward(rows: tf.Tensor, kernel: tf.Tensor, bias: tf.Tensor) -> tuple:
        frames = frames_of(rows)
        products = tf.reshape(
            tf.reshape(frames, (-1, width)) @ kernel, (num_rows, num_frames, filters)
        )
        if rate:
            products = tf.where(_kept(products.shape, rate, seed), products, -float("inf"))
        highest = tf.reduce_max(products, axis=1)
        outputs = tf.nn.relu(highest + bias)
        won = tf.equal(products, highest[:, None])
        frames_and_one = tf.concat([frames, tf.ones((num_rows, num_frames, 1))], axis=2)
        # (rows, width + 1, filters)
        of_winners = tf.matmul(frames_and_one, tf.cast(won, tf.float32), transpose_a=True)

        def backward(upstream: tf.Tensor) -> tuple:
            fired = tf.where(outputs > 0, upstream, 0.0)
            to_kernel = tf.reduce_sum(
                (fired / of_winners[:, -1])[:, None] * of_winners[:, :-1], axis=0
            )

            winners = tf.cast(won, tf.float32)
            at_winners = winners * (fired / tf.reduce_sum(winners, axis=1))[:, None]
            to_frames = tf.matmul(tf.reshape(at_winners, (-1, filters)), kernel, transpose_b=True)
            to_rows = add_frames(tf.reshape(to_frames, (num_rows, num_frames, width)))
            return to_rows, to_kernel, tf.reduce_sum(fired, axis=0)

        return outputs, backward

    return forward(rows, kernel, bias)


def _kept(shape: tf.TensorShape, rate: float, seed: tf.Tensor) -> tf.Tensor:
    """Draws a mask that is True with probability 1 - `rate`. Random bits are expensive, so 32 of
    them give two elements.
    """
    number = shape.num_elements()
    words = tf.random.stateless_uniform(
        ((number + 1) // 2,), seed, minval=None, maxval=None, dtype=tf.uint32
    )
    draws = tf.reshape(tf.bitcast(words, tf.uint16), (-1,))[:number]
    return tf.reshape(draws >= tf.constant(round(rate * 2**16), tf.uint16), shape)
