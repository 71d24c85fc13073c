"""A convolutional generator with full-rank output, and a discriminator on summary statistics (an alternative GAN for section 2.3).

The paper's generator maps 16 numbers to 500 samples, so its windows lie near a low-dimensional manifold. The paper's
discriminator receives only the largest response of each convolution filter. The networks of this module differ as follows:

- The generator convolves white noise, so that every sample has a random input of its own. It generates a series of any
  length without seams. A path that processes one sample at a time produces rare large values. Slow latent channels with an
  exponential gain produce changes over many windows, for example of the scale.
- The discriminator receives summary statistics that characterise a stationary process: scale, moments, autocorrelations,
  threshold exceedances and spectrum. Each statistic is standardised by its variation over real windows. The discriminator
  also receives the maximum, the mean and the power of filter responses to the window at unit scale.

`enhsim_tf.noise.gan.NoiseGAN` trains these networks with the same algorithm as the paper's networks.
"""

import numpy as np

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import predict_windows, seeded_initialiser
from enhsim_tf.noise.gan import NoiseGAN

layers, ops = keras.layers, keras.ops

SLOW_SAMPLES = (500.0, 2_000.0, 8_000.0)  # correlation times of the slow channels in samples, from 1 to 16 of the paper's windows
_THRESHOLDS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)  # for the exceedances, in standard deviations
_LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)  # for the autocorrelation, in samples
_NUM_BANDS, _NUM_PARTS = 25, 5  # number of frequency bands; number of parts of a window whose scales are computed
_MIN_DEVIATION = 0.003  # added to standard deviations, so that nearly constant statistics are not amplified
_TINY = 1e-6  # keeps logarithms and square roots finite


def build_convolutional_generator(
    channels: int = 8, width: int = 21, num_white: int = 4, num_slow: int = len(SLOW_SAMPLES), rare_units: int = 8, seed: int = 0
) -> keras.Model:
    """Builds the convolutional generator.

    Args:
        channels: Number of channels of each of the two convolutions.
        width: Width of each filter in samples, odd.
        num_white: Number of white-noise channels of the latent series.
        num_slow: Number of slow channels of the latent series, which follow the white-noise channels.
        rare_units: Number of units of the path that processes one sample at a time.
        seed: Seed for the initial weights.

    Returns:
        An uncompiled Keras model, whose input has the shape `(rows, samples + 2 (width - 1), num_white + num_slow)` and whose
        output has the shape `(rows, samples, 1)`, for any number of samples.
    """

    def kernel(number: int) -> keras.Initializer:
        return seeded_initialiser("he_uniform", seed * 1000 + number)

    latent = keras.Input((None, num_white + num_slow))
    white = latent[:, :, :num_white]
    aligned = layers.Cropping1D(width - 1)(latent)  # keeps the samples that remain after the convolutions
    shaped = white
    for number in (400, 401):
        shaped = layers.Conv1D(channels, width, activation="leaky_relu", kernel_initializer=kernel(number))(shaped)
    # Units that become active at one to four standard deviations. Their squares start large, because heavy tails that start
    # small grow too slowly during training.
    rarely = keras.initializers.RandomUniform(-4.0, -1.0, seed=seed * 1000 + 402)
    rare = layers.Dense(rare_units, "relu", kernel_initializer=kernel(403), bias_initializer=rarely)(aligned[:, :, :num_white])
    paths = layers.Concatenate()([shaped, aligned[:, :, :num_white], rare, 2 * rare * rare])
    noise = layers.Dense(1, kernel_initializer=kernel(404))(paths)
    if num_slow:
        gain = layers.Dense(8, "tanh", kernel_initializer=kernel(405))(aligned[:, :, num_white:])
        near_one = keras.initializers.RandomNormal(0, 0.1, seed=seed * 1000 + 406)
        noise = noise * layers.Dense(1, "exponential", kernel_initializer=near_one)(gain)
    return keras.Model(latent, noise, name="generator")


def build_statistics_discriminator(
    noise_windows: np.ndarray, filters: int = 32, width: int = 20, stride: int = 4, seed: int = 0
) -> keras.Model:
    """Builds the discriminator on summary statistics.

    Each statistic is standardised by its mean and its standard deviation over real windows, and its tails are compressed by
    an inverse hyperbolic sine. The standardisation is necessary because some statistics vary little. For example, where the
    scale of real windows varies by five per cent, a discriminator that received the scale itself did not learn to use that
    variation within the paper's 1,000 iterations.

    Args:
        noise_windows: Real noise at unit scale, shape `(windows, samples)`.
        filters: Number of filters of the convolution.
        width: Width of each filter in samples.
        stride: Stride of the convolution in samples.
        seed: Seed for the initial weights.

    Returns:
        An uncompiled Keras model, whose input has the shape `(windows, samples, 1)`. Its output of shape `(windows, 1)` is the
        probability that a window is real.
    """

    def dense(units: int, number: int, activation: str = "leaky_relu") -> layers.Layer:
        return layers.Dense(units, activation, kernel_initializer=seeded_initialiser("he_uniform", seed * 1000 + number))

    window = noise_windows.shape[1]
    rows = keras.Input((window, 1))
    statistics, unit, spectrum = _statistics(layers.Flatten()(rows))
    on_real = predict_windows(keras.Model(rows, statistics), np.asarray(noise_windows, np.float32)[:, :, None], 1_024)
    mean, deviation = on_real.mean(axis=0, dtype=np.float64), on_real.std(axis=0, dtype=np.float64) + _MIN_DEVIATION
    statistics = layers.Normalization(mean=mean.tolist(), variance=np.square(deviation).tolist())(statistics)

    convolution = layers.Conv1D(
        filters, width, stride, activation="leaky_relu", kernel_initializer=seeded_initialiser("he_uniform", seed * 1000 + 500)
    )
    responses = convolution(layers.Reshape((window, 1))(unit))
    pooled = [
        layers.GlobalMaxPooling1D()(responses),
        layers.GlobalAveragePooling1D()(responses),
        layers.GlobalAveragePooling1D()(responses * responses),
    ]
    seen = layers.Concatenate(name="seen")([ops.arcsinh(statistics), dense(32, 501)(spectrum), *pooled])
    return keras.Model(rows, dense(1, 504, "sigmoid")(dense(32, 503)(dense(64, 502)(seen))), name="discriminator")


def _statistics(values: keras.KerasTensor) -> tuple[keras.KerasTensor, keras.KerasTensor, keras.KerasTensor]:
    """Computes the summary statistics of each window, the window at unit scale, and its log power spectrum.

    Args:
        values: Windows of shape `(windows, samples)`.
    """

    def mean(each: keras.KerasTensor) -> keras.KerasTensor:
        return ops.mean(each, axis=1, keepdims=True)

    def log_largest(each: keras.KerasTensor) -> keras.KerasTensor:
        return ops.log(ops.max(ops.abs(each), axis=1, keepdims=True) + _TINY)

    def in_parts(each: keras.KerasTensor, number: int) -> keras.KerasTensor:
        length = max(1, each.shape[1] // number)
        number = min(number, each.shape[1])
        return ops.log(ops.mean(ops.reshape(each[:, : number * length], (-1, number, length)), axis=2) + _TINY)

    window = values.shape[1]
    scale = ops.sqrt(mean(values * values) + _TINY)
    unit = values / scale
    square = unit * unit  # products instead of powers, because the gradient of a power computes logarithms
    steps = ops.diff(values, axis=1)
    bends = ops.diff(steps, axis=1)
    kurtosis = ops.maximum(mean(square * square), _TINY)  # 0 in a window of zeros, whose logarithm would make every weight NaN
    moments = [mean(values), ops.log(scale), mean(square * unit), ops.log(kurtosis), ops.log(mean(ops.abs(unit)) + _TINY)]
    roughness = [ops.log(mean(each * each) + _TINY) for each in (steps, bends)]
    correlations = [mean(unit[:, lag:] * unit[:, :-lag]) for lag in _LAGS if lag < window]
    exceedances = [mean(ops.relu(sign * each - threshold)) for each in (values, unit) for sign in (1, -1) for threshold in _THRESHOLDS]

    real, imaginary = ops.rfft(unit)
    power = (real * real + imaginary * imaginary)[:, 1:]
    bands, parts = in_parts(power, _NUM_BANDS), in_parts(values * values, _NUM_PARTS)
    largest = [log_largest(each) for each in (values, unit, steps)]
    joined = ops.concatenate([*moments, *roughness, *largest, *correlations, *exceedances, bands, parts], axis=1)
    return joined, unit, ops.log(power + 0.01)


def convolutional_noise_gan(noise_windows: np.ndarray, num_iterations: int = 1_000, seed: int = 0) -> NoiseGAN:
    """Builds a `NoiseGAN` with both convolutional networks, untrained, and with the settings for their training.

    The learning rates are constant for the first 60 % of the iterations. They then decay along a cosine to 5 % of their
    initial values.

    Args:
        noise_windows: Real noise windows, shape `(windows, samples)`, in the unit of the telemetry.
        num_iterations: Number of iterations of the planned training, which determines the learning-rate schedule.
        seed: Seed for the initial weights and for all random numbers in training.

    Returns:
        The untrained GAN.
    """

    def falling(rate: float, steps: int) -> keras.optimizers.schedules.LearningRateSchedule:
        steps = max(1, steps)  # there are no steps if the noise is to remain untrained
        constant = min(round(0.6 * steps), steps - 1)  # Keras requires at least one decay step
        return keras.optimizers.schedules.CosineDecay(rate, steps - constant, 0.05, warmup_target=rate, warmup_steps=constant)

    scale = float(np.std(noise_windows, dtype=np.float64))
    return NoiseGAN(
        build_convolutional_generator(seed=seed),
        build_statistics_discriminator(np.asarray(noise_windows) / scale, seed=seed),
        learning_rate=falling(0.002, num_iterations),
        discriminator_learning_rate=falling(0.001, 2 * num_iterations),  # the discriminator takes two steps in each iteration
        beta_1=0.5,
        averaging=0.98,
        scale=scale,
        slow_samples=SLOW_SAMPLES,
        seed=seed,
    )
