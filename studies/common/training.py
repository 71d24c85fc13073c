"""Training of the studies' networks that map windows to windows."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.fast_keras import fused_adam


def dense_stack(window: int, units: Sequence[int], seed: int, name: str) -> keras.Sequential:
    """Builds an uncompiled stack of Dense layers with relu activations, except for the last layer,
    which is linear.

    Args:
        window: Number of samples in an input window.
        units: Number of units of each layer.
        seed: Seed for the initial weights, from which each layer derives its own.
        name: Name of the model.
    """
    model = keras.Sequential([keras.Input((window,))], name=name)
    for number, width in enumerate(units):
        last = number == len(units) - 1
        model.add(
            keras.layers.Dense(
                width,
                activation=None if last else "relu",
                kernel_initializer=keras.initializers.HeUniform(seed * 1000 + number),
                name="Output" if last else f"Hidden_{number}" if number else "Input",
            )
        )
    return model


def fit_windows(
    model: keras.Model,
    inputs: np.ndarray,
    targets: np.ndarray,
    epochs: int,
    batch_size: int,
    seed: int,
    learning_rate: float,
) -> None:
    """Trains a model that maps windows to windows, by Adam. The windows are shuffled in each epoch.

    Args:
        model: A Keras model whose input and output have the shape `(windows, samples)`.
        inputs: Input windows, float32 of shape `(windows, samples)`.
        targets: Target windows of the same shape.
        epochs: Number of epochs.
        batch_size: Number of windows in each training step.
        seed: Seed for the shuffling.
        learning_rate: Adam's learning rate.
    """
    steps = -(-len(inputs) // batch_size)
    model.compile(
        fused_adam(learning_rate),
        loss="mean_squared_error",
        jit_compile=False,
        steps_per_execution=steps,  # an epoch is one call of the graph
    )
    rng = np.random.default_rng(seed)
    orders = np.stack([rng.permutation(len(inputs)) for _ in range(epochs)])
    model.fit(
        _batches(inputs, targets, orders, batch_size),
        epochs=epochs,
        steps_per_epoch=steps,
        verbose=0,
        shuffle=False,  # `_batches` has already shuffled the windows
    )


def _batches(
    inputs: np.ndarray, targets: np.ndarray, orders: np.ndarray, batch_size: int
) -> tf.data.Dataset:
    """Pairs of batches for all epochs, whose orders have the shape `(epochs, windows)`."""
    inputs = tf.constant(inputs)
    targets = tf.constant(targets)
    rows = tf.data.Dataset.from_tensor_slices(orders).flat_map(
        lambda order: tf.data.Dataset.from_tensor_slices(order).batch(batch_size)
    )
    options = tf.data.Options()
    # its thread sleeps for up to a minute, and deleting the data set waits for the thread
    options.autotune.enabled = False
    return (
        rows.map(lambda rows: (tf.gather(inputs, rows), tf.gather(targets, rows)))
        .prefetch(2)
        .with_options(options)
    )
