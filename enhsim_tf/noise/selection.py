"""Selection of generated windows by how much more often such windows are real than generated (an extension of section 2.3).

A model that predicts one sample at a time can be nearly right for each sample and still be off for whole windows: the amplitude of a period
wanders too far, or quiet stretches are too rare. A classifier of whole windows sees this. A logistic regression tells real from generated
windows by spectra at up to three resolutions, quantiles, and how loudness and level vary; its odds estimate how much more often a window is
real than generated. A window is then drawn from a few candidates in proportion to these odds (sampling importance resampling). The penalty of
the regression is chosen on held-out blocks of time, and without a gain there that is beyond chance nothing is selected.

The odds are those of a window alone. The windows of a long series continue one another, and noise may follow a signal, which the regression
does not see: there, the selection is a heuristic that moves the noise in the right direction, but not all the way.

Some of the statistics, for example the loudness, are also among those by which `realism` judges generated noise, or are nearly equal to them.

References:
    Rubin, "A noniterative sampling/importance resampling alternative to the data augmentation algorithm", 1987.
    Donsker and Varadhan, "Asymptotic evaluation of certain Markov process expectations for large time", 1975.
    Azadi et al., "Discriminator rejection sampling", 2019.
"""

from collections.abc import Callable, Mapping

import numpy as np

from enhsim_tf.noise.block_means import NUM_BLOCKS, margin
from enhsim_tf.realism.window_features import DECIMALS
from enhsim_tf.telemetry.windows import disjoint_rows, time_blocks

NUM_CANDIDATES = 4
LEAST_WINDOW = 64  # samples; shorter windows have no spectra at several resolutions
LEAST_DISJOINT = 200  # windows of the telemetry, below which nothing is selected: twenty in each held-out block
_PENALTIES = (10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01)  # of the squared weights of standardised features
_DIVISORS = (1, 4, 16)  # of a window: the lengths of the segments whose spectra are seen
_LEAST_SEGMENT = 16  # samples
_BANDS_PER_OCTAVE = 4 / 3
_QUANTILES = (0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
_LARGEST = (1, 5, 25)  # ranks among the magnitudes of a window
_CONSTANT = 1e-3  # standard deviation up to which a feature counts as constant
_CLIP = 4.0  # largest standardised feature, in standard deviations: rare windows get no extreme odds
_TINY_POWER, _TINY = 1e-6, 1e-3  # added to powers and magnitudes before their logarithm is taken
_MOST_GENERATED = 6_000  # windows that the regression learns from


class Selection:
    """The logarithm of how much more often a window is real than generated, up to a constant.

    Args:
        centre: Mean of each feature of real windows, shape `(features,)`.
        spread: Standard deviation of each, same shape.
        weights: Weights of the standardised features and of their squares, shape `(2 * features,)`.

    Raises:
        ValueError: If the shapes differ, or a standard deviation is not positive.
    """

    def __init__(self, centre: np.ndarray, spread: np.ndarray, weights: np.ndarray):
        self.centre, self.spread, self.weights = (np.asarray(each, np.float64) for each in (centre, spread, weights))
        if not (self.centre.ndim == 1 and self.centre.shape == self.spread.shape and self.weights.shape == (2 * len(self.centre),)):
            raise ValueError("a selection whose numbers do not belong together")
        if not (self.spread > 0).all():
            raise ValueError("a selection with a feature that does not vary")

    @classmethod
    def fit(cls, real: np.ndarray, generate: Callable[[np.ndarray], np.ndarray], starts: np.ndarray | None = None) -> "Selection | None":
        """Fits the regression with the penalty that gains most on held-out blocks of time, after the margin of chance is subtracted.

        The gain is the lower bound of Donsker and Varadhan on the Kullback-Leibler divergence of generated from real windows: by so much
        the divergence falls if generated windows are weighted with the odds. It is computed for each block; the margin is
        two standard errors of the mean over the blocks (`block_means`).

        Args:
            real: Real windows in units of their standard deviation, shape `(windows, samples)`.
            generate: Generates windows, in the same unit, for the signal below the given real windows.
            starts: First sample of each real window, shape `(windows,)`. None: no two overlap, and they are in the order of time.

        Returns:
            The selection, or None if no penalty has a gain beyond chance, or there is too little telemetry to judge.
        """
        window = real.shape[1]
        starts = window * np.arange(len(real)) if starts is None else starts
        if window < LEAST_WINDOW or len(disjoint_rows(starts, window)) < LEAST_DISJOINT:
            return None
        generated = generate(np.linspace(0, len(real) - 1, min(len(real), _MOST_GENERATED)).astype(int))
        features = window_statistics(real)
        spread = np.std(features, axis=0)
        plain = cls(np.mean(features, axis=0), np.where(spread > _CONSTANT, spread, 1), np.zeros(2 * features.shape[1]))
        wanted, had = plain._expand(features), plain._expand(window_statistics(generated))
        blocks, folds = time_blocks(starts, NUM_BLOCKS, window), np.arange(len(had)) % NUM_BLOCKS
        best, chosen = 0.0, None
        for penalty in _PENALTIES:
            gains = []
            for number, (training, held_out) in enumerate(blocks):
                weights = _regress(wanted[training], had[folds != number], penalty)
                gains.append(_gain(wanted[held_out] @ weights, had[folds == number] @ weights))
            surely = float(np.mean(gains)) - margin(gains)
            if surely > best:
                best, chosen = surely, penalty
        return None if chosen is None else cls(plain.centre, plain.spread, _regress(wanted, had, chosen))

    def choose(self, candidates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws one of several candidates for each window, in proportion to their odds.

        Args:
            candidates: In units of the standard deviation of real windows, shape `(windows, candidates, samples)`.
            rng: Random numbers.

        Returns:
            The number of the chosen candidate of each window, shape `(windows,)`.
        """
        number, each, samples = candidates.shape
        logs = (self._expand(window_statistics(candidates.reshape(-1, samples))) @ self.weights).reshape(number, each)
        return np.argmax(logs + rng.gumbel(size=logs.shape), axis=1)  # the largest sum with Gumbel noise is a draw in proportion

    def _expand(self, features: np.ndarray) -> np.ndarray:
        standardised = np.clip((features - self.centre) / self.spread, -_CLIP, _CLIP)
        return np.concatenate([standardised, standardised**2 - 1], axis=1)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """What is saved."""
        return {"centre": self.centre, "spread": self.spread, "weights": self.weights}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], window: int) -> "Selection":
        """Makes the selection again from `arrays`.

        Raises:
            ValueError: If the arrays do not belong to windows of this length.
        """
        found = cls(*(arrays[name] for name in ("centre", "spread", "weights")))
        if window < LEAST_WINDOW or window_statistics(np.zeros((1, window))).shape[1] != len(found.centre):
            raise ValueError("a selection that does not belong to this window")
        return found


def window_statistics(windows: np.ndarray) -> np.ndarray:
    """Computes what the regression sees of each window.

    Spectra are Hann-tapered periodograms of segments of a whole, a quarter and a sixteenth of a window, in bands of about two thirds of
    an octave: the mean logarithm over the segments, and its standard deviation. Of the loudness and the level of the segments, the features
    are the extremes and how much they vary. Further features are quantiles, large magnitudes, and the loudness of values and steps.

    Args:
        windows: Shape `(windows, samples)`, at least `LEAST_WINDOW` samples, in units of the standard deviation of real windows.

    Returns:
        float64 array of shape `(windows, features)`.
    """
    values = np.round(np.asarray(windows, np.float32), DECIMALS)
    samples = values.shape[1]
    columns = []
    for length in (samples // divisor for divisor in _DIVISORS if samples // divisor >= _LEAST_SEGMENT):
        segments = values[:, : samples // length * length].reshape(len(values), -1, length)
        powers = _band_powers(segments)
        columns.append(powers.mean(axis=1))
        if segments.shape[1] > 1:
            columns.append(powers.std(axis=1))
            loudness, level = np.log(segments.std(axis=2) + _TINY), segments.mean(axis=2)
            for each in (loudness, level):
                varies = np.log(np.stack([each.std(axis=1), np.mean(np.abs(np.diff(each, axis=1)), axis=1)], axis=1) + _TINY)
                columns += [each.min(axis=1)[:, None], each.max(axis=1)[:, None], varies]
    columns.append(np.quantile(values, _QUANTILES, axis=1).T)
    magnitudes = np.sort(np.abs(values), axis=1)
    columns.append(np.log(magnitudes[:, [*(-rank for rank in _LARGEST), samples // 2]] + _TINY))
    columns.append(np.log(np.stack([values.std(axis=1), np.diff(values, axis=1).std(axis=1)], axis=1) + _TINY))
    return np.concatenate(columns, axis=1, dtype=np.float64)


def _band_powers(segments: np.ndarray) -> np.ndarray:
    """Returns the logarithm of the mean power of each segment in each band, shape `(windows, segments, bands)`."""
    length = segments.shape[2]
    taper = np.hanning(length + 2)[1:-1].astype(np.float32)
    power = np.abs(np.fft.rfft(segments * taper, axis=2)) ** 2 / np.sum(taper**2)
    edges = np.geomspace(1, power.shape[2], 1 + round(_BANDS_PER_OCTAVE * np.log2(length)))
    edges = np.unique(np.concatenate([[0, 1], np.rint(edges).astype(int)]))
    return np.log(np.add.reduceat(power, edges[:-1], axis=2) / np.diff(edges) + _TINY_POWER)


def _regress(real: np.ndarray, generated: np.ndarray, penalty: float) -> np.ndarray:
    """Returns the weights of a logistic regression in which both kinds weigh the same."""
    from sklearn.linear_model import LogisticRegression
    from threadpoolctl import threadpool_limits

    rows, kinds = np.concatenate([real, generated]), np.repeat([1, 0], [len(real), len(generated)])
    with threadpool_limits(1):
        model = LogisticRegression(C=1 / (penalty * len(rows)), class_weight="balanced", solver="newton-cholesky", max_iter=50)
        return model.fit(rows, kinds).coef_[0]


def _gain(real: np.ndarray, generated: np.ndarray) -> float:
    """Returns by how much weights lower the divergence of generated from real windows, in nats for each window.

    Args:
        real: Logarithms of the weights of real windows.
        generated: Logarithms of the weights of generated windows.
    """
    from scipy.special import logsumexp

    return float(np.mean(real) - (logsumexp(generated) - np.log(len(generated))))
