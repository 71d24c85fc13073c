"""Comparison: the textbook GAN loop, with one call of `predict` and three calls of `train_on_batch`
in each iteration.

The loop needs legacy Keras. In Keras 3, setting `trainable = False` before compiling the combined
model freezes the discriminator permanently, so the loop would be fast but wrong. Before the timing,
a check ensures that the discriminator learns.
"""

import numpy as np
import tf_keras as keras

from benchmarks.examples import WINDOW, Work, gan_networks


def gan_iteration(num_iterations: int, dropout: float = 0.0) -> Work:
    """Prepares iterations with 200 real and 200 generated rows for the discriminator and 200 for
    the generator.
    """
    generator, discriminator = gan_networks(keras, dropout)
    discriminator.compile(loss="binary_crossentropy", optimizer="adam", metrics=["accuracy"])
    discriminator.trainable = False
    combined = keras.Sequential([generator, discriminator])
    combined.compile(loss="binary_crossentropy", optimizer="adam")

    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.1, (1_500, WINDOW, 1)).astype(np.float32)
    ones, zeros = np.ones((200, 1), np.float32), np.zeros((200, 1), np.float32)

    def run() -> None:
        for _ in range(num_iterations):
            real = noise[rng.integers(0, len(noise), 200)]
            generated = generator.predict(rng.normal(size=(200, 16)), verbose=0)
            discriminator.train_on_batch(real, ones)
            discriminator.train_on_batch(generated, zeros)
            combined.train_on_batch(rng.normal(size=(200, 16)), ones)

    before = [weight.copy() for weight in discriminator.get_weights()]
    run()
    if all(np.array_equal(*pair) for pair in zip(before, discriminator.get_weights(), strict=True)):
        raise RuntimeError("Expected a discriminator that learns. Received: unchanged weights.")
    return run, num_iterations
