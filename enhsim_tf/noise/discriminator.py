"""The paper's discriminator of noise (section 2.3, Figure 10)."""

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import seeded_initialiser


def build_discriminator(
    window: int = 500,
    filters: int = 500,
    width: int = 20,
    stride: int = 4,
    narrow_units: int = 25,
    dropout: float = 0.0,
    seed: int = 0,
    initialiser: str = "he_uniform",
) -> keras.Sequential:
    """Builds the paper's discriminator, Figure 10: a convolution, global max pooling, a narrow Dense layer and a sigmoid output.

    Args:
        window: Number of samples in a window.
        filters: Number of filters of the convolution.
        width: Width of each filter in samples.
        stride: Stride of the convolution in samples.
        narrow_units: Number of units of the narrow Dense layer.
        dropout: Dropout rate after the convolution and after the narrow layer. With 0, there are no dropout layers.
        seed: Seed for the initial weights.
        initialiser: Keras name of the weight initialiser.

    Returns:
        An uncompiled Keras model, whose input has the shape `(windows, window, 1)`. Its output of shape `(windows, 1)` is the
        probability that a window is real.
    """
    kernels = [seeded_initialiser(initialiser, seed * 1000 + number) for number in (200, 201, 202)]

    def dropped(number: int) -> list[keras.layers.Layer]:
        return [keras.layers.Dropout(dropout, seed=seed * 1000 + number)] if dropout else []

    return keras.Sequential(
        [
            keras.Input((window, 1)),
            keras.layers.Conv1D(filters, width, strides=stride, activation="relu", kernel_initializer=kernels[0]),
            *dropped(300),
            keras.layers.GlobalMaxPooling1D(),
            keras.layers.Dense(narrow_units, activation="relu", kernel_initializer=kernels[1]),
            *dropped(301),
            keras.layers.Dense(1, activation="sigmoid", kernel_initializer=kernels[2]),
        ],
        name="discriminator",
    )
