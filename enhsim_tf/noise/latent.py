"""Latent inputs of a noise generator: vectors as in the paper (section 2.3), or series for a convolutional generator.

There are two implementations with the same distribution: TensorFlow operations for the training step, and NumPy for generation.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from enhsim_tf.keras_tools.backend import keras, tf

_CHUNK_SAMPLES = 100_000  # number of samples of a series that are generated at a time


def standard_normal(shape: Sequence[int], seed: tf.Tensor) -> tf.Tensor:
    """Draws from the standard normal distribution by the Box-Muller transform.

    TensorFlow's own operation computes the same transform one number at a time. The vectorised logarithm, sine and cosine
    used here take half the time, which matters because a training step of the convolutional generator draws 1.5 million
    numbers.

    Args:
        shape: Shape of the result.
        seed: Seed, an integer tensor of shape `(2,)`.

    Returns:
        float32 tensor of the given shape.
    """
    number = math.prod(shape)
    first, second = tf.unstack(tf.random.stateless_uniform((2, -(-number // 2)), seed))
    radius, angle = tf.sqrt(-2 * tf.math.log(1 - first)), 2 * math.pi * second  # 1 - first is never 0
    return tf.reshape(tf.concat([radius * tf.cos(angle), radius * tf.sin(angle)], 0)[:number], shape)


class Latent:
    """Draws latent inputs of the shape that a generator requires.

    A generator of input shape `(elements,)` receives normally distributed vectors (section 2.3 of the paper). A generator of
    input shape `(None, channels)` receives series, which consist of white-noise channels followed by slow channels. A slow
    channel is a stationary Gaussian process whose autocorrelation decays exponentially, by a factor of e in its correlation
    time. Slow channels allow the generator to produce changes over many windows, for example of the scale.

    Args:
        generator: The generator.
        window: Number of samples in a generated window.
        span: Standard deviation of the vectors and of the white-noise channels.
        slow_samples: Correlation time of each slow channel, in samples.
    """

    def __init__(self, generator: keras.Model, window: int, span: float = 1.0, slow_samples: Sequence[float] = ()):
        self.span, self.slow_samples = float(span), tuple(float(each) for each in slow_samples)
        self.is_series = len(generator.input_shape) == 3
        self._shape = tuple(generator.input_shape[1:])
        if self.is_series:
            probe = 2 * window
            self._margin = probe - generator.compute_output_shape((1, probe, self._shape[1]))[1]
            self._shape = (window + self._margin, self._shape[1])
            rate, place = 1 / np.array(self.slow_samples), np.arange(self._shape[0])[:, None]
            steps = np.where(place > 0, np.sqrt(1 - np.exp(-2 * rate)), 1.0)
            # The recursion of an AR(1) process with decay d, written as a cumulative sum: x_t = d^t * sum of s_k d^-k e_k.
            # It does not overflow, because d^-k stays below exp(samples / correlation time).
            self._rise, self._fall = (tf.constant(each, tf.float32) for each in (steps * np.exp(place * rate), np.exp(-place * rate)))

    def draw(self, num_rows: int, seeds: keras.random.SeedGenerator) -> tf.Tensor:
        """Draws latent inputs in a training step.

        Args:
            num_rows: Number of rows.
            seeds: Source of seeds, whose state advances.

        Returns:
            float32 tensor of shape `(num_rows, *input shape)`.
        """
        if not self.is_series:
            return self.span * keras.random.normal((num_rows, *self._shape), seed=seeds)
        draws = standard_normal((num_rows, *self._shape), seeds.next())
        if not self.slow_samples:
            return self.span * draws
        num_white = self._shape[1] - len(self.slow_samples)
        slow = self._fall * tf.cumsum(self._rise * draws[:, :, num_white:], axis=1)
        return tf.concat([self.span * draws[:, :, :num_white], slow], 2)

    def sample(self, num_rows: int, rng: np.random.Generator) -> np.ndarray:
        """Draws latent inputs for the generation of windows. The first rows do not depend on the number of rows.

        Args:
            num_rows: Number of rows.
            rng: Random number generator.

        Returns:
            float32 array of shape `(num_rows, *input shape)`.
        """
        return self._filter_slow_channels(rng.standard_normal((num_rows, *self._shape), np.float32))

    def series_chunks(self, num_samples: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
        """Yields the latent series for one series of noise in chunks, each of shape `(1, samples + margin, channels)`.

        The convolutions shorten each chunk by `margin` samples. Each chunk therefore starts with the last `margin` samples of
        the previous chunk, so that the generator's outputs join without seams.

        Args:
            num_samples: Length of the series of noise.
            rng: Random number generator.
        """
        before, state = np.empty((1, 0, self._shape[1]), np.float32), None
        for first in range(0, num_samples, _CHUNK_SAMPLES):
            length = min(_CHUNK_SAMPLES, num_samples - first) + self._margin - before.shape[1]
            draws = self._filter_slow_channels(rng.standard_normal((1, length, self._shape[1]), np.float32), state)
            state = draws[:, -1]
            chunk = np.concatenate([before, draws], axis=1)
            before = chunk[:, chunk.shape[1] - self._margin :]
            yield chunk

    def _filter_slow_channels(self, draws: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """Scales the white-noise channels and filters the slow channels, which continue from `state` if it is given."""
        from scipy.signal import lfilter

        num_white = self._shape[-1] - len(self.slow_samples)
        draws[..., :num_white] *= np.float32(self.span)
        for number, correlation in enumerate(self.slow_samples, num_white):
            decay = np.exp(-1 / correlation)
            steps = np.sqrt(1 - decay**2) * draws[:, :, number]
            steps[:, 0] = draws[:, 0, number] if state is None else steps[:, 0] + decay * state[:, number]
            draws[:, :, number] = lfilter([1.0], [1.0, -decay], steps, axis=1)
        return draws
