"""Section 2.3: the noise of the environment, and the second network, a GAN that learns to generate
it.

"In this approach, noise is trained independently using Generative Adversarial Neural Networks
(GANs)."
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.fast_keras import fused_adam, with_fast_convolution
from enhsim_tf.paper.enhancer import initialiser, predict
from enhsim_tf.paper.settings import Settings

REAL = 1.0
GENERATED = 0.0
"""Labels: "Real data has a tag of 1.0, while generated data has a tag of 0.0." """


def extract_noise(
    values: np.ndarray, width: int, average: str = "centred"
) -> tuple[np.ndarray, np.ndarray]:
    """Step 6: the noise of a series, which is the series minus its moving average.

    "This average is subtracted from the original signal, leaving the noise." The paper cites the
    rolling mean of pandas. Samples without a full average are cut.

    Args:
        values: Series of shape `(samples,)`.
        width: Samples in the moving average; odd if it is centred.
        average: `centred`, or `trailing` as in pandas' default.

    Returns:
        Noise and moving average, float32 of shape `(samples - width + 1,)`.
    """
    series = pd.Series(np.asarray(values, np.float64))
    mean = series.rolling(width, center=average == "centred").mean()
    is_full = mean.notna()
    return (series - mean)[is_full].to_numpy(np.float32), mean[is_full].to_numpy(np.float32)


def build_generator(settings: Settings) -> keras.Sequential:
    """Builds the generator of Figure 9.

    "The 16-element latent vector is densely connected to a layer of 64 neurons. These are then
    normalized and spread to a layer of 500 neurons, the number of samples in the time series. This
    layer is reshaped to be compatible as the input layer of the discriminator."

    Returns:
        A network from `(rows, 16)` to `(rows, window, 1)`.
    """
    hidden_kernel = initialiser(settings, "he_uniform", 100)
    output_kernel = initialiser(settings, "glorot_uniform", 101)
    return keras.Sequential(
        [
            keras.Input((settings.latent,)),
            keras.layers.Dense(settings.generator_units, "relu", kernel_initializer=hidden_kernel),
            keras.layers.BatchNormalization(),
            keras.layers.Dense(
                settings.window, settings.generator_activation, kernel_initializer=output_kernel
            ),
            keras.layers.Reshape((settings.window, 1)),
        ],
        name="generator",
    )


def build_discriminator(settings: Settings) -> keras.Sequential:
    """Builds the discriminator of Figure 10: a convolution, pooled by its maximum, and layers that
    narrow to one neuron.

    "One convolutional layer that merges input from 4 rows of inputs using a window 20 neurons wide
    with a stride of 4 neurons per step. This layer pools each convolution based on the maximum
    value of the sample." (What the 4 rows are is open.) "The layers are progressively narrowed to
    the final single neuron who's value determines if the input is considered real or fake."
    Dropout, relu and the number of filters are those of the author's code.

    Returns:
        A network from `(rows, window, 1)` to `(rows, 1)`, the probability that a row is real.
    """
    convolution_kernel = initialiser(settings, "glorot_uniform", 200)
    narrow_kernel = initialiser(settings, "he_uniform", 201)
    output_kernel = initialiser(settings, "glorot_uniform", 202)

    def dropout(number: int) -> list[keras.layers.Layer]:
        seed = 1_000 * settings.seed + number
        return [keras.layers.Dropout(settings.dropout, seed=seed)] if settings.dropout else []

    return keras.Sequential(
        [
            keras.Input((settings.window, 1)),
            keras.layers.Conv1D(
                settings.filters,
                settings.filter_width,
                settings.stride,
                activation="relu",
                kernel_initializer=convolution_kernel,
            ),
            *dropout(300),
            keras.layers.GlobalMaxPooling1D(),
            keras.layers.Dense(settings.narrow_units, "relu", kernel_initializer=narrow_kernel),
            *dropout(301),
            keras.layers.Dense(1, "sigmoid", kernel_initializer=output_kernel),
        ],
        name="discriminator",
    )


class NoiseGAN(keras.Model):
    """The GAN of Figure 11, "created by connecting the discriminator and generator networks
    together".

    Keras 3 reads `trainable` when a training step is built. So the usual recipe (compile the
    discriminator, set `trainable = False`, compile the combined model) never trains the
    discriminator. Here its weights are listed before it is frozen: they can be updated, and the
    combined model sees them as frozen.

    Args:
        generator: The network of `build_generator`.
        discriminator: The network of `build_discriminator`.
        settings: All settings.
    """

    def __init__(self, generator: keras.Model, discriminator: keras.Model, settings: Settings):
        super().__init__(name="noise_gan")
        self.settings = settings
        self.generator = generator
        self.discriminator = discriminator
        self.discriminator_weights = list(discriminator.trainable_variables)
        discriminator.trainable = False
        self.combined = keras.Sequential([generator, discriminator], name="combined")
        self.seeds = keras.random.SeedGenerator(settings.seed)  # of all draws in training
        self.trackers = {
            name: keras.metrics.Mean(name)
            for name in (
                "discriminator_loss",
                "generator_loss",
                "accuracy_real",
                "accuracy_generated",
                "loss_real",
                "loss_generated",
            )
        }

    def compile(
        self,
        discriminator_optimizer: keras.optimizers.Optimizer,
        generator_optimizer: keras.optimizers.Optimizer,
        loss_function: keras.losses.Loss,
    ) -> None:
        """Sets an optimizer for each network, and the loss of both."""
        super().compile(optimizer=None, jit_compile=False)
        self.discriminator_optimizer = discriminator_optimizer
        self.generator_optimizer = generator_optimizer
        self.loss_function = loss_function

    @property
    def metrics(self) -> list[keras.metrics.Metric]:
        """Losses of the two updates, and accuracy and loss on real and on generated rows, which
        `test_step` measures.
        """
        return list(self.trackers.values())

    def train_step(self, real: tf.Tensor) -> dict[str, tf.Tensor]:
        """One iteration: "the training of the discriminator, and the training of the generator".

        Args:
            real: Real rows, float32 of shape `(rows_of_each_kind, window)`.
        """
        # "the discriminator as a standalone model is fed with equal amounts of data from the real
        # data set and the generated data set"
        number = self.settings.rows_of_each_kind
        real = tf.reshape(real, (number, self.settings.window, 1))
        # as the author's `predict`: batch normalisation by its moving statistics
        generated = self.generator(self.draw_latent(number), training=False)

        # "It then trains on the entire batch (200 rows) of real and generated data."
        if self.settings.update == "two of 200":  # the author's code
            self.train_discriminator(real, labels(number, REAL))
            self.train_discriminator(generated, labels(number, GENERATED))
        else:  # the paper's text
            tags = tf.concat([labels(number, REAL), labels(number, GENERATED)], 0)
            self.train_discriminator(tf.concat([real, generated], 0), tags)

        # "the discriminator's weights are frozen, and the generator is trained as part of the
        # entire GAN model"
        self.train_generator()
        return {
            name: self.trackers[name].result() for name in ("discriminator_loss", "generator_loss")
        }

    def train_discriminator(self, rows: tf.Tensor, tags: tf.Tensor) -> None:
        """Updates the discriminator's weights, and no others."""
        with tf.GradientTape() as tape:
            loss = self.loss_function(tags, self.discriminator(rows, training=True))
        self.discriminator_optimizer.apply(
            tape.gradient(loss, self.discriminator_weights), self.discriminator_weights
        )
        self.trackers["discriminator_loss"].update_state(loss)

    def train_generator(self) -> None:
        """Updates the combined model, of which only the generator can be trained.

        "The tags for this pass are reversed, and the discriminator is told that the generated
        values are real."
        """
        latent = self.draw_latent(self.settings.rows)
        with tf.GradientTape() as tape:
            loss = self.loss_function(
                labels(self.settings.rows, REAL), self.combined(latent, training=True)
            )
        weights = self.combined.trainable_variables
        self.generator_optimizer.apply(tape.gradient(loss, weights), weights)
        self.trackers["generator_loss"].update_state(loss)

    def test_step(self, real: tf.Tensor) -> dict[str, tf.Tensor]:
        """Accuracy, "how many of the real and fake samples were correctly classified", and loss, on
        rows of each kind, drawn anew.
        """
        number = self.settings.rows
        real = tf.reshape(real, (number, self.settings.window, 1))
        generated = self.generator(self.draw_latent(number), training=False)
        measured = {}
        for kind, rows, tag in (("real", real, REAL), ("generated", generated, GENERATED)):
            predicted = self.discriminator(rows, training=False)
            tags = labels(number, tag)
            self.trackers[f"accuracy_{kind}"].update_state(
                keras.metrics.binary_accuracy(tags, predicted)
            )
            self.trackers[f"loss_{kind}"].update_state(self.loss_function(tags, predicted))
            measured |= {
                name: self.trackers[name].result() for name in (f"accuracy_{kind}", f"loss_{kind}")
            }
        return measured

    def draw_latent(self, number: int) -> tf.Tensor:
        """Step 7: latent vectors, normally distributed, shape `(number, latent)`."""
        return self.settings.latent_scale * keras.random.normal(
            (number, self.settings.latent), seed=self.seeds
        )


def labels(number: int, tag: float) -> tf.Tensor:
    """A column of labels."""
    return tf.fill((number, 1), tag)


def connect(
    generator: keras.Sequential, discriminator: keras.Sequential, settings: Settings
) -> NoiseGAN:
    """The compiled GAN of both networks, with "binary cross-entropy" and an Adam for each.

    With `fast`, its discriminator is another network that shares the variables of the given one,
    which is therefore trained, too.
    """
    rate = settings.gan_learning_rate
    if settings.fast:
        gan = NoiseGAN(generator, with_fast_convolution(discriminator), settings)
        optimizers = fused_adam(rate), fused_adam(rate)
    else:
        gan = NoiseGAN(generator, discriminator, settings)
        optimizers = keras.optimizers.Adam(rate), keras.optimizers.Adam(rate)
    gan.compile(*optimizers, keras.losses.BinaryCrossentropy())
    return gan


DrawRows = Callable[[int, np.random.Generator], np.ndarray]
"""Draws a number of real rows, float32 of shape `(rows, window)`."""


class Rows(keras.utils.PyDataset):
    """Batches of real rows, `steps` in an epoch, which are drawn anew each time."""

    def __init__(self, draw: DrawRows, batch_size: int, steps: int, rng: np.random.Generator):
        super().__init__()
        self.draw = draw
        self.batch_size = batch_size
        self.steps = steps
        self.rng = rng

    def __len__(self) -> int:
        return self.steps

    def __getitem__(self, index: int) -> np.ndarray:
        return self.draw(self.batch_size, self.rng)


def train_gan(
    gan: NoiseGAN,
    draw: DrawRows,
    first: int,
    last: int,
    on_record: Callable[[int], None] = lambda iteration: None,
) -> dict[str, list[float]]:
    """Step 8: trains the GAN "to create realistic environment influence", "sampled at 100-step
    intervals".

    An epoch of Keras is such an interval of `record_every` iterations, and its validation the
    sample.

    Args:
        gan: A compiled GAN.
        draw: Draws real rows.
        first: Iterations that were done before.
        last: Iterations after which training ends, a multiple of `record_every`.
        on_record: Called with the iteration at each interval.

    Returns:
        Both losses, and the discriminator's accuracy and loss on either kind of rows, at each
        interval; see `NoiseGAN.metrics`.
    """
    settings = gan.settings
    every = settings.record_every
    rows_rng, samples_rng = np.random.default_rng([settings.seed, first]).spawn(2)
    history = gan.fit(
        Rows(draw, settings.rows_of_each_kind, every, rows_rng),
        epochs=last // every,
        initial_epoch=first // every,
        validation_data=Rows(draw, settings.rows, 1, samples_rng),
        callbacks=[
            keras.callbacks.LambdaCallback(
                on_epoch_end=lambda epoch, logs: on_record((epoch + 1) * every)
            )
        ],
        shuffle=False,
        verbose=0,
    )
    # "val_": of the sample at the end of an interval; the others are means over it
    return {name.removeprefix("val_"): values for name, values in history.history.items()}


def generate_noise(
    generator: keras.Model, number: int, settings: Settings, rng: np.random.Generator
) -> np.ndarray:
    """Step 9: generates "environmental influences", float32 of shape `(number, window)`; `rng`
    draws the latent vectors.
    """
    latent = settings.latent_scale * rng.standard_normal((number, settings.latent), np.float32)
    return predict(generator, latent)[:, :, 0]
