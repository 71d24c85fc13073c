"""Guarded training of noise networks: the weights and the outputs of the result are always finite (section 2.3).

Adversarial training may diverge, for example where the noise is zero over long stretches. The weights and the generated noise are
therefore checked while a network trains. If training diverges, it continues from the last good state with a smaller learning rate.
If that fails too, the generator is replaced by Gaussian noise with the spectrum of the real noise (`linear_noise`), which needs no
training. The checks do not affect training that does not diverge: its weights are the same to the bit.
"""

from collections.abc import Callable

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.noise.linear_noise import linear_noise

_ATTEMPTS = 3
_SLOWER = 0.25  # factor of the learning rates at each further attempt
_RECORD_EVERY = 100  # iterations between two checks
_NUM_CHECKED = 64  # windows of generated noise in a check
_MOST_SD = 10.0  # standard deviation of generated noise at the end of a training, in units of that of the real noise


class _DivergedError(Exception):
    """Raised during a training, to end it."""


class _SlowerRate(keras.optimizers.schedules.LearningRateSchedule):
    """A learning-rate schedule with a smaller rate, which begins at a later step.

    Args:
        rate: The schedule, or a constant rate.
        factor: Factor of the rate.
        done: Number of steps that were taken before.
    """

    def __init__(self, rate: float | keras.optimizers.schedules.LearningRateSchedule, factor: float, done: int):
        self.rate, self.factor, self.done = rate, factor, done

    def __call__(self, step):  # noqa: ANN001, ANN204, D102  as in Keras
        return self.factor * (self.rate(step + self.done) if callable(self.rate) else self.rate)


def train_guarded(
    build: Callable[[], NoiseGAN],
    noise_windows: np.ndarray,
    num_iterations: int,
    verbose: bool | None = None,
    on_iteration: Callable[[int], None] | None = None,
    note: Callable[[str], None] = lambda line: None,
) -> NoiseGAN:
    """Trains noise networks, or replaces them if their training diverges.

    Args:
        build: Builds the untrained networks with their optimisers. It is called once for each attempt.
        noise_windows: Real noise, float32 of shape `(windows, samples)`.
        num_iterations: Number of iterations.
        verbose: Whether to show a progress bar. With None, the bar is shown only on a terminal.
        on_iteration: Called after each iteration with the number of completed iterations.
        note: Called with one sentence for each divergence, and with one if the networks are replaced.

    Returns:
        Networks whose weights and generated noise are finite.

    Raises:
        InputError: If the real noise is not finite.
    """
    if not np.isfinite(noise_windows).all():
        raise InputError("Expected finite noise. Received: windows with NaN or infinity. Look for values far from all others.")
    real_sd = float(np.std(noise_windows, dtype=np.float64))
    if not real_sd > 0:
        note("the extracted noise is zero, so that none is generated")
        return linear_noise(noise_windows)
    good: list[list[np.ndarray]] | None = None
    done = 0
    for attempt in range(_ATTEMPTS):
        gan = build()
        if attempt:
            _slow_down(gan, _SLOWER**attempt, done)
        if good is not None:
            for network, weights in zip((gan.generator, gan.discriminator), good, strict=True):
                network.set_weights(weights)
        first, seen = done, [0]

        def check(iteration: int, trained: NoiseGAN, first: int = first, seen: list[int] = seen) -> None:
            nonlocal good, done
            seen[0] = first + iteration
            if not _is_finite(trained):
                raise _DivergedError
            good, done = [network.get_weights() for network in (trained.generator, trained.discriminator)], first + iteration

        def count(iteration: int, first: int = first) -> None:
            if on_iteration is not None:
                on_iteration(first + iteration)

        try:
            gan.fit(noise_windows, num_iterations - first, _RECORD_EVERY, check, verbose, count)
            if _is_finite(gan) and gan.generate(_NUM_CHECKED, seed=0).std(dtype=np.float64) <= _MOST_SD * real_sd:
                return gan
            good, done = None, 0  # the state after the last iteration is not good, whatever the checks before it said
            note(f"the training of the noise networks ended in noise more than {_MOST_SD:g} times too large")
        except _DivergedError:
            if done == num_iterations:
                good, done = None, 0
            note(
                f"the training of the noise networks diverged before iteration {seen[0]:,} and went on from iteration {done:,} more slowly"
            )
    note(f"{_ATTEMPTS} trainings of the noise networks diverged; the noise is Gaussian with the spectrum of the telemetry's instead")
    return linear_noise(noise_windows)


def _is_finite(gan: NoiseGAN) -> bool:
    """Whether all weights and some generated noise are finite."""
    weights = [*gan.generator.weights, *gan.discriminator.weights]
    with np.errstate(all="ignore"):
        return all(np.isfinite(np.asarray(weight)).all() for weight in weights) and np.isfinite(gan.generate(_NUM_CHECKED, seed=0)).all()


def _slow_down(gan: NoiseGAN, factor: float, done: int) -> None:
    """Multiplies the learning rates, and lets schedules go on after the iterations that were done."""
    # the discriminator takes two steps in each iteration unless both batches are mixed
    for optimizer, steps in ((gan.generator_optimizer, done), (gan.discriminator_optimizer, done if gan.mixed_batch else 2 * done)):
        rate = optimizer._learning_rate  # the schedule itself: the property evaluates it
        if isinstance(rate, keras.optimizers.schedules.LearningRateSchedule):
            optimizer._learning_rate = _SlowerRate(rate, factor, steps)
        else:
            optimizer.learning_rate = factor * float(rate)
