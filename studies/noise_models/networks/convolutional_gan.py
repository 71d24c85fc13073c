"""A convolutional GAN of noise, which the factorial study compares with simpler noise models.

The generator convolves white noise, so that every sample has a random input of its own. A path that processes one sample at a time
produces rare large values. Slow latent channels with an exponential gain produce changes over many windows, for example of the scale.
The discriminator receives summary statistics of a window, standardised by their variation over real windows, and pooled responses of
filters. Each iteration trains the discriminator on real and on generated windows, and then the generator through the discriminator, as
in section 2.3 of Feldman (2020).

References:
    Goodfellow et al., "Generative adversarial nets", 2014.
    Yazici et al., "The unusual effectiveness of averaging in GAN training", 2019.
"""

import numpy as np

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.training import predict_windows, seeded_initialiser

layers, ops = keras.layers, keras.ops

_SLOW_SAMPLES = np.array([500.0, 2_000.0, 8_000.0])  # correlation times of the slow channels, from 1 to 16 of the paper's windows
_NUM_WHITE = 4  # white-noise channels of the latent series, before the slow ones
_CHANNELS, _WIDTH = 8, 21  # of both convolutions of the generator; the width is in samples
_RARE_UNITS = 8  # of the path that processes one sample at a time
_FILTERS, _FILTER_WIDTH, _STRIDE = 32, 20, 4  # of the discriminator's convolution
_MARGIN = 2 * (_WIDTH - 1)  # samples by which the generator shortens its input
_BATCH = 200  # windows of each kind in an iteration
_RATE, _DISCRIMINATOR_RATE, _BETA_1 = 0.002, 0.001, 0.5  # of Adam
_CONSTANT_SHARE, _LAST_RATE = 0.6, 0.05  # iterations before the learning rate falls along a cosine, and where it ends
_AVERAGING = 0.98  # decay of the moving average of the generator's weights
_THRESHOLDS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)  # for the exceedances, in standard deviations
_LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)  # for the autocorrelation, in samples
_NUM_BANDS, _NUM_PARTS = 25, 5  # number of frequency bands; number of parts of a window whose scales are computed
_MIN_DEVIATION = 0.003  # added to standard deviations, so that nearly constant statistics are not amplified
_TINY = 1e-6  # keeps logarithms and square roots finite


class ConvolutionalGAN:
    """A trained generator of windows of noise, whose real standard deviation is `scale`."""

    def __init__(self, generator: keras.Model, window: int, scale: float):
        self.generator, self.window, self.scale = generator, int(window), float(scale)

    def generate(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Generates windows of noise, float32 of shape `(number, samples)`, in the unit of the telemetry."""
        from scipy.signal import lfilter

        latent = rng.standard_normal((number, self.window + _MARGIN, _NUM_WHITE + len(_SLOW_SAMPLES)), np.float32)
        for channel, decay in enumerate(np.exp(-1 / _SLOW_SAMPLES), _NUM_WHITE):
            steps = latent[:, :, channel]
            steps[:, 1:] *= np.sqrt(1 - decay**2)
            latent[:, :, channel] = lfilter([1.0], [1.0, -decay], steps, axis=1)
        return predict_windows(self.generator, latent, 1_024)[:, :, 0] * np.float32(self.scale)


def fit_convolutional_gan(residual_windows: np.ndarray, num_iterations: int, seed: int) -> ConvolutionalGAN:
    """Trains a convolutional GAN on windows of noise.

    Args:
        residual_windows: Real noise of shape `(windows, samples)`, in the unit of the telemetry.
        num_iterations: Number of iterations. 0 leaves the generator untrained.
        seed: Seed of the initial weights and of all random numbers in training.

    Raises:
        InputError: If the noise is not finite or constant, or if the training diverges.
    """
    noise = np.asarray(residual_windows, np.float32)
    scale = float(np.std(noise, dtype=np.float64))
    if not (np.isfinite(noise).all() and scale > 0):
        raise InputError("Expected finite noise that varies. Received: windows with NaN or infinity, or of one value. Look for outliers.")
    generator, discriminator = build_generator(seed=seed), build_discriminator(noise / scale, seed=seed)
    training = _Training(generator, discriminator, noise / np.float32(scale), num_iterations, seed)
    for _ in range(num_iterations):
        training.step()
    if num_iterations:
        training.generator_optimizer.finalize_variable_values(generator.trainable_variables)
    if not all(np.isfinite(weight).all() for weight in generator.get_weights()):
        raise InputError("Expected noise that a GAN can learn. Received: a training that diverged. Try another seed.")
    return ConvolutionalGAN(generator, noise.shape[1], scale)


class _Training:
    """The networks in training, their optimisers and their seeds."""

    def __init__(self, generator: keras.Model, discriminator: keras.Model, noise: np.ndarray, num_iterations: int, seed: int):
        self.generator, self.discriminator, self.window = generator, discriminator, noise.shape[1]
        self.noise, self.seeds = tf.constant(noise[:, :, None]), keras.random.SeedGenerator(seed)
        self.loss = keras.losses.BinaryCrossentropy()
        adam = keras.optimizers.Adam
        self.generator_optimizer = adam(_falling(_RATE, num_iterations), _BETA_1, use_ema=True, ema_momentum=_AVERAGING)
        self.discriminator_optimizer = adam(_falling(_DISCRIMINATOR_RATE, 2 * num_iterations), _BETA_1)
        self.generator_optimizer.build(generator.trainable_variables)
        self.discriminator_optimizer.build(discriminator.trainable_variables)
        # A slow channel is an AR(1) process with decay d, written as a cumulative sum: x_t = d^t * sum of s_k d^-k e_k.
        place = np.arange(self.window + _MARGIN)[:, None]
        steps = np.where(place > 0, np.sqrt(1 - np.exp(-2 / _SLOW_SAMPLES)), 1.0)
        self._rise = tf.constant(steps * np.exp(place / _SLOW_SAMPLES), tf.float32)
        self._fall = tf.constant(np.exp(-place / _SLOW_SAMPLES), tf.float32)
        self.step = tf.function(self._step)

    def _step(self) -> None:
        """Updates the discriminator on real and on generated windows, and then the generator through the discriminator."""
        real = tf.gather(self.noise, keras.random.randint((_BATCH,), 0, self.noise.shape[0], seed=self.seeds))
        generated = self.generator(self._draw_latent())
        weights = self.discriminator.trainable_variables
        for rows, tag in ((real, 1.0), (generated, 0.0)):
            with tf.GradientTape() as tape:
                loss = self.loss(tf.fill((_BATCH, 1), tag), self.discriminator(rows, training=True))
            self.discriminator_optimizer.apply(tape.gradient(loss, weights), weights)
        weights = self.generator.trainable_variables
        with tf.GradientTape() as tape:
            generated = self.generator(self._draw_latent(), training=True)
            loss = self.loss(tf.fill((_BATCH, 1), 1.0), self.discriminator(generated, training=True))
        self.generator_optimizer.apply(tape.gradient(loss, weights), weights)

    def _draw_latent(self) -> tf.Tensor:
        draws = keras.random.normal((_BATCH, self.window + _MARGIN, _NUM_WHITE + len(_SLOW_SAMPLES)), seed=self.seeds)
        slow = self._fall * tf.cumsum(self._rise * draws[:, :, _NUM_WHITE:], axis=1)
        return tf.concat([draws[:, :, :_NUM_WHITE], slow], 2)


def _falling(rate: float, steps: int) -> keras.optimizers.schedules.LearningRateSchedule:
    """A learning rate that is constant at first and then falls along a cosine."""
    constant = min(round(_CONSTANT_SHARE * steps), max(steps - 1, 0))  # Keras requires at least one decay step
    return keras.optimizers.schedules.CosineDecay(rate, max(steps - constant, 1), _LAST_RATE, warmup_target=rate, warmup_steps=constant)


def build_generator(seed: int = 0) -> keras.Model:
    """Builds the generator, from latent series of shape `(rows, samples + 40, 7)` to noise of shape `(rows, samples, 1)`."""

    def kernel(number: int) -> keras.Initializer:
        return seeded_initialiser("he_uniform", seed * 1000 + number)

    latent = keras.Input((None, _NUM_WHITE + len(_SLOW_SAMPLES)))
    white = latent[:, :, :_NUM_WHITE]
    aligned = layers.Cropping1D(_WIDTH - 1)(latent)  # keeps the samples that remain after the convolutions
    shaped = white
    for number in (400, 401):
        shaped = layers.Conv1D(_CHANNELS, _WIDTH, activation="leaky_relu", kernel_initializer=kernel(number))(shaped)
    # Units that become active at one to four standard deviations. Their squares start large, because heavy tails that start
    # small grow too slowly during training.
    rarely = keras.initializers.RandomUniform(-4.0, -1.0, seed=seed * 1000 + 402)
    rare = layers.Dense(_RARE_UNITS, "relu", kernel_initializer=kernel(403), bias_initializer=rarely)(aligned[:, :, :_NUM_WHITE])
    paths = layers.Concatenate()([shaped, aligned[:, :, :_NUM_WHITE], rare, 2 * rare * rare])
    noise = layers.Dense(1, kernel_initializer=kernel(404))(paths)
    gain = layers.Dense(8, "tanh", kernel_initializer=kernel(405))(aligned[:, :, _NUM_WHITE:])
    near_one = keras.initializers.RandomNormal(0, 0.1, seed=seed * 1000 + 406)
    noise = noise * layers.Dense(1, "exponential", kernel_initializer=near_one)(gain)
    return keras.Model(latent, noise, name="generator")


def build_discriminator(noise_windows: np.ndarray, seed: int = 0) -> keras.Model:
    """Builds the discriminator on summary statistics, from windows of shape `(windows, samples, 1)` to the probability that they are real.

    Each statistic is standardised by its mean and its standard deviation over real windows, and its tails are compressed by
    an inverse hyperbolic sine. The standardisation is necessary because some statistics vary little. For example, where the
    scale of real windows varies by five per cent, a discriminator that received the scale itself did not learn to use that
    variation within the paper's 1,000 iterations.

    Args:
        noise_windows: Real noise at unit scale, shape `(windows, samples)`.
        seed: Seed for the initial weights.
    """

    def dense(units: int, number: int, activation: str = "leaky_relu") -> layers.Layer:
        return layers.Dense(units, activation, kernel_initializer=seeded_initialiser("he_uniform", seed * 1000 + number))

    window = noise_windows.shape[1]
    rows = keras.Input((window, 1))
    statistics, unit, spectrum = _statistics(layers.Flatten()(rows))
    on_real = predict_windows(keras.Model(rows, statistics), np.asarray(noise_windows, np.float32)[:, :, None], 1_024)
    mean, deviation = on_real.mean(axis=0, dtype=np.float64), on_real.std(axis=0, dtype=np.float64) + _MIN_DEVIATION
    statistics = layers.Normalization(mean=mean.tolist(), variance=np.square(deviation).tolist())(statistics)

    kernel = seeded_initialiser("he_uniform", seed * 1000 + 500)
    convolution = layers.Conv1D(_FILTERS, _FILTER_WIDTH, _STRIDE, activation="leaky_relu", kernel_initializer=kernel)
    responses = convolution(layers.Reshape((window, 1))(unit))
    pooled = [
        layers.GlobalMaxPooling1D()(responses),
        layers.GlobalAveragePooling1D()(responses),
        layers.GlobalAveragePooling1D()(responses * responses),
    ]
    seen = layers.Concatenate(name="seen")([ops.arcsinh(statistics), dense(32, 501)(spectrum), *pooled])
    return keras.Model(rows, dense(1, 504, "sigmoid")(dense(32, 503)(dense(64, 502)(seen))), name="discriminator")


def _statistics(values: keras.KerasTensor) -> tuple[keras.KerasTensor, keras.KerasTensor, keras.KerasTensor]:
    """Computes the summary statistics of windows of shape `(windows, samples)`, the windows at unit scale, and their log power spectra."""

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
