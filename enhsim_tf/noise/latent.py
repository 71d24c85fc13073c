"""What a generator of noise starts from: latent vectors as in the paper, or latent series for one that convolves.

Each is drawn in two ways that have the same distribution: inside a training step, and by NumPy for generating.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from enhsim_tf.keras_tools.backend import keras, tf

_CHUNK_SAMPLES = 100_000  # samples of a series made at a time


def standard_normal(shape: Sequence[int], seed: tf.Tensor) -> tf.Tensor:
    """Draws from the standard normal distribution by the Box-Muller transform, float32 of the given shape.

    TensorFlow's own operation computes the same transform number by number; here logarithm, sine and cosine are those of
    whole arrays, which takes half the time. A training step of the convolutional generator draws 1.5 million numbers.

    Args:
        shape: Shape of the draws.
        seed: Two integers.
    """
    number = math.prod(shape)
    first, second = tf.unstack(tf.random.stateless_uniform((2, -(-number // 2)), seed))
    radius, angle = tf.sqrt(-2 * tf.math.log(1 - first)), 2 * math.pi * second  # 1 - first is never 0
    return tf.reshape(tf.concat([radius * tf.cos(angle), radius * tf.sin(angle)], 0)[:number], shape)


class Latent:
    """Latent draws of the shape that a generator takes.

    A generator of input shape `(elements,)` gets standard normal vectors (paper, section 2.3). One of input shape
    `(None, channels)` gets series: white channels, then slow ones, each a stationary Gaussian process whose correlation
    falls by e in its own number of samples. From a slow channel comes what changes over many windows, such as the scale.

    Args:
        generator: The generator.
        window: Samples of a window that it makes.
        span: White draws are standard normal times this.
        slow_samples: Correlation time of each slow channel in samples.
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
            # x_t = d^t sum of s_k d^-k e_k: a sum in place of a recursion; d^-k stays below exp(samples / correlation)
            self._rise, self._fall = (tf.constant(each, tf.float32) for each in (steps * np.exp(place * rate), np.exp(-place * rate)))

    def draw(self, num_rows: int, seeds: keras.random.SeedGenerator) -> tf.Tensor:
        """Draws for a training step, of shape `(num_rows, *input shape)`."""
        if not self.is_series:
            return self.span * keras.random.normal((num_rows, *self._shape), seed=seeds)
        draws = standard_normal((num_rows, *self._shape), seeds.next())
        if not self.slow_samples:
            return self.span * draws
        num_white = self._shape[1] - len(self.slow_samples)
        slow = self._fall * tf.cumsum(self._rise * draws[:, :, num_white:], axis=1)
        return tf.concat([self.span * draws[:, :, :num_white], slow], 2)

    def sample(self, num_rows: int, rng: np.random.Generator) -> np.ndarray:
        """Draws for generating windows, float32 of shape `(num_rows, *input shape)`, row after row."""
        return self._filter_slow_channels(rng.standard_normal((num_rows, *self._shape), np.float32))

    def series_chunks(self, num_samples: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
        """Yields the latent series for a series of noise, stretch after stretch, each of shape `(1, samples + margin, channels)`.

        A stretch begins with the last samples of the one before, as many as the generator consumes: its outputs join
        as if they had been made in one piece.
        """
        before, state = np.empty((1, 0, self._shape[1]), np.float32), None
        for first in range(0, num_samples, _CHUNK_SAMPLES):
            length = min(_CHUNK_SAMPLES, num_samples - first) + self._margin - before.shape[1]
            draws = self._filter_slow_channels(rng.standard_normal((1, length, self._shape[1]), np.float32), state)
            state = draws[:, -1]
            stretch = np.concatenate([before, draws], axis=1)
            before = stretch[:, stretch.shape[1] - self._margin :]
            yield stretch

    def _filter_slow_channels(self, draws: np.ndarray, state: np.ndarray | None = None) -> np.ndarray:
        """White channels times the span, and the slow ones as they go on from their last values, or anew."""
        from scipy.signal import lfilter

        num_white = self._shape[-1] - len(self.slow_samples)
        draws[..., :num_white] *= np.float32(self.span)
        for number, correlation in enumerate(self.slow_samples, num_white):
            decay = np.exp(-1 / correlation)
            steps = np.sqrt(1 - decay**2) * draws[:, :, number]
            steps[:, 0] = draws[:, 0, number] if state is None else steps[:, 0] + decay * state[:, number]
            draws[:, :, number] = lfilter([1.0], [1.0, -decay], steps, axis=1)
        return draws
