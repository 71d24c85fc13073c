"""A second pair of networks for the noise, beside the paper's: a generator that can fill the space, a judge that can see it.

The paper's generator turns 16 numbers into 500 samples, so its windows lie on a sheet of few dimensions, and its
discriminator looks at nothing but the largest response of each filter. Here

- the generator convolves white noise, sample after sample: every sample has a draw of its own, and any length is one
  piece. Rare large values come from a path that sees one sample at a time; what changes over many windows, such as the
  scale, comes from slow latent channels through an exponential gain.
- the discriminator judges a window by what a stationary process is known by: its scale, moments, correlations and
  threshold exceedances, its spectrum, each as far as real windows vary in it, and the maximum, mean and power of filter
  responses on the window at unit scale.

Both are trained by `noise_gan.NoiseGAN` as the paper's are.
"""

import numpy as np

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import predict_windows, seeded_initialiser
from enhsim_tf.noise.gan import NoiseGAN

layers, ops = keras.layers, keras.ops

SLOW_SAMPLES = (500.0, 2_000.0, 8_000.0)  # correlation times of the slow channels: from a window to sixteen
_THRESHOLDS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)  # of the exceedances, in standard deviations
_LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)  # of the autocorrelation, in samples
_NUM_BANDS, _NUM_PARTS = 25, 5  # bands of the spectrum; parts of a window whose scales are compared
_LEAST_DEVIATION = 0.003  # a statistic that hardly varies is not blown up
_TINY = 1e-6


def build_convolutional_generator(
    channels: int = 8, width: int = 21, num_white: int = 4, num_slow: int = len(SLOW_SAMPLES), rare_units: int = 8, seed: int = 0
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
    # units that fire at one to four standard deviations, and large when they do: tails that begin small grow too slowly
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
    """Builds the discriminator.

    Each statistic is centred on its mean over real windows, divided by its standard deviation there, and its tails are
    drawn in by an inverse hyperbolic sine. Where the scale of windows varies by five per cent, a discriminator that saw
    the scale itself would have to learn to look at the second digit, and did not within the paper's 1,000 iterations.

    Args:
        noise_windows: Real noise at unit scale, shape `(windows, samples)`.
        filters: Filters of its convolution.
        width: Samples under a filter.
        stride: Samples from one position of a filter to the next.
        seed: Seed of the weights.

    Returns:
        An uncompiled Keras model from shape `(windows, samples, 1)` to `(windows, 1)`, the probability of being real.
    """

    def dense(units: int, number: int, activation: str = "leaky_relu") -> layers.Layer:
        return layers.Dense(units, activation, kernel_initializer=seeded_initialiser("he_uniform", seed * 1000 + number))

    window = noise_windows.shape[1]
    rows = keras.Input((window, 1))
    statistics, unit, spectrum = _statistics(layers.Flatten()(rows))
    on_real = predict_windows(keras.Model(rows, statistics), np.asarray(noise_windows, np.float32)[:, :, None], 1_024)
    mean, deviation = on_real.mean(axis=0, dtype=np.float64), on_real.std(axis=0, dtype=np.float64) + _LEAST_DEVIATION
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
    """What a stationary process is known by, the window at unit scale, and its logarithmic spectrum.

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
    square = unit * unit  # powers by products: a power's gradient takes logarithms
    steps = ops.diff(values, axis=1)
    bends = ops.diff(steps, axis=1)
    moments = [mean(values), ops.log(scale), mean(square * unit), ops.log(mean(square * square)), ops.log(mean(ops.abs(unit)) + _TINY)]
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
    """Both networks, untrained, with the settings that they are trained with.

    The learning rates stay constant for six tenths of the iterations and then fall along a cosine to a twentieth.

    Args:
        noise_windows: The noise to learn, shape `(windows, samples)`, in the telemetry's unit.
        num_iterations: Iterations that they will be trained for.
        seed: Seed of the weights and of every draw in training.
    """

    def falling(rate: float, steps: int) -> keras.optimizers.schedules.LearningRateSchedule:
        steps = max(1, steps)  # none are asked for where the noise stays untrained
        constant = min(round(0.6 * steps), steps - 1)  # a "warm-up" that begins where it ends; Keras wants a step to fall in
        return keras.optimizers.schedules.CosineDecay(rate, steps - constant, 0.05, warmup_target=rate, warmup_steps=constant)

    scale = float(np.std(noise_windows, dtype=np.float64))
    return NoiseGAN(
        build_convolutional_generator(seed=seed),
        build_statistics_discriminator(np.asarray(noise_windows) / scale, seed=seed),
        learning_rate=falling(0.002, num_iterations),
        discriminator_learning_rate=falling(0.001, 2 * num_iterations),  # it takes two steps an iteration
        beta_1=0.5,
        averaging=0.98,
        scale=scale,
        slow_samples=SLOW_SAMPLES,
        seed=seed,
    )
