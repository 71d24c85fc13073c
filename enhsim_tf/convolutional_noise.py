"""A second pair of networks for the noise, beside the paper's: a generator that can fill the space, a judge that can see it.

The paper's generator turns 16 numbers into 500 samples, so its windows lie on a sheet of few dimensions, and its
discriminator looks at nothing but the largest response of each filter. Here

- the generator convolves white noise, sample after sample: every sample has a draw of its own, and any length is one
  piece. Rare large values come from a path that sees one sample at a time; what changes over many windows, such as the
  scale, comes from slow latent channels through an exponential gain.
- the discriminator judges a window by what a stationary process is known by: its scale, moments and threshold
  exceedances, its spectrum, and the maximum, mean and power of filter responses on the window at unit scale.

Both are trained by `noise_gan.NoiseGAN` as the paper's are.
"""

import keras
from keras import layers, ops

from enhsim_tf.enhancer import seeded_initialiser
from enhsim_tf.noise_gan import NoiseGAN

SLOW_SAMPLES = (500.0, 2_000.0, 8_000.0)  # correlation times of the slow channels: from a window to sixteen
_THRESHOLDS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)  # of the exceedances, in standard deviations
_TINY = 1e-6


def build_convolutional_generator(
    channels: int = 12, width: int = 21, num_white: int = 4, num_slow: int = len(SLOW_SAMPLES), rare_units: int = 8, seed: int = 0
) -> keras.Model:
    """Builds the generator.

    Args:
        channels: Channels of the two convolutions.
        width: Samples under a filter, odd.
        num_white: White channels of the latent series.
        num_slow: Slow channels, which come after them.
        rare_units: Units of the path that sees one sample at a time.
        seed: Seed of the weights.

    Returns:
        An uncompiled Keras model from shape `(rows, samples + 2 (width - 1), num_white + num_slow)` to `(rows, samples, 1)`,
        for any number of samples.
    """

    def kernel(number: int) -> keras.Initializer:
        return seeded_initialiser("he_uniform", seed * 1000 + number)

    latent = keras.Input((None, num_white + num_slow))
    white = latent[:, :, :num_white]
    aligned = layers.Cropping1D(width - 1)(latent)  # to the samples that the convolutions leave
    shaped = white
    for number in (400, 401):
        shaped = layers.Conv1D(channels, width, activation="leaky_relu", kernel_initializer=kernel(number))(shaped)
    rarely = keras.initializers.RandomUniform(-2.0, 0.0, seed=seed * 1000 + 402)
    rare = layers.Conv1D(rare_units, 1, activation="relu", kernel_initializer=kernel(403), bias_initializer=rarely)(
        aligned[:, :, :num_white]
    )
    paths = layers.Concatenate()([shaped, aligned[:, :, :num_white], rare, rare * rare])
    noise = layers.Conv1D(1, 1, kernel_initializer=kernel(404))(paths)
    if num_slow:
        gain = layers.Conv1D(16, 1, activation="tanh", kernel_initializer=kernel(405))(aligned[:, :, num_white:])
        near_one = keras.initializers.RandomNormal(0, 0.1, seed=seed * 1000 + 406)
        noise = noise * layers.Conv1D(1, 1, activation="exponential", kernel_initializer=near_one)(gain)
    return keras.Model(latent, noise, name="generator")


def build_statistics_discriminator(window: int = 500, filters: int = 64, width: int = 20, stride: int = 4, seed: int = 0) -> keras.Model:
    """Builds the discriminator.

    Args:
        window: Samples of a window.
        filters: Filters of its convolution.
        width: Samples under a filter.
        stride: Samples from one position of a filter to the next.
        seed: Seed of the weights.

    Returns:
        An uncompiled Keras model from shape `(windows, window, 1)` to `(windows, 1)`, the probability of being real.
    """

    def dense(units: int, number: int, activation: str = "leaky_relu") -> layers.Layer:
        return layers.Dense(units, activation, kernel_initializer=seeded_initialiser("he_uniform", seed * 1000 + number))

    def mean(values: keras.KerasTensor) -> keras.KerasTensor:
        return ops.mean(values, axis=1, keepdims=True)

    rows = keras.Input((window, 1))
    values = layers.Flatten()(rows)
    scale = ops.sqrt(mean(values * values) + _TINY)
    unit = values / scale

    steps = ops.diff(values, axis=1)
    moments = [mean(values), ops.log(scale), mean(unit**3), ops.log(mean(unit**4)), ops.log(mean(steps * steps) + _TINY)]
    largest = ops.log(ops.max(ops.abs(values), axis=1, keepdims=True) + _TINY)
    exceedances = [
        (threshold + 1) * mean(ops.relu(sign * each - threshold))
        for each in (values, unit)
        for sign in (1, -1)
        for threshold in _THRESHOLDS
    ]
    real, imaginary = ops.rfft(unit)
    spectrum = ops.log(real * real + imaginary * imaginary + 0.01)[:, 1:]

    convolution = layers.Conv1D(
        filters, width, stride, activation="leaky_relu", kernel_initializer=seeded_initialiser("he_uniform", seed * 1000 + 500)
    )
    responses = convolution(layers.Reshape((window, 1))(unit))
    pooled = [
        layers.GlobalMaxPooling1D()(responses),
        layers.GlobalAveragePooling1D()(responses),
        layers.GlobalAveragePooling1D()(responses * responses),
    ]
    seen = layers.Concatenate()([*moments, largest, *exceedances, dense(32, 501)(spectrum), *pooled])
    return keras.Model(rows, dense(1, 504, "sigmoid")(dense(32, 503)(dense(64, 502)(seen))), name="discriminator")


def convolutional_noise_gan(window: int = 500, scale: float = 1.0, seed: int = 0) -> NoiseGAN:
    """Both networks, untrained, with the settings that they are trained with.

    Args:
        window: Samples of a window.
        scale: Standard deviation of the noise to learn, in the telemetry's unit.
        seed: Seed of the weights and of every draw in training.
    """
    return NoiseGAN(
        build_convolutional_generator(seed=seed),
        build_statistics_discriminator(window, seed=seed),
        learning_rate=0.001,
        discriminator_learning_rate=0.0005,
        beta_1=0.5,
        averaging=0.98,
        scale=scale,
        slow_samples=SLOW_SAMPLES,
        seed=seed,
    )
