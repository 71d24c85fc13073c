"""The discriminator's first layers, Conv1D + relu (+ Dropout) + the global maximum, as one differentiable function.

The same numbers as the Keras layers in about a third of the time. For a row x, filter k and frame t let
`y[t, k] = frame[t] @ kernel[:, k]`; four facts make it cheap:

- relu and the bias grow with their argument, so they commute with the maximum: `max_t relu(y[t, k] + b[k])` is
  `relu(max_t y[t, k] + b[k])`. They then touch one number a filter instead of 121.
- a dropped product is 0 and relu is never below 0, so dropping at a rate p means leaving frames out of the maximum:
  `relu(max over kept t of y[t, k] + b[k]) / (1 - p)`.
- the gradient of a maximum reaches the winning frames alone: with `g = dL/dout` where the filter fires, else 0, and n
  winners, `dL/dy[t, k] = g[k] / n[k]` at the winners, else 0. The kernel's gradient is therefore `sum over rows of
  g[k] / n[k] * (sum of the winning frames)`; that last sum, and n, come from one product of `[frame, 1]` with the
  winners, which needs no gradient. The rows get `dL/dy @ kernel^T`, added up where frames overlap.
- y of 200 rows takes 48 MB. Ten rows at a time it never leaves the processor's cache.

Inside a `tf.function` the gradient that nobody asks for is not computed: nothing hangs on its products.
"""

from enhsim_tf.keras_tools.backend import keras, tf

_USUAL = (keras.activations.relu, "valid", (1,), 1, True)  # activation, padding, dilation, groups, bias of the Conv1D
_ROWS = 10  # of a block, whose products take 2.4 MB at 500 filters


def num_layers_computed(layers: list[keras.layers.Layer]) -> int:
    """How many of a model's first layers `convolution_maximum` computes: 2, 3 with Dropout, or 0 if they have another form."""
    convolution, pooling = keras.layers.Conv1D, keras.layers.GlobalMaxPooling1D
    for form in ([convolution, pooling], [convolution, keras.layers.Dropout, pooling]):
        first, *_, last = found = layers[: len(form)]
        if [type(layer) for layer in found] == form:
            usual = (first.activation, first.padding, first.dilation_rate, first.groups, first.use_bias) == _USUAL
            one_channel = first.data_format == last.data_format == "channels_last" and first.kernel.shape[1] == 1
            return len(form) if usual and one_channel and first.kernel_size[0] % first.strides[0] == 0 else 0
    return 0


def convolution_maximum(
    rows: tf.Tensor, kernel: tf.Tensor, bias: tf.Tensor, stride: int, rate: float = 0.0, seed: tf.Tensor | None = None
) -> tf.Tensor:
    """Computes `GlobalMaxPooling1D()(Dropout(rate)(Conv1D(filters, width, stride, activation="relu")(rows)))`.

    Args:
        rows: float32 of shape `(rows, samples)`, the one channel; the number of rows is known.
        kernel: float32 of shape `(width, filters)`; the width is a multiple of the stride.
        bias: float32 of shape `(filters,)`.
        stride: Samples from one frame to the next.
        rate: Share of the products that are dropped, to the nearest 1/65,536; 0 for no dropout.
        seed: Two integers that the dropped products are drawn from; needed for a rate above 0.

    Returns:
        float32 of shape `(rows, filters)`.
    """
    blocks = [rows[first : first + _ROWS] for first in range(0, rows.shape[0], _ROWS)]
    seeds = tf.unstack(tf.random.split(seed, len(blocks))) if rate else [None] * len(blocks)
    highest = [_block(block, kernel, bias, stride, rate, seed) for block, seed in zip(blocks, seeds, strict=True)]
    return tf.concat(highest, axis=0) / (1 - rate)


def _block(rows: tf.Tensor, kernel: tf.Tensor, bias: tf.Tensor, stride: int, rate: float, seed: tf.Tensor | None) -> tf.Tensor:
    (width, filters), (num_rows, samples) = kernel.shape, rows.shape
    num_frames = (samples - width) // stride + 1
    num_parts = width // stride  # of a frame, each `stride` samples long
    num_stretches = num_frames - 1 + num_parts  # of a row, as long as a part

    def frames_of(rows: tf.Tensor) -> tf.Tensor:
        stretches = tf.reshape(rows[:, : num_stretches * stride], (num_rows, num_stretches, stride))
        return tf.concat([stretches[:, part : part + num_frames] for part in range(num_parts)], axis=2)

    def add_frames(frames: tf.Tensor) -> tf.Tensor:
        parts = tf.split(frames, num_parts, axis=2)
        placed = [tf.pad(part, ((0, 0), (number, num_parts - 1 - number), (0, 0))) for number, part in enumerate(parts)]
        left_over = samples - num_stretches * stride
        return tf.pad(tf.reshape(tf.add_n(placed), (num_rows, num_stretches * stride)), ((0, 0), (0, left_over)))

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
    """True at a share 1 - `rate` of the places; two draws come out of each 32 random bits, which are dear."""
    number = shape.num_elements()
    words = tf.random.stateless_uniform(((number + 1) // 2,), seed, minval=None, maxval=None, dtype=tf.uint32)
    draws = tf.reshape(tf.bitcast(words, tf.uint16), (-1,))[:number]
    return tf.reshape(draws >= tf.constant(round(rate * 2**16), tf.uint16), shape)
