"""Section 2.3: the noise of the environment, and the second network, a GAN that learns to generate it.

"In this approach, noise is trained independently using Generative Adversarial Neural Networks (GANs)."
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.fast_keras import fused_adam, with_fast_convolution
from enhsim_tf.paper.enhancer import initialiser, predict
from enhsim_tf.paper.settings import Settings

REAL, GENERATED = 1.0, 0.0
"""Labels: "Real data has a tag of 1.0, while generated data has a tag of 0.0." """


def extract_noise(
    values: np.ndarray, width: int, average: str = "centred"
) -> tuple[np.ndarray, np.ndarray]:
    """Step 6: the noise of a series, which is the series minus its moving average.

    "This average is subtracted from the original signal, leaving the noise." The paper cites the rolling mean of pandas. Samples
    without a full average are cut.

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

    "The 16-element latent vector is densely connected to a layer of 64 neurons. These are then normalized and spread to a layer of 500
    neurons, the number of samples in the time series. This layer is reshaped to be compatible as the input layer of the discriminator."

    Returns:
        A network from `(rows, 16)` to `(rows, window, 1)`.
    """
    first, last = (
        initialiser(settings, "he_uniform", 100),
        initialiser(settings, "glorot_uniform", 101),
    )
    return keras.Sequential(
        [
            keras.Input((settings.latent,)),
            keras.layers.Dense(settings.generator_units, "relu", kernel_initializer=first),
            keras.layers.BatchNormalization(),
            keras.layers.Dense(
                settings.window, settings.generator_activation, kernel_initializer=last
            ),
            keras.layers.Reshape((settings.window, 1)),
        ],
        name="generator",
    )


def build_discriminator(settings: Settings) -> keras.Sequential:
    """Builds the discriminator of Figure 10: a convolution, pooled by its maximum, and layers that narrow to one neuron.

    "One convolutional layer that merges input from 4 rows of inputs using a window 20 neurons wide with a stride of 4 neurons per step. This
    layer pools each convolution based on the maximum value of the sample." (What the 4 rows are is open.) "The layers are progressively
    narrowed to the final single neuron who's value determines if the input is considered real or fake." Dropout, relu and the number of
    filters are those of the author's code.

    Returns:
        A network from `(rows, window, 1)` to `(rows, 1)`, the probability that a row is real.
    """
    kernels = [
        initialiser(settings, name, number)
        for number, name in ((200, "glorot_uniform"), (201, "he_uniform"), (202, "glorot_uniform"))
    ]
    dropouts = [
        [keras.layers.Dropout(settings.dropout, seed=1_000 * settings.seed + number)]
        for number in (300, 301)
    ]
    after_convolution, after_narrow = dropouts if settings.dropout else ([], [])
    return keras.Sequential(
        [
            keras.Input((settings.window, 1)),
            keras.layers.Conv1D(
                settings.filters,
                settings.filter_width,
                settings.stride,
                activation="relu",
                kernel_initializer=kernels[0],
            ),
            *after_convolution,
            keras.layers.GlobalMaxPooling1D(),
            keras.layers.Dense(settings.narrow_units, "relu", kernel_initializer=kernels[1]),
            *after_narrow,
            keras.layers.Dense(1, "sigmoid", kernel_initializer=kernels[2]),
        ],
        name="discriminator",
    )


class NoiseGAN(keras.Model):
    """The GAN of Figure 11, "created by connecting the discriminator and generator networks together".

    Keras 2 remembered at `compile` which weights could be trained. Keras 3 looks when a training step is built, so the usual recipe
    (compile the discriminator, set `trainable = False`, compile the combined model) never trains the discriminator. Here, the
    discriminator's weights are listed before it is frozen.

    Args:
        generator: The network of `build_generator`.
        discriminator: The network of `build_discriminator`.
        settings: All settings. With `fast`, `self.discriminator` is another network with the same weights.
    """

    def __init__(self, generator: keras.Model, discriminator: keras.Model, settings: Settings):
        super().__init__(name="noise_gan")
        self.settings, self.generator = settings, generator
        self.discriminator = (
            with_fast_convolution(discriminator) if settings.fast else discriminator
        )
        self.discriminator_weights = list(self.discriminator.trainable_variables)
        self.discriminator.trainable = False
        self.combined = keras.Sequential([generator, self.discriminator], name="combined")
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

    def compile(self) -> None:
        """Sets the loss, binary cross-entropy, and an Adam optimizer for each network."""
        super().compile(optimizer=None, jit_compile=False)
        adam = fused_adam if self.settings.fast else keras.optimizers.Adam
        self.discriminator_adam, self.generator_adam = (
            adam(self.settings.gan_learning_rate) for _ in range(2)
        )
        self.loss_function = keras.losses.BinaryCrossentropy()

    @property
    def metrics(self) -> list[keras.metrics.Metric]:
        """Losses of the two updates, and accuracy and loss on real and on generated rows, which `test_step` measures."""
        return list(self.trackers.values())

    def train_step(self, real: tf.Tensor) -> dict[str, tf.Tensor]:
        """One iteration: "the training of the discriminator, and the training of the generator".

        Args:
            real: Real rows, float32 of shape `(rows_of_each_kind, window)`.
        """
        # "the discriminator as a standalone model is fed with equal amounts of data from the real data set and the generated data set"
        number = self.settings.rows_of_each_kind
        real = tf.reshape(real, (number, self.settings.window, 1))
        generated = self.generator(self.draw_latent(number), training=False)

        # "It then trains on the entire batch (200 rows) of real and generated data."
        if self.settings.update == "two of 200":  # the author's code
            self.train_discriminator(real, labels(number, REAL))
            self.train_discriminator(generated, labels(number, GENERATED))
        else:
            both = tf.concat([labels(number, REAL), labels(number, GENERATED)], 0)
            self.train_discriminator(tf.concat([real, generated], 0), both)

        # "the discriminator's weights are frozen, and the generator is trained as part of the entire GAN model"
        self.train_generator()
        return {
            name: self.trackers[name].result() for name in ("discriminator_loss", "generator_loss")
        }

    def train_discriminator(self, rows: tf.Tensor, tags: tf.Tensor) -> None:
        """Updates the discriminator's weights, and no others."""
        with tf.GradientTape() as tape:
            loss = self.loss_function(tags, self.discriminator(rows, training=True))
        self.discriminator_adam.apply(
            tape.gradient(loss, self.discriminator_weights), self.discriminator_weights
        )
        self.trackers["discriminator_loss"].update_state(loss)

    def train_generator(self) -> None:
        """Updates the combined model, of which only the generator can be trained.

        "The tags for this pass are reversed, and the discriminator is told that the generated values are real."
        """
        latent = self.draw_latent(self.settings.rows)
        with tf.GradientTape() as tape:
            loss = self.loss_function(
                labels(self.settings.rows, REAL), self.combined(latent, training=True)
            )
        weights = self.combined.trainable_variables
        self.generator_adam.apply(tape.gradient(loss, weights), weights)
        self.trackers["generator_loss"].update_state(loss)

    def test_step(self, real: tf.Tensor) -> dict[str, tf.Tensor]:
        """Accuracy, "how many of the real and fake samples were correctly classified", and loss, on rows of each kind, drawn anew."""
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


class Rows(keras.utils.PyDataset):
    """Batches of rows, `steps` in an epoch, that are drawn at random from all real rows, float32 of shape `(rows, window)`."""

    def __init__(self, noise: np.ndarray, batch_size: int, steps: int, rng: np.random.Generator):
        super().__init__()
        self.noise, self.batch_size, self.steps, self.rng = noise, batch_size, steps, rng

    def __len__(self) -> int:
        return self.steps

    def __getitem__(self, index: int) -> np.ndarray:
        return self.noise[self.rng.integers(0, len(self.noise), self.batch_size)]


def train_gan(
    gan: NoiseGAN,
    noise: np.ndarray,
    first: int,
    last: int,
    on_record: Callable[[int], None] = lambda iteration: None,
) -> dict[str, list[float]]:
    """Step 8: trains the GAN "to create realistic environment influence", "sampled at 100-step intervals".

    An epoch of Keras is such an interval of `record_every` iterations, and its validation the sample.

    Args:
        gan: A compiled GAN.
        noise: Real rows, float32 of shape `(rows, window)`.
        first: Iterations that were done before.
        last: Iterations after which training ends, a multiple of `record_every`.
        on_record: Called with the iteration at each interval.

    Returns:
        Accuracy and loss of the discriminator at each interval; see `NoiseGAN.metrics`.
    """
    settings, every = gan.settings, gan.settings.record_every
    draws, samples = np.random.default_rng([settings.seed, first]).spawn(2)
    history = gan.fit(
        Rows(noise, settings.rows_of_each_kind, every, draws),
        epochs=last // every,
        initial_epoch=first // every,
        validation_data=Rows(noise, settings.rows, 1, samples),
        callbacks=[
            keras.callbacks.LambdaCallback(
                on_epoch_end=lambda epoch, logs: on_record((epoch + 1) * every)
            )
        ],
        shuffle=False,
        verbose=0,
    )
    return {name.removeprefix("val_"): values for name, values in history.history.items()}


def generate_noise(
    generator: keras.Model, number: int, settings: Settings, rng: np.random.Generator
) -> np.ndarray:
    """Step 9: generates "environmental influences", float32 of shape `(number, window)`; `rng` draws the latent vectors."""
    latent = settings.latent_scale * rng.standard_normal((number, settings.latent), np.float32)
    return predict(generator, latent)[:, :, 0]
