"""How much noise changes at several resolutions, before each sample of it (an alternative to the GAN of section 2.3).

The best prediction of noise depends on its state: how loud each of its components is, and how large the amplitude of a period. The
magnitude of the samples tells the loudness of the loudest component only. The magnitudes of the differences between neighbouring averages
(Haar wavelets) of 1, 2, 4, ... samples tell it for one octave of the spectrum each; they are averaged over the last 16, 64 and, in windows of at least 512 samples, 256 samples.

References:
    Haar, "Zur Theorie der orthogonalen Funktionensysteme", 1910.
    Mallat, "A theory for multiresolution signal decomposition: the wavelet representation", 1989.
"""

import numpy as np

from enhsim_tf.keras_tools.backend import tf

_LENGTHS = 2 ** np.arange(7)  # of the averages, in samples
_SPANS = (16, 64, 256)  # samples over which the magnitudes of the differences are averaged
LEAST_WINDOW = 2 * _SPANS[0]  # a shorter one has no changes
_TINY = 1e-3  # added to magnitudes before their logarithm is taken


class Changes:
    """Logarithms of the mean magnitudes of the differences of neighbouring averages.

    Args:
        window: Number of samples of a window; lengths above a quarter of it, and spans above half of it, are left out.
    """

    def __init__(self, window: int):
        self.lengths = _LENGTHS[4 * _LENGTHS <= window]
        self.spans = tuple(span for span in _SPANS if 2 * span <= window)
        self.size = len(self.lengths) * len(self.spans)

    def sums(self, windows: np.ndarray) -> np.ndarray:
        """Returns the sums of the magnitudes of the differences before each place of windows.

        Args:
            windows: Noise in units of its standard deviation, shape `(windows, samples)`.

        Returns:
            float32 array of shape `(windows, samples, lengths)`, zero at the first place.
        """
        total = np.pad(np.cumsum(windows, axis=1, dtype=np.float64), [(0, 0), (1, 0)])
        found = np.zeros((*windows.shape, len(self.lengths)), np.float32)
        for number, length in enumerate(self.lengths):
            magnitudes = self.magnitudes(total, np.arange(1, windows.shape[1]), length)
            found[:, 1:, number] = np.cumsum(magnitudes, axis=1)
        return found

    def magnitudes(self, total: np.ndarray, ends: np.ndarray | int, lengths: np.ndarray | int) -> np.ndarray:
        """Returns the magnitudes of differences of neighbouring averages; samples before the first one are zero.

        Args:
            total: Sums of all samples before each place, shape `(windows, samples + 1)`.
            ends: Where the second average ends; its last sample is the one before this place.
            lengths: Length of each average; of a shape that fits `ends`.
        """
        begins, middles, ends = (np.maximum(ends - number * lengths, 0) for number in (2, 1, 0))
        return np.abs(total[:, ends] - 2 * total[:, middles] + total[:, begins]) / lengths

    def before(self, sums: np.ndarray, place: int) -> np.ndarray:
        """Returns the logarithms of the mean magnitudes before a place.

        Args:
            sums: Sums of the magnitudes before each place, shape `(lengths, windows, places)`.
            place: The place.

        Returns:
            Array of shape `(windows, size)`.
        """
        begins = [max(place - span, 0) for span in self.spans]
        means = np.stack([(sums[:, :, place] - sums[:, :, begin]) / max(place - begin, 1) for begin in begins], axis=2)
        return np.log(np.moveaxis(means, 0, 1).reshape(sums.shape[1], self.size) + _TINY)

    def features(self, sums: tf.Tensor, where: tf.Tensor) -> tf.Tensor:
        """Computes the same in TensorFlow before several places.

        Args:
            sums: As returned by `sums`.
            where: The places, shape `(places,)`.

        Returns:
            Tensor of shape `(windows, places, size)`.
        """
        now, means = tf.gather(sums, where, axis=1), []
        for span in self.spans:
            begin = tf.maximum(where - span, 0)
            length = tf.cast(tf.maximum(where - begin, 1), tf.float32)[:, None]
            means.append((now - tf.gather(sums, begin, axis=1)) / length)
        logs = tf.math.log(tf.stack(means, axis=3) + _TINY)
        return tf.reshape(logs, (tf.shape(sums)[0], tf.shape(where)[0], self.size))
