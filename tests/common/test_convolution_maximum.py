"""The fast first two layers of the discriminator against Keras' own, values and gradients."""

import keras
import numpy as np
import pytest
import tensorflow as tf

from enhsim_tf.common.convolution_maximum import convolution_maximum

SHAPES = [  # rows, samples, width, stride, filters
    (3, 60, 20, 4, 7),
    (5, 63, 20, 4, 3),  # three samples that no frame reaches
    (4, 20, 20, 4, 3),  # a single frame
    (2, 50, 12, 3, 4),
    (2, 48, 8, 8, 5),  # frames side by side
    (3, 31, 6, 1, 2),
    (23, 60, 20, 4, 7),  # more rows than are computed at a time
    (2, 500, 20, 4, 500),  # the paper's
]


def by_keras(rows, kernel, bias, stride):
    width, filters = kernel.shape
    convolution = keras.layers.Conv1D(filters, width, strides=stride, activation="relu")
    maximum = keras.layers.GlobalMaxPooling1D()
    convolution.build((None, rows.shape[1], 1))
    convolution.set_weights([kernel[:, None], bias])
    rows, kernel, bias = tf.constant(rows), convolution.kernel.value, convolution.bias.value
    return rows, kernel, bias, lambda: maximum(convolution(rows[:, :, None]))


def by_fast_path(rows, kernel, bias, stride):
    rows, kernel, bias = tf.constant(rows), tf.constant(kernel), tf.constant(bias)
    return rows, kernel, bias, lambda: convolution_maximum(rows, kernel, bias, stride)


def values_and_gradients(made, upstream):
    *inputs, compute = made
    with tf.GradientTape() as tape:
        tape.watch(inputs)
        outputs = compute()
    to_rows, to_kernel, to_bias = tape.gradient(outputs, inputs, output_gradients=tf.constant(upstream))
    return [np.asarray(array) for array in (outputs, to_rows, tf.reshape(to_kernel, inputs[1].shape), to_bias)]


def compare(rows, kernel, bias, stride, seed=0, atol=2e-5):
    rows, kernel, bias = (np.asarray(array, np.float32) for array in (rows, kernel, bias))
    upstream = np.random.default_rng(seed).integers(-4, 5, (len(rows), len(bias))).astype(np.float32)
    expected = values_and_gradients(by_keras(rows, kernel, bias, stride), upstream)
    computed = values_and_gradients(by_fast_path(rows, kernel, bias, stride), upstream)
    for name, mine, theirs in zip(("outputs", "to rows", "to kernel", "to bias"), computed, expected, strict=True):
        mine = mine.reshape(theirs.shape)
        np.testing.assert_allclose(mine, theirs, rtol=1e-4, atol=atol, err_msg=name)
    return [array.copy() for array in computed]


def test_by_hand():
    # frames [1 2], [0 3], [-1 -9] times the kernel [1 1]: 3, 3, -10, so two winners share the gradient
    rows, kernel, bias = np.array([[1, 2, 0, 3, -1, -9]]), np.array([[1], [1]]), np.array([0.5])
    *_, compute = by_fast_path(*(np.asarray(array, np.float32) for array in (rows, kernel, bias)), 2)
    assert compute().numpy().tolist() == [[3.5]]
    made = by_fast_path(*(np.asarray(array, np.float32) for array in (rows, kernel, bias)), 2)
    _, to_rows, to_kernel, to_bias = values_and_gradients(made, np.float32([[2]]))
    assert to_rows.tolist() == [[1, 1, 1, 1, 0, 0]]
    assert to_kernel.tolist() == [[1 * 1 + 1 * 0], [1 * 2 + 1 * 3]] and to_bias.tolist() == [2]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_random_rows(shape, seed=0):
    num_rows, samples, width, stride, filters = shape
    rng = np.random.default_rng(seed)
    rows, kernel, bias = rng.normal(size=(num_rows, samples)), rng.normal(size=(width, filters)), rng.normal(size=filters)
    outputs, *_ = compare(rows, kernel, bias, stride, seed)
    assert outputs.any()


@pytest.mark.parametrize("shape", SHAPES[:-1], ids=str)
def test_exact_ties_of_small_whole_numbers(shape, seed=0):
    # rows and kernels of -1, 0 and 1: many frames give the same maximum, to the bit in any order of summation
    num_rows, samples, width, stride, filters = shape
    rng = np.random.default_rng(seed)
    rows, kernel = rng.integers(-1, 2, (num_rows, samples)), rng.integers(-1, 2, (width, filters))
    compare(rows, kernel, rng.integers(-3, 4, filters), stride, seed, atol=1e-5)


def test_nothing_fires():
    rng = np.random.default_rng(0)
    for array in compare(rng.normal(size=(3, 60)), rng.normal(size=(20, 4)), np.full(4, -100), 4):
        assert not array.any()


def test_maximum_of_exactly_zero_passes_no_gradient():
    _, to_rows, to_kernel, to_bias = compare(np.zeros((2, 40)), np.ones((20, 3)), np.zeros(3), 4)
    assert not to_rows.any() and not to_kernel.any() and not to_bias.any()
