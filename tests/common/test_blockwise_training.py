"""Blockwise training against plain Keras: the same losses and weights up to rounding, for every form of stack, block and batch."""

import keras
import numpy as np
import pytest

from enhsim_tf.common import blockwise_training
from enhsim_tf.common.blockwise_training import BlockwiseTraining, is_wide_dense_stack
from enhsim_tf.common.training import dense_stack, fit_windows

WINDOW, UNITS = 12, 20


def build_enhancer(window=500, units=3_200, seed=0):
    return dense_stack(window, (window, units, units, window), seed, name="enhancer")


def windows(number=80):
    target = np.random.default_rng(0).normal(size=(number, WINDOW)).astype(np.float32)
    return target[:, ::-1].copy(), target


@pytest.fixture(params=[3, 13])
def rows_in_a_block(request, monkeypatch):
    """Number of rows in a block of the widest kernel, none of which divides its 20 rows."""
    monkeypatch.setattr(blockwise_training, "BLOCK_BYTES", 4 * UNITS * request.param)
    return request.param


def trained_plainly(network, epochs, batch_size, seed, rate, loss="mean_squared_error"):
    """Trains with Keras on the same windows in the same order."""
    source, target = windows()
    network.compile(keras.optimizers.Adam(rate), loss=loss)
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(len(source)) for _ in range(epochs)]
    losses = [network.fit(source[o], target[o], batch_size=batch_size, verbose=0, shuffle=False).history["loss"][0] for o in orders]
    return np.array(losses)


def falling_rate():
    return keras.optimizers.schedules.CosineDecay(0.003, 20)


@pytest.mark.parametrize(("batch_size", "rate"), [(20, falling_rate), (33, lambda: 0.001)])
def test_it_trains_as_keras_adam_does(rows_in_a_block, batch_size, rate):
    network, plain = build_enhancer(WINDOW, UNITS), build_enhancer(WINDOW, UNITS)
    assert is_wide_dense_stack(network)
    history = fit_windows(network, *windows(), epochs=3, batch_size=batch_size, seed=3, learning_rate=rate(), verbose=0)
    expected = trained_plainly(plain, 3, batch_size, 3, rate())
    np.testing.assert_allclose(history["loss"], expected, rtol=3e-6)
    for weight, of_plain in zip(network.weights, plain.weights, strict=True):
        np.testing.assert_allclose(weight.numpy(), of_plain.numpy(), atol=5e-6)
    assert np.abs(network.get_weights()[0] - build_enhancer(WINDOW, UNITS).get_weights()[0]).max() > 1e-3


def test_another_loss_is_the_models(monkeypatch):
    monkeypatch.setattr(blockwise_training, "BLOCK_BYTES", 4 * UNITS * 7)
    network, plain = build_enhancer(WINDOW, UNITS), build_enhancer(WINDOW, UNITS)
    history = fit_windows(network, *windows(), epochs=3, batch_size=20, seed=3, verbose=0, loss="mean_absolute_error")
    np.testing.assert_allclose(history["loss"], trained_plainly(plain, 3, 20, 3, 0.001, "mean_absolute_error"), rtol=3e-6)


def test_validation_is_of_the_network_as_it_is_after_each_epoch(rows_in_a_block):
    network, (source, target) = build_enhancer(WINDOW, UNITS), windows()
    history = fit_windows(network, source, target, 2, 20, seed=3, validation=(source[:30], target[:30]), verbose=0)
    error = np.mean((network.predict(source[:30], verbose=0) - target[:30]) ** 2)
    assert history["val_loss"][-1] == pytest.approx(error, rel=1e-5) and history["val_loss"].shape == (2,)


def test_the_same_seed_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(blockwise_training, "BLOCK_BYTES", 4 * UNITS * 7)
    first, second = build_enhancer(WINDOW, UNITS), build_enhancer(WINDOW, UNITS)
    for network in (first, second):
        fit_windows(network, *windows(), epochs=3, batch_size=20, seed=3, verbose=0)
    for weight, of_second in zip(first.get_weights(), second.get_weights(), strict=True):
        np.testing.assert_array_equal(weight, of_second)


def test_a_kernel_is_cut_into_blocks_and_put_together(rows_in_a_block):
    network = build_enhancer(WINDOW, UNITS, seed=4)
    before = network.get_weights()
    training = BlockwiseTraining(network)
    source, _ = windows()
    np.testing.assert_allclose(training.predict(source, verbose=0), network.predict(source, verbose=0), rtol=1e-5, atol=5e-6)
    for layer in training._stack.layers:
        sizes = [block.value.shape[0] * block.value.shape[1] * 4 for block in layer.blocks]
        assert max(sizes) <= blockwise_training.BLOCK_BYTES + 4 * UNITS  # a block ends with a row
    network.set_weights([np.zeros_like(weight) for weight in before])
    training.write_back()
    for weight, expected in zip(network.get_weights(), before, strict=True):
        np.testing.assert_array_equal(weight, expected)


def test_the_papers_enhancer_has_blocks_and_small_stacks_have_none():
    assert is_wide_dense_stack(build_enhancer())
    assert not is_wide_dense_stack(build_enhancer(WINDOW, UNITS))
    assert not is_wide_dense_stack(dense_stack(500, (128, 16, 128, 500), 0, "autoencoder"))


WIDE = {"units": 1_200, "kernel_initializer": "zeros"}


@pytest.mark.parametrize(
    "layers",
    [
        [keras.layers.Dense(**WIDE, activation="tanh")],
        [keras.layers.Dense(**WIDE, use_bias=False)],
        [keras.layers.Dense(**WIDE, kernel_regularizer="l2")],
        [keras.layers.Dense(**WIDE, kernel_constraint="non_neg")],
        [keras.layers.Dense(**WIDE, trainable=False)],
        [keras.layers.Dense(**WIDE, dtype="mixed_bfloat16")],
        [keras.layers.Dense(**WIDE), keras.layers.Dropout(0.1, seed=0)],
        [keras.layers.Reshape((1_200, 1)), keras.layers.Conv1D(2, 3, kernel_initializer="zeros")],
    ],
)
def test_other_stacks_are_left_to_keras(layers):
    assert not is_wide_dense_stack(keras.Sequential([keras.Input((1_200,)), *layers]))
    assert is_wide_dense_stack(keras.Sequential([keras.Input((1_200,)), keras.layers.Dense(**WIDE, activation="relu")]))
