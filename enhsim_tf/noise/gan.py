"""Adversarial training of the noise generator and its discriminator (section 2.3, Figure 11; steps 7 to 9 of the pipeline).

The module works on windows of noise and does not depend on telemetry. The methods of `NoiseGAN` take and return windows of
shape `(windows, samples)`. The networks take and return the shape `(windows, samples, 1)`.
"""

from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.common.console import progress
from enhsim_tf.keras_tools.backend import keras, tf
from enhsim_tf.keras_tools.convolution_maximum import convolution_maximum, num_layers_computed
from enhsim_tf.keras_tools.fused_adam import fused_adam
from enhsim_tf.keras_tools.training import predict_windows
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.generator import build_generator
from enhsim_tf.noise.latent import Latent

Schedule = keras.optimizers.schedules.LearningRateSchedule
REAL, GENERATED = 1.0, 0.0  # the labels ("tags" in section 2.3)


class NoiseGAN:
    """Generative adversarial network (GAN) for noise, trained as in Figure 11 of the paper.

    In each iteration, the discriminator is trained on real and generated rows, and then the generator is trained through the
    frozen discriminator. The usual recipe for the second part, "compile the discriminator, set `trainable = False`, compile
    the combined model", does not work in Keras 3. There, `trainable` is read when a training step is built rather than when a
    model is compiled, so the discriminator would never be trained. Here, each update lists the weights that it changes.

    Args:
        generator: Model from shape `(rows, latent)` to `(rows, window, 1)`, see `build_generator`. None builds the paper's
            generator.
        discriminator: Model from shape `(rows, window, 1)` to `(rows, 1)`, see `build_discriminator`. None builds the paper's
            discriminator.
        batch_size: Number of real rows, and number of generated rows, in each iteration.
        learning_rate: Adam's learning rate, or a schedule of it, for both networks.
        latent_span: Standard deviation of the latent vector's elements, which are normally distributed.
        mixed_batch: Whether to update the discriminator once, on a batch of real and generated rows, instead of twice, on one
            batch of each.
        generated_in_training_mode: Whether the generator runs in training mode when it generates rows for the
            discriminator's update. This affects batch normalisation.
        scale: Unit of the noise. Noise is divided by it before it reaches the networks, and generated noise is multiplied
            by it.
        seed: Seed for all random numbers in training, and for the networks that are built here.
        slow_samples: Only for a convolutional generator: the correlation time, in samples, of each slow channel of its latent
            series. The slow channels follow the white-noise channels.
        discriminator_learning_rate: Adam's learning rate, or a schedule of it, for the discriminator, which takes two steps in
            each iteration. None uses `learning_rate`.
        beta_1: Adam's decay rate for the first moment, for both networks.
        averaging: Decay rate of a moving average of the generator's weights. At the end of training, the average replaces the
            weights. With 0, no average is computed.
    """

    def __init__(
        self,
        generator: keras.Model | None = None,
        discriminator: keras.Model | None = None,
        batch_size: int = 200,
        learning_rate: float | Schedule = 0.001,
        latent_span: float = 1.0,
        mixed_batch: bool = False,
        generated_in_training_mode: bool = False,
        scale: float = 1.0,
        seed: int = 0,
        slow_samples: Sequence[float] = (),
        discriminator_learning_rate: float | Schedule | None = None,
        beta_1: float = 0.9,
        averaging: float = 0.0,
    ):
        self.generator = build_generator(seed=seed) if generator is None else generator
        self.discriminator = build_discriminator(self.generator.output_shape[1], seed=seed) if discriminator is None else discriminator
        self.latent = Latent(self.generator, self.discriminator.input_shape[1], latent_span, slow_samples)
        self.combined = keras.Sequential([self.generator, self.discriminator], name="combined")
        self.batch_size, self.scale = batch_size, scale
        self.mixed_batch, self.generated_in_training_mode = mixed_batch, generated_in_training_mode
        self.loss = keras.losses.BinaryCrossentropy()
        averaged = {"use_ema": True, "ema_momentum": averaging} if averaging else {}
        self.discriminator_optimizer = fused_adam(discriminator_learning_rate or learning_rate, beta_1=beta_1)
        self.generator_optimizer = fused_adam(learning_rate, beta_1=beta_1, **averaged)
        self.discriminator_optimizer.build(self.discriminator.trainable_variables)
        self.generator_optimizer.build(self.generator.trainable_variables)
        self.seeds = keras.random.SeedGenerator(seed)
        self.record_seeds = keras.random.SeedGenerator(seed + 1)  # separate, so that the frequency of records does not affect training
        self._step = tf.function(self.train_step)

    def train_step(self, noise: tf.Tensor) -> None:
        """Runs one iteration of Figure 11: updates the discriminator, and then the generator through the frozen discriminator.

        Args:
            noise: All real rows, float32 of shape `(windows, window, 1)`. A batch is drawn from them.
        """
        # equal numbers of real and generated rows
        real = self._draw_rows(noise, self.seeds)
        generated = self.generator(self._draw_latent(self.seeds), training=self.generated_in_training_mode)

        # train the discriminator to distinguish them: real rows have the label 1, generated rows the label 0
        if self.mixed_batch:
            self._update_discriminator(tf.concat([real, generated], 0), tf.concat([self._tags(REAL), self._tags(GENERATED)], 0))
        else:
            self._update_discriminator(real, self._tags(REAL))
            self._update_discriminator(generated, self._tags(GENERATED))

        # train the generator through the combined model: its rows have the label 1, and only its weights are updated
        self._update_generator()

    def _update_discriminator(self, rows: tf.Tensor, tags: tf.Tensor) -> None:
        weights = self.discriminator.trainable_variables
        with tf.GradientTape(watch_accessed_variables=False) as tape:
            tape.watch([weight.value for weight in weights])
            loss = self.loss(tags, self._discriminate(rows))
        self.discriminator_optimizer.apply(tape.gradient(loss, weights), weights)

    def _update_generator(self) -> None:
        with tf.GradientTape() as tape:
            predicted = self._discriminate(self.generator(self._draw_latent(self.seeds), training=True))
            loss = self.loss(self._tags(REAL), predicted)
        weights = self.generator.trainable_variables
        self.generator_optimizer.apply(tape.gradient(loss, weights), weights)

    def _discriminate(self, rows: tf.Tensor) -> tf.Tensor:
        """Applies the discriminator in training mode, with the fast implementation of its first layers where that applies."""
        number = num_layers_computed(self.discriminator.layers)
        if not number:
            return self.discriminator(rows, training=True)
        (first, *between), rest = self.discriminator.layers[: number - 1], self.discriminator.layers[number:]
        kernel, bias = (tf.convert_to_tensor(weight) for weight in (first.kernel, first.bias))
        dropped = {"rate": between[0].rate, "seed": between[0].seed_generator.next()} if between and between[0].rate else {}
        predicted = convolution_maximum(tf.squeeze(rows, 2), tf.squeeze(kernel, 1), bias, first.strides[0], **dropped)
        for layer in rest:
            predicted = layer(predicted, training=True) if isinstance(layer, keras.layers.Dropout) else layer(predicted)
        return predicted

    def _draw_rows(self, noise: tf.Tensor, seeds: keras.random.SeedGenerator) -> tf.Tensor:
        return tf.gather(noise, keras.random.randint((self.batch_size,), 0, noise.shape[0], seed=seeds))

    def _draw_latent(self, seeds: keras.random.SeedGenerator) -> tf.Tensor:
        return self.latent.draw(self.batch_size, seeds)

    def _tags(self, tag: float) -> tf.Tensor:
        return tf.fill((self.batch_size, 1), tag)

    def fit(
        self,
        windows: np.ndarray,
        num_iterations: int = 1_000,
        record_every: int = 100,
        on_record: Callable[[int, "NoiseGAN"], None] | None = None,
        verbose: bool | None = None,
        on_iteration: Callable[[int], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Trains both networks.

        Args:
            windows: Real noise, float32 of shape `(windows, samples)`.
            num_iterations: Number of iterations, that is, of calls of `train_step`.
            record_every: Number of iterations between two records of the history.
            on_record: Called at each record with the iteration and this object.
            verbose: Whether to show a progress bar. With None, the bar is shown only on a terminal.
            on_iteration: Called after each iteration with the number of completed iterations.

        Returns:
            The history, with one element for each record. The first record is made before training. The keys are
            `iteration`, `accuracy_real`, `accuracy_generated` (share of rows that the discriminator classifies correctly),
            `loss_real` and `loss_generated` (binary cross-entropy).
        """
        noise = tf.constant(np.asarray(windows, np.float32)[:, :, None] / self.scale)
        history = []
        disable = None if verbose is None else not verbose  # with None, tqdm shows the bar only on a terminal
        with progress(total=num_iterations, desc="noise GAN", unit="iteration", disable=disable) as bar:
            for iteration in range(num_iterations + 1):
                if iteration % record_every == 0 or iteration == num_iterations:
                    history.append({"iteration": iteration, **self._evaluate(noise)})
                    if on_record is not None:
                        on_record(iteration, self)
                if iteration < num_iterations:
                    self._step(noise)
                    bar.update()
                    if on_iteration is not None:
                        on_iteration(iteration + 1)
        if num_iterations:  # with zero iterations the weight average is zero, so skip it
            self.generator_optimizer.finalize_variable_values(self.generator.trainable_variables)
        return {key: np.array([record[key] for record in history]) for key in history[0]}

    def _evaluate(self, noise: tf.Tensor) -> dict[str, float]:
        """Returns accuracy and loss of the discriminator in inference mode, on a new batch of each kind."""
        real = self._draw_rows(noise, self.record_seeds)
        generated = self.generator(self._draw_latent(self.record_seeds), training=False)
        record = {}
        for kind, rows, tag in (("real", real, REAL), ("generated", generated, GENERATED)):
            predicted = self.discriminator(rows, training=False)
            record[f"accuracy_{kind}"] = float(np.mean((np.asarray(predicted) > 0.5) == (tag == REAL)))
            record[f"loss_{kind}"] = float(self.loss(self._tags(tag), predicted))
        return record

    def generate(
        self, num_windows: int, seed: int | np.random.Generator, signal: np.ndarray | None = None, batch_size: int = 1_024
    ) -> np.ndarray:
        """Generates windows of noise (step 9 of the paper's pipeline).

        Args:
            num_windows: Number of windows.
            seed: Seed for the latent vectors, or a random number generator, whose state advances. The same seed gives the same
                noise.
            signal: The signal that the noise is added to; it has no effect.
            batch_size: Number of windows in each call of the network.

        Returns:
            float32 array of shape `(num_windows, samples)`.
        """
        latent = self.latent.sample(num_windows, np.random.default_rng(seed))
        noise = predict_windows(self.generator, latent, batch_size)[:, :, 0]
        return noise * np.float32(self.scale)

    def generate_series(self, num_samples: int, seed: int | np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Generates one series of noise of any length, without seams.

        A convolutional generator generates the series directly. Any other generator generates windows that overlap by half.
        They are cross-faded with weights whose squares sum to one, which preserves the variance of independent windows.

        The windows of the paper's generator are not independent. After the paper's 1,000 iterations, they all contain the
        same fixed pattern, which has about half of their power. A cross-faded series therefore has an autocorrelation of
        about 0.5 at multiples of half a window.

        Args:
            num_samples: Length of the series.
            seed: Seed for the latent vectors, or a random number generator, whose state advances.
            signal: The signal that the noise is added to; it has no effect.

        Returns:
            float32 array of shape `(num_samples,)`.
        """
        rng = np.random.default_rng(seed)
        if self.latent.is_series:
            chunks = self.latent.series_chunks(num_samples, rng)
            return np.concatenate([np.asarray(self.generator.predict_on_batch(each))[0, :, 0] for each in chunks]) * np.float32(self.scale)
        window = self.discriminator.input_shape[1]
        hop, num_windows = window // 2, num_overlapping(num_samples, window)
        fade = np.sin(np.pi * (np.arange(window) + 0.5) / window)  # the values of fade^2 at a distance of half a window sum to 1
        series, total = np.zeros((2, window + (num_windows - 1) * hop))
        for begin, rough in zip(hop * np.arange(num_windows), self.generate(num_windows, rng), strict=True):
            series[begin : begin + window] += fade * rough
            total[begin : begin + window] += fade**2
        return (series / np.sqrt(total))[:num_samples].astype(np.float32)

    def get_config(self) -> dict:
        """Returns the settings that `generate` needs, as JSON types."""
        return {"latent_span": self.latent.span, "slow_samples": list(self.latent.slow_samples), "scale": self.scale}


def num_overlapping(num_samples: int, window: int) -> int:
    """Returns the number of windows, each starting half a window after the previous one, that cover a series."""
    return 1 + max(0, -(-(num_samples - window) // (window // 2)))
