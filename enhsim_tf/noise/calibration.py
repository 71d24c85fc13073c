"""Calibration of predicted densities, so that each quantile is exceeded as often as it should be (after section 2.3).

If the density that a network predicts for a sample is right, the probability that the sample is below its value is uniformly distributed
(the probability integral transform). A mixture of few components cannot have every shape, for example a sharp edge or exponential tails.
How these probabilities are distributed is therefore counted on the training data; samples are drawn from the predicted density times this
distribution. It is used only where it makes held-out data more likely.

References:
    Dawid, "Present position and potential developments: some personal views: statistical theory: the prequential approach", 1984.
    Gneiting, Balabdaoui and Raftery, "Probabilistic forecasts, calibration and sharpness", 2007.
"""

import numpy as np

_NUM_BINS = 72
_REACH = 9.0  # of the edges of the bins, on the logistic scale: the bins are narrow where probabilities are near 0 and 1
_LEAST_COUNT = 100  # samples that a bin would have if the density were right
_PRIOR = 30  # samples of a right density that are added to the counts of each bin
_LEAST_GAIN = 1e-4  # of the likelihood of held-out data, in nats for each sample
_MOST = 100.0  # density: where it is high, nearly all draws are rejected
_MANY_DEGREES = 1_000  # of freedom, from which a t distribution is computed as a normal one


class Calibration:
    """A piecewise constant density of probabilities.

    Args:
        edges: Edges of the bins, from 0 to 1, increasing, shape `(bins + 1,)`.
        density: Density in each bin, positive, shape `(bins,)`; its mean over 0 to 1 is 1.

    Raises:
        ValueError: If this is no such density.
    """

    def __init__(self, edges: np.ndarray, density: np.ndarray):
        self.edges, self.density = np.asarray(edges, np.float64), np.asarray(density, np.float64)
        is_grid = self.edges.ndim == 1 and len(self.edges) > 1 and (np.diff(self.edges) > 0).all()
        if not (is_grid and self.edges[0] == 0 and self.edges[-1] == 1 and self.density.shape == (len(self.edges) - 1,)):
            raise ValueError("a calibration without bins from 0 to 1")
        if not ((self.density > 0).all() and abs(self.density @ np.diff(self.edges) - 1) < 1e-6):
            raise ValueError("a calibration that is no density")
        if self.density.max() > _MOST:
            raise ValueError("a calibration that rejects nearly all draws")
        if self.density.min() < 1 / _MOST**2:
            raise ValueError("a calibration that never accepts some draws")

    @classmethod
    def fit(cls, probabilities: np.ndarray, held_out: np.ndarray) -> "Calibration | None":
        """Counts the probabilities of training data.

        Args:
            probabilities: Predicted probability that each sample is below its value.
            held_out: The same for held-out data.

        Returns:
            The calibration, or None if it makes the held-out data no more likely, or would reject nearly all draws.
        """
        edges = 1 / (1 + np.exp(-np.linspace(-_REACH, _REACH, _NUM_BINS + 1)))
        least = _LEAST_COUNT / len(probabilities)
        kept = [0.0]
        for edge in edges:  # bins that are too narrow for the number of samples are joined
            if edge - kept[-1] >= least and 1 - edge >= least:
                kept.append(float(edge))
        edges = np.array([*kept, 1.0])
        counts, expected = np.histogram(probabilities, edges)[0] + _PRIOR, len(probabilities) * np.diff(edges) + _PRIOR
        density = counts / expected
        density /= density @ np.diff(edges)
        if density.max() > _MOST or density.min() < 1 / _MOST**2:
            return None
        found = cls(edges, density)
        return found if np.mean(np.log(found.at(held_out))) > _LEAST_GAIN else None

    def at(self, probabilities: np.ndarray) -> np.ndarray:
        """Returns the density at each probability."""
        return self.density[np.clip(np.searchsorted(self.edges, probabilities, side="right") - 1, 0, len(self.density) - 1)]

    def accept(self, probabilities: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Accepts draws from the predicted density such that the accepted ones are calibrated (rejection sampling).

        Args:
            probabilities: Predicted probability that a sample is below each draw.
            rng: Random numbers.

        Returns:
            Array of bool, of the same shape. Draws whose probability is not a number are accepted.
        """
        return (rng.random(np.shape(probabilities)) * self.density.max() < self.at(probabilities)) | np.isnan(probabilities)


def mixture_probabilities(
    values: np.ndarray, logits: np.ndarray, means: np.ndarray, log_scales: np.ndarray, degrees: np.ndarray
) -> np.ndarray:
    """Returns the probability that a mixture of t distributions is below each value.

    Args:
        values: Shape `(samples,)`.
        logits: Logarithms of the shares of the components, up to a constant; shape `(samples, components)`.
        means: Same shape.
        log_scales: Logarithms of the scales, same shape.
        degrees: Degrees of freedom, shape `(components,)`.
    """
    from scipy.special import ndtr, softmax, stdtr

    standardised = (values[:, None] - means) * np.exp(-log_scales)
    are_many = degrees > _MANY_DEGREES
    below = np.empty_like(standardised)
    below[:, are_many] = ndtr(standardised[:, are_many])
    below[:, ~are_many] = stdtr(degrees[~are_many], standardised[:, ~are_many])
    return np.sum(softmax(logits, axis=1) * below, axis=1)
