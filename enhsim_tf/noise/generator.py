"""The paper's generator of noise (section 2.3, Figure 9)."""

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import seeded_initialiser


def build_generator(
    window: int = 500, latent: int = 16, hidden_units: int = 64, activation: str = "tanh", seed: int = 0, initialiser: str = "he_uniform"
) -> keras.Sequential:
    """Builds the paper's generator, Figure 9: Dense 64, BatchNormalization, Dense 500, Reshape.

    Args:
        window: Number of samples in a window.
        latent: Number of elements of the latent vector.
        hidden_units: Number of units of the first layer.
        activation: Activation of the last Dense layer. With tanh, the noise lies between -1 and 1.
        seed: Seed for the initial weights.
        initialiser: Keras name of the weight initialiser.

    Returns:
        An uncompiled Keras model, whose input has the shape `(windows, latent)` and whose output has the shape
        `(windows, window, 1)`.
    """
    first, last = (seeded_initialiser(initialiser, seed * 1000 + number) for number in (100, 101))
    return keras.Sequential(
        [
            keras.Input((latent,)),
            keras.layers.Dense(hidden_units, activation="relu", kernel_initializer=first),
            keras.layers.BatchNormalization(),
            keras.layers.Dense(window, activation=activation, kernel_initializer=last),
            keras.layers.Reshape((window, 1)),
        ],
        name="generator",
    )
