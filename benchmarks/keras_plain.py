"""Comparison: plain Keras 3 as in its guides, with `fit` and `predict` on NumPy arrays, and a
`tf.function` step for the GAN.
"""

import keras
import numpy as np
import tensorflow as tf
from keras import layers

from benchmarks.examples import (
    HIDDEN_UNITS,
    WINDOW,
    Work,
    epoch_clock,
    example_windows,
    gan_networks,
)


def enhancer() -> keras.Model:
    """Builds the paper's enhancer."""
    widths = (WINDOW, HIDDEN_UNITS, HIDDEN_UNITS)
    hidden = [
        layers.Dense(width, activation="relu", kernel_initializer="he_uniform") for width in widths
    ]
    return keras.Sequential(
        [keras.Input((WINDOW,)), *hidden, layers.Dense(WINDOW, kernel_initializer="he_uniform")]
    )


def enhancer_step(num_steps: int) -> Work:
    """Prepares training steps of the enhancer by `compile("adam", "mse")` and `fit`."""
    source, target = example_windows(15 * num_steps)
    model = enhancer()
    model.compile("adam", "mse")
    clock, seconds_of_last = epoch_clock()

    def run() -> float:
        model.fit(source, target, batch_size=15, epochs=1, verbose=0, callbacks=[clock])
        return seconds_of_last()

    return run, num_steps


def gan_iteration(num_iterations: int, dropout: float = 0.0) -> Work:
    """Prepares GAN iterations by a straightforward `tf.function` with three gradient tapes and the
    Conv1D layer of Keras.
    """
    generator, discriminator = gan_networks(keras, dropout)
    loss = keras.losses.BinaryCrossentropy()
    of_discriminator, of_generator = keras.optimizers.Adam(), keras.optimizers.Adam()
    of_discriminator.build(discriminator.trainable_variables)
    of_generator.build(generator.trainable_variables)

    @tf.function
    def step(real: tf.Tensor) -> None:
        fake = generator(tf.random.normal((200, 16)), training=False)
        for rows, tag in ((real, tf.ones((200, 1))), (fake, tf.zeros((200, 1)))):
            with tf.GradientTape() as tape:
                value = loss(tag, discriminator(rows, training=True))
            gradients = tape.gradient(value, discriminator.trainable_variables)
            of_discriminator.apply(gradients, discriminator.trainable_variables)
        with tf.GradientTape() as tape:
            value = loss(
                tf.ones((200, 1)),
                discriminator(generator(tf.random.normal((200, 16)), training=True), training=True),
            )
        of_generator.apply(
            tape.gradient(value, generator.trainable_variables), generator.trainable_variables
        )

    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.1, (1_500, WINDOW, 1)).astype(np.float32)

    def run() -> None:
        for _ in range(num_iterations):
            step(noise[rng.integers(0, len(noise), 200)])

    return run, num_iterations


def enhance_and_noise(num_windows: int) -> Work:
    """Prepares the generation of windows by `predict` of both networks."""
    enhancing, (generator, _) = enhancer(), gan_networks(keras)
    coarse, _ = example_windows(num_windows)
    latent = np.random.default_rng(0).normal(size=(num_windows, 16)).astype(np.float32)
    return (
        lambda: (
            enhancing.predict(coarse, verbose=0) + generator.predict(latent, verbose=0)[:, :, 0]
        ),
        num_windows,
    )
