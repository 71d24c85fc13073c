"""What is fast against plain Keras: the same values, gradients, losses and weights up to rounding,
for every form of layer and batch.
"""

import keras
import numpy as np
import pytest
import tensorflow as tf

from enhsim_tf.common import fast_keras
from enhsim_tf.common.fast_keras import (
    convolution_maximum,
    fit_blockwise,
    fused_adam,
    is_wide_dense_stack,
    with_fast_convolution,
)
from enhsim_tf.paper import noise as of_paper
from enhsim_tf.paper.enhancer import Pairs
from studies.common.training import dense_stack
from tests.paper.conftest import tiny_settings

RNG = np.random.default_rng


def test_fused_adam_moves_the_weights_as_adam_does():
    start, rng = np.linspace(-1, 1, 50).astype(np.float32), RNG(1)
    # from far below epsilon upwards
    gradients = rng.normal(0, 10.0 ** rng.uniform(-6, 2, 50), (200, 50)).astype(np.float32)
    moved = []
    for optimizer in (fused_adam(0.01), keras.optimizers.Adam(0.01)):
        weight = keras.Variable(start)
        optimizer.build([weight])
        for gradient in gradients:
            optimizer.apply([tf.constant(gradient)], [weight])
        moved.append(weight.numpy() - start)
    np.testing.assert_allclose(moved[0], moved[1], rtol=1e-4, atol=2e-6)
    assert np.abs(moved[0]).max() > 0.1


# -- Dense layers by blocks ----------------------------------------------------------------------

WINDOW, UNITS = 12, 20
TARGET = RNG(0).normal(size=(80, WINDOW)).astype(np.float32)
SOURCE = TARGET[:, ::-1].copy()


def small_enhancer():
    return dense_stack(WINDOW, (WINDOW, UNITS, UNITS, WINDOW), seed=4, name="enhancer")


def pairs(batch_size):
    return Pairs(SOURCE, TARGET, batch_size, RNG(3))


def assert_alike(arrays, others, atol=0.0):
    for array, other in zip(arrays, others, strict=True):
        np.testing.assert_allclose(array, other, rtol=0, atol=atol)


def trained(network, rate, epochs, batch_size):
    """Trains by blocks if a kernel is wide, otherwise by Keras; returns the losses of the epochs."""
    options = {"epochs": epochs, "verbose": 0, "shuffle": False}
    if is_wide_dense_stack(network):
        history = fit_blockwise(network, rate, "mean_squared_error", pairs(batch_size), **options)
        return history["loss"]
    network.compile(fused_adam(rate), loss="mean_squared_error", jit_compile=False)
    return network.fit(pairs(batch_size), **options).history["loss"]


# of a block; none divides the 20 rows of the widest kernel, and 400 are no block
@pytest.mark.parametrize(
    ("rows", "batch_size", "rate"),
    [
        (3, 20, lambda: keras.optimizers.schedules.CosineDecay(0.003, 20)),
        (13, 33, lambda: 0.001),
        (400, 33, lambda: 0.001),
    ],
)
def test_it_trains_as_keras_adam_does(monkeypatch, rows, batch_size, rate):
    monkeypatch.setattr(fast_keras, "BLOCK_BYTES", 4 * UNITS * rows)
    network, plain = small_enhancer(), small_enhancer()
    assert is_wide_dense_stack(network) == (rows < UNITS)
    found = trained(network, rate(), 3, batch_size)
    plain.compile(keras.optimizers.Adam(rate()), loss="mean_squared_error")
    losses = plain.fit(pairs(batch_size), epochs=3, verbose=0, shuffle=False).history["loss"]
    np.testing.assert_allclose(found, losses, rtol=3e-6)
    assert_alike(network.get_weights(), plain.get_weights(), atol=5e-6)
    assert np.abs(network.get_weights()[0] - small_enhancer().get_weights()[0]).max() > 1e-3


def test_the_same_seed_gives_the_same_weights(monkeypatch):
    monkeypatch.setattr(fast_keras, "BLOCK_BYTES", 4 * UNITS * 3)
    network, again = small_enhancer(), small_enhancer()
    for each in (network, again):
        trained(each, 0.001, 1, 20)
    assert_alike(network.get_weights(), again.get_weights())


def wide_stack(*others, **changed):
    """A Dense layer that is wide and plain, but for what is changed, and other layers."""
    wide = {"units": 1_200, "kernel_initializer": "zeros"}
    return keras.Sequential([keras.Input((1_200,)), keras.layers.Dense(**wide | changed), *others])


@pytest.mark.parametrize(
    "changed",
    [
        {"units": 4},
        {"activation": "tanh"},
        {"use_bias": False},
        {"kernel_regularizer": "l2"},
        {"trainable": False},
    ],
    ids=str,
)
def test_only_wide_and_plain_stacks_are_cut(changed):
    assert is_wide_dense_stack(wide_stack(activation="relu"))
    assert not is_wide_dense_stack(wide_stack(**changed))
    assert not is_wide_dense_stack(wide_stack(keras.layers.Dropout(0.1, seed=0)))


# -- Convolution with its maximum ----------------------------------------------------------------

SHAPES = [  # rows, samples, width, stride, filters
    (5, 63, 20, 4, 3),  # three samples that no frame reaches
    (4, 20, 20, 4, 3),  # a single frame
    (2, 50, 12, 3, 4),
    (2, 48, 8, 8, 5),  # frames side by side
    (3, 31, 6, 1, 2),
    (23, 60, 20, 4, 7),  # more rows than are computed at a time
    (2, 500, 20, 4, 500),  # the paper's
]


def of_keras(stride, kept=None, rate=0.0):
    """Conv1D, Dropout with a given mask, and GlobalMaxPooling1D."""

    def compute(rows, kernel, bias):
        products = tf.nn.conv1d(rows[:, :, None], kernel[:, None], stride, "VALID") + bias
        products = tf.nn.relu(products)
        if kept is not None:
            products = tf.where(kept, products / (1 - rate), 0.0)
        return tf.reduce_max(products, axis=1)

    return compute


def values_and_gradients(compute, inputs, upstream):
    inputs = [tf.constant(each, tf.float32) for each in inputs]

    @tf.function
    def run():
        with tf.GradientTape() as tape:
            tape.watch(inputs)
            outputs = compute(*inputs)
        return outputs, *tape.gradient(outputs, inputs, tf.constant(upstream, tf.float32))

    return [np.asarray(array) for array in run()]


def compare(inputs, fast, plain, tolerance=2e-5):
    """Values and gradients of both, which must be equal."""
    upstream = RNG(0).integers(-4, 5, (len(inputs[0]), len(inputs[2])))
    found = [values_and_gradients(compute, inputs, upstream) for compute in (fast, plain)]
    for mine, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-4, atol=tolerance)
    return found[0]


def fast_of(stride, rate=0.0, seed=None):
    return lambda rows, kernel, bias: convolution_maximum(rows, kernel, bias, stride, rate, seed)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("has_ties", [False, True])
def test_values_and_gradients_are_those_of_keras(shape, has_ties):
    num_rows, samples, width, stride, filters = shape

    def draw(*size):
        rng = RNG(len(size))
        # rows and kernels of -1, 0 and 1: many frames give the same maximum, to the bit in any
        # order of summation
        return rng.integers(-1, 2, size) if has_ties else rng.normal(size=size)

    inputs = draw(num_rows, samples), draw(width, filters), draw(filters)
    outputs, *_ = compare(inputs, fast_of(stride), of_keras(stride))
    assert outputs.any()


@pytest.mark.parametrize(
    "inputs",
    [
        (np.ones((3, 60)), np.ones((20, 4)), np.full(4, -100)),
        (np.zeros((2, 40)), np.ones((20, 3)), np.zeros(3)),
    ],
)
def test_what_does_not_fire_passes_no_gradient(inputs):
    assert not any(array.any() for array in compare(inputs, fast_of(4), of_keras(4)))


@pytest.mark.parametrize("rate", [0.3, 0.95])  # at 0.95 some filters lose every frame
def test_gradients_with_dropped_products(rate):
    rng, seed = RNG(0), tf.constant([3, 4])
    kept = [
        fast_keras._kept(tf.TensorShape((number, 11, 14)), rate, each)
        for number, each in zip((10, 10, 3), tf.unstack(tf.random.split(seed, 3)), strict=True)
    ]
    kept = tf.concat(kept, axis=0)
    assert np.mean(kept) == pytest.approx(1 - rate, abs=0.05)
    inputs = [rng.normal(0, 0.3, size) for size in ((23, 63), (20, 14), 14)]
    compare(inputs, fast_of(4, rate, seed), of_keras(4, kept, rate), 2e-5 / (1 - rate))


SMALL = {"window": 63, "filters": 14, "narrow_units": 5}


def test_training_with_dropout_draws_anew_in_each_step_and_repeats():
    rows, trained = tf.constant(RNG(0).normal(0, 0.1, (16, 63, 1)), tf.float32), []
    for _ in range(2):
        settings = tiny_settings(**SMALL, dropout=0.3, rows=16, fast=True)
        networks = of_paper.build_generator(settings), of_paper.build_discriminator(settings)
        gan = of_paper.connect(*networks, settings)
        convolution, *_, narrow, _ = gan.discriminator.layers
        drops = [layer.seed_generator.state for layer in (convolution.dropout, narrow)]
        before = [each.numpy().copy() for each in drops]
        gan.train_discriminator(rows, of_paper.labels(16, of_paper.REAL))
        assert all((old != new.numpy()).any() for old, new in zip(before, drops, strict=True))
        trained.append([weight.numpy() for weight in gan.discriminator_weights])
    assert_alike(*trained)


@pytest.mark.parametrize(
    ("changed", "kinds"),
    [({"dropout": 0}, 3), ({"dropout": 0.3}, 4), ({"dropout": 0.3, "stride": 3}, 6)],
)
def test_a_width_that_is_no_multiple_of_the_stride_is_left_to_keras(changed, kinds):
    model = of_paper.build_discriminator(tiny_settings(**SMALL, **changed))
    fast, rows = with_fast_convolution(model), RNG(0).normal(size=(4, 63, 1)).astype(np.float32)
    assert len(fast.layers) == kinds and (fast is model) == (kinds == 6)
    np.testing.assert_allclose(fast(rows), model(rows), rtol=1e-5)
