"""Network two, steps 7 to 9 of the paper's pipeline: an adversarial pair that learns noise (section 2.3).

It knows windows of noise and nothing of telemetry. Outside, windows have the shape `(windows, samples)`; between the
two networks `(windows, samples, 1)`.
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
REAL, GENERATED = 1.0, 0.0  # the tags of section 2.3


class NoiseGAN:
    """The generator and the discriminator, trained against each other (paper, Figure 11).

    Keras 3 reads `trainable` when a training step is built, not when a model is compiled; "compile, freeze, compile the
    stack" therefore freezes the discriminator for ever. Here each step names the weights it moves, so "frozen" means
    what the paper means.

    Args:
        generator: From `(rows, latent)` to `(rows, window, 1)`, as `build_generator` makes it; None builds the paper's.
        discriminator: From `(rows, window, 1)` to `(rows, 1)`, as `build_discriminator` makes it; None builds the paper's.
        batch_size: Rows of real and rows of generated noise a step.
        learning_rate: Adam's learning rate or a schedule of it, for both networks.
        latent_span: The latent vector is standard normal times this.
        mixed_batch: One discriminator update on real and generated rows together, instead of two in turn.
        generated_in_training_mode: Whether the rows shown to the discriminator come from batch normalisation in training
            mode instead of inference mode.
        scale: The noise is divided by this for the networks and multiplied by it afterwards.
        seed: Seed of every draw in training, and of the networks built here.
        slow_samples: For a generator that convolves: correlation time, in samples, of each slow channel of its latent
            series; they come after the white channels.
        discriminator_learning_rate: Adam's learning rate for the discriminator, which takes two steps an iteration; None
            for the same.
        beta_1: Adam's decay of the first moment, for both networks.
        averaging: Decay of a moving average over the generator's weights, which takes their place when training ends;
            0 for none.
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
        self.record_seeds = keras.random.SeedGenerator(seed + 1)  # of their own: recording more often changes no training
        self._step = tf.function(self.train_step)

    def train_step(self, noise: tf.Tensor) -> None:
        """One iteration of Figure 11: the discriminator learns, then the generator through the frozen discriminator.

        Args:
            noise: All real rows, float32 of shape `(windows, window, 1)`; a batch is drawn from them.
        """
        # equal amounts of real and generated rows
        real = self._draw_rows(noise, self.seeds)
        generated = self.generator(self._draw_latent(self.seeds), training=self.generated_in_training_mode)

        # the discriminator learns to tell them apart: real rows are tagged 1, generated rows 0
        if self.mixed_batch:
            self._update_discriminator(tf.concat([real, generated], 0), tf.concat([self._tags(REAL), self._tags(GENERATED)], 0))
        else:
            self._update_discriminator(real, self._tags(REAL))
            self._update_discriminator(generated, self._tags(GENERATED))

        # the generator learns through the combined model: the tags are reversed, only its own weights move
        self._update_generator()

    def _update_discriminator(self, rows: tf.Tensor, tags: tf.Tensor) -> None:
        weights = self.discriminator.trainable_variables
        with tf.GradientTape(watch_accessed_variables=False) as tape:
            tape.watch([weight.value for weight in weights])
            loss = self.loss(tags, self._discriminate(rows))
        self.discriminator_optimizer.apply(tape.gradient(loss, weights), weights)

    def _update_generator(self) -> None:
        with tf.GradientTape() as tape:
            judged = self._discriminate(self.generator(self._draw_latent(self.seeds), training=True))
            loss = self.loss(self._tags(REAL), judged)
        weights = self.generator.trainable_variables
        self.generator_optimizer.apply(tape.gradient(loss, weights), weights)

    def _discriminate(self, rows: tf.Tensor) -> tf.Tensor:
        """The discriminator in training mode, its first layers by the fast path where they are what that computes."""
        number = num_layers_computed(self.discriminator.layers)
        if not number:
            return self.discriminator(rows, training=True)
        (first, *between), rest = self.discriminator.layers[: number - 1], self.discriminator.layers[number:]
        kernel, bias = (tf.convert_to_tensor(weight) for weight in (first.kernel, first.bias))
        dropped = {"rate": between[0].rate, "seed": between[0].seed_generator.next()} if between and between[0].rate else {}
        judged = convolution_maximum(tf.squeeze(rows, 2), tf.squeeze(kernel, 1), bias, first.strides[0], **dropped)
        for layer in rest:
            judged = layer(judged, training=True) if isinstance(layer, keras.layers.Dropout) else layer(judged)
        return judged

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
            num_iterations: Iterations of `train_step`.
            record_every: Iterations between two records.
            on_record: Called with the iteration and this object at each record.
            verbose: Whether to show a progress bar; None shows one on a terminal only.
            on_iteration: Called after each iteration with how many are done.

        Returns:
            The history, one entry a record, the first before training: `iteration`, and for `real` and `generated` rows
            `accuracy_*` (share judged rightly) and `loss_*` (binary cross-entropy).
        """
        noise = tf.constant(np.asarray(windows, np.float32)[:, :, None] / self.scale)
        history = []
        disable = None if verbose is None else not verbose  # None: tqdm looks whether there is a terminal
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
        if num_iterations:  # the average over no iterations is nought
            self.generator_optimizer.finalize_variable_values(self.generator.trainable_variables)
        return {key: np.array([record[key] for record in history]) for key in history[0]}

    def _evaluate(self, noise: tf.Tensor) -> dict[str, float]:
        """Accuracy and loss of the discriminator on a fresh batch of each kind, in inference mode."""
        real = self._draw_rows(noise, self.record_seeds)
        generated = self.generator(self._draw_latent(self.record_seeds), training=False)
        record = {}
        for kind, rows, tag in (("real", real, REAL), ("generated", generated, GENERATED)):
            judged = self.discriminator(rows, training=False)
            record[f"accuracy_{kind}"] = float(np.mean((np.asarray(judged) > 0.5) == (tag == REAL)))
            record[f"loss_{kind}"] = float(self.loss(self._tags(tag), judged))
        return record

    def generate(self, num_windows: int, seed: int | np.random.Generator, batch_size: int = 1_024) -> np.ndarray:
        """Generates noise (step 9), float32 of shape `(num_windows, samples)`; the same seed gives the same.

        Args:
            num_windows: Number of windows.
            seed: Seed of the latent vectors, or a generator that draws them and goes on from where it stands.
            batch_size: Windows a call of the network.
        """
        latent = self.latent.sample(num_windows, np.random.default_rng(seed))
        noise = predict_windows(self.generator, latent, batch_size)[:, :, 0]
        return noise * np.float32(self.scale)

    def generate_series(self, num_samples: int, seed: int | np.random.Generator) -> np.ndarray:
        """Generates one series of noise of any length, without seams, float32 of shape `(num_samples,)`.

        A generator that convolves makes it in one piece. Any other makes windows: those that overlap by half are faded into
        each other with weights whose squares add up to one, so that the variance of independent windows stays.

        The paper's generator repeats itself: after the paper's 1,000 iterations all of its windows hold one fixed pattern,
        about half of their power, so that the series correlates at about 0.5 with itself every half window.

        Args:
            num_samples: Length of the series.
            seed: Seed of the latent vectors, or a generator that draws them.
        """
        rng = np.random.default_rng(seed)
        if self.latent.is_series:
            stretches = self.latent.series_chunks(num_samples, rng)
            return np.concatenate([np.asarray(self.generator.predict_on_batch(each))[0, :, 0] for each in stretches]) * np.float32(
                self.scale
            )
        window = self.discriminator.input_shape[1]
        hop, num_windows = window // 2, num_overlapping(num_samples, window)
        fade = np.sin(np.pi * (np.arange(window) + 0.5) / window)  # fade^2 of two windows half a window apart adds up to 1
        series, total = np.zeros((2, window + (num_windows - 1) * hop))
        for begin, rough in zip(hop * np.arange(num_windows), self.generate(num_windows, rng), strict=True):
            series[begin : begin + window] += fade * rough
            total[begin : begin + window] += fade**2
        return (series / np.sqrt(total))[:num_samples].astype(np.float32)

    def get_config(self) -> dict:
        """The settings that `generate` needs, as plain JSON types."""
        return {"latent_span": self.latent.span, "slow_samples": list(self.latent.slow_samples), "scale": self.scale}


def num_overlapping(num_samples: int, window: int) -> int:
    """How many windows, each half a window after the one before, cover a series."""
    return 1 + max(0, -(-(num_samples - window) // (window // 2)))
