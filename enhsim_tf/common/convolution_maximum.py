"""The first layers of the paper's discriminator (section 2.3, Figure 10) as one fast, differentiable function.

The layers are Conv1D with relu, optionally Dropout, and GlobalMaxPooling1D. The function returns the same numbers as the
Keras layers in about a third of the time. Let `y[t, k] = frame[t] @ kernel[:, k]` for one row, where a frame is the part of
the row under filter k at position t. Four properties reduce the cost:

- Adding the bias and applying relu are monotonic, so they commute with the maximum: `max_t relu(y[t, k] + b[k])` equals
  `relu(max_t y[t, k] + b[k])`. They are thus applied to one number for each filter instead of 121.
- Dropout sets outputs of relu to 0, and relu is never negative. Dropout at rate p is therefore the same as excluding frames
  from the maximum: `relu(max over kept t of y[t, k] + b[k]) / (1 - p)`.
- The gradient of a maximum is nonzero only at the frames that attain it. Let `g = dL/dout` where relu is active and 0
  elsewhere, and let n be the number of frames that attain the maximum. Then `dL/dy[t, k] = g[k] / n[k]` at these frames and
  0 elsewhere. The gradient of the kernel is `sum over rows of g[k] / n[k] * (sum of these frames)`. That sum and n are
  computed in the forward pass, by one product of `[frame, 1]` with the indicator of these frames. The gradient of the rows
  is `dL/dy @ kernel^T`, summed where frames overlap.
- For 200 rows, y takes 48 MB. Ten rows at a time, it fits into the processor's cache.

In a `tf.function`, gradients that are not requested are not computed, because TensorFlow prunes operations without effect.
"""

from enhsim_tf.common.backend import keras, tf

_SUPPORTED = (keras.activations.relu, "valid", (1,), 1, True)  # activation, padding, dilation, groups and use_bias of the Conv1D
_BLOCK_ROWS = 10  # number of rows in a block, whose products take 2.4 MB with 500 filters


def num_layers_computed(layers: list[keras.layers.Layer]) -> int:
    """Returns how many of a model's first layers `convolution_maximum` can replace.

    Args:
        layers: The layers of the model.

    Returns:
        2 for Conv1D and GlobalMaxPooling1D, 3 with Dropout between them, and 0 if the layers are not supported.
    """
    convolution, pooling = keras.layers.Conv1D, keras.layers.GlobalMaxPooling1D
    for form in ([convolution, pooling], [convolution, keras.layers.Dropout, pooling]):
        first, *_, last = found = layers[: len(form)]
        if [type(layer) for layer in found] == form:
            is_supported = (first.activation, first.padding, first.dilation_rate, first.groups, first.use_bias) == _SUPPORTED
            one_channel = first.data_format == last.data_format == "channels_last" and first.kernel.shape[1] == 1
            return len(form) if is_supported and one_channel and first.kernel_size[0] % first.strides[0] == 0 else 0
    return 0


def convolution_maximum(
    rows: tf.Tensor, kernel: tf.Tensor, bias: tf.Tensor, stride: int, rate: float = 0.0, seed: tf.Tensor | None = None
) -> tf.Tensor:
    """Computes `GlobalMaxPooling1D()(Dropout(rate)(Conv1D(filters, width, stride, activation="relu")(rows)))`.

    Args:
        rows: float32 of shape `(rows, samples)`, with a single channel and a static number of rows.
        kernel: float32 of shape `(width, filters)`. The width must be a multiple of the stride.
        bias: float32 of shape `(filters,)`.
        stride: Stride of the convolution in samples.
        rate: Dropout rate, rounded to a multiple of 1/65,536. 0 means no dropout.
        seed: Seed for the dropout, an integer tensor of shape `(2,)`. It is required if the rate is above 0.

    Returns:
        float32 of shape `(rows, filters)`.
    """
    blocks = [rows[first : first + _BLOCK_ROWS] for first in range(0, rows.shape[0], _BLOCK_ROWS)]
    seeds = tf.unstack(tf.random.split(seed, len(blocks))) if rate else [None] * len(blocks)
    highest = [_block(block, kernel, bias, stride, rate, seed) for block, seed in zip(blocks, seeds, strict=True)]
    return tf.concat(highest, axis=0) / (1 - rate)


class ConvolutionMaximum(keras.layers.Layer):
    """Conv1D with relu, optionally Dropout, and GlobalMaxPooling1D as one layer, which holds the weights of the convolution.

    Args:
        convolution: The built Conv1D.
        dropout: The Dropout after it, or None.
    """

    def __init__(self, convolution: keras.layers.Conv1D, dropout: keras.layers.Dropout | None = None):
        super().__init__()
        self.convolution, self.dropout = convolution, dropout

    def compute_output_shape(self, input_shape: tuple[int | None, ...]) -> tuple[int | None, int]:
        """Returns `(rows, filters)`."""
        return input_shape[0], self.convolution.filters

    def call(self, rows: tf.Tensor, training: bool = False) -> tf.Tensor:
        """Applies `convolution_maximum` to rows of shape `(rows, samples, 1)`, whose number is static."""
        kernel, bias = (tf.convert_to_tensor(weight) for weight in (self.convolution.kernel, self.convolution.bias))
        drops = {"rate": self.dropout.rate, "seed": self.dropout.seed_generator.next()} if self.dropout and training else {}
        return convolution_maximum(tf.squeeze(rows, 2), tf.squeeze(kernel, 1), bias, self.convolution.strides[0], **drops)


def with_fast_convolution(network: keras.Sequential) -> keras.Sequential:
    """Returns a network of the same layers and weights, whose first layers are computed as one where that is possible.

    Args:
        network: A network that begins with Conv1D, optionally Dropout, and GlobalMaxPooling1D.
    """
    number = num_layers_computed(network.layers)
    if not number:
        return network
    first, *between = network.layers[: number - 1]
    fast = ConvolutionMaximum(first, *between)
    return keras.Sequential([keras.Input(network.input_shape[1:]), fast, *network.layers[number:]], name=network.name)


def _block(rows: tf.Tensor, kernel: tf.Tensor, bias: tf.Tensor, stride: int, rate: float, seed: tf.Tensor | None) -> tf.Tensor:
    (width, filters), (num_rows, samples) = kernel.shape, rows.shape
    num_frames = (samples - width) // stride + 1
    num_parts = width // stride  # number of parts of a frame, each `stride` samples long
    num_row_parts = num_frames - 1 + num_parts  # number of parts of a row, of the same length

    def frames_of(rows: tf.Tensor) -> tf.Tensor:
        row_parts = tf.reshape(rows[:, : num_row_parts * stride], (num_rows, num_row_parts, stride))
        return tf.concat([row_parts[:, part : part + num_frames] for part in range(num_parts)], axis=2)

    def add_frames(frames: tf.Tensor) -> tf.Tensor:
        parts = tf.split(frames, num_parts, axis=2)
        placed = [tf.pad(part, ((0, 0), (number, num_parts - 1 - number), (0, 0))) for number, part in enumerate(parts)]
        left_over = samples - num_row_parts * stride
        return tf.pad(tf.reshape(tf.add_n(placed), (num_rows, num_row_parts * stride)), ((0, 0), (0, left_over)))

    @tf.custom_gradient
    def forward(rows: tf.Tensor, kernel: tf.Tensor, bias: tf.Tensor) -> tuple:
        frames = frames_of(rows)
        products = tf.reshape(tf.reshape(frames, (-1, width)) @ kernel, (num_rows, num_frames, filters))
        if rate:
            products = tf.where(_kept(products.shape, rate, seed), products, -float("inf"))
        highest = tf.reduce_max(products, axis=1)
        outputs = tf.nn.relu(highest + bias)
        won = tf.equal(products, highest[:, None])
        frames_and_one = tf.concat([frames, tf.ones((num_rows, num_frames, 1))], axis=2)
        of_winners = tf.matmul(frames_and_one, tf.cast(won, tf.float32), transpose_a=True)  # (rows, width + 1, filters)

        def backward(upstream: tf.Tensor) -> tuple:
            fired = tf.where(outputs > 0, upstream, 0.0)
            to_kernel = tf.reduce_sum((fired / of_winners[:, -1])[:, None] * of_winners[:, :-1], axis=0)

            winners = tf.cast(won, tf.float32)
            at_winners = winners * (fired / tf.reduce_sum(winners, axis=1))[:, None]
            to_frames = tf.matmul(tf.reshape(at_winners, (-1, filters)), kernel, transpose_b=True)
            to_rows = add_frames(tf.reshape(to_frames, (num_rows, num_frames, width)))
            return to_rows, to_kernel, tf.reduce_sum(fired, axis=0)

        return outputs, backward

    return forward(rows, kernel, bias)


def _kept(shape: tf.TensorShape, rate: float, seed: tf.Tensor) -> tf.Tensor:
    """Draws a mask that is True with probability 1 - `rate`. Random bits are expensive, so 32 of them give two elements."""
    number = shape.num_elements()
    words = tf.random.stateless_uniform(((number + 1) // 2,), seed, minval=None, maxval=None, dtype=tf.uint32)
    draws = tf.reshape(tf.bitcast(words, tf.uint16), (-1,))[:number]
    return tf.reshape(draws >= tf.constant(round(rate * 2**16), tf.uint16), shape)
