"""Real-vs-real baselines ("floors") of all realism measures, to which generated noise is compared (evaluates section 2.3 of the paper).

The value of a measure cannot be interpreted alone, because two finite samples of the same process differ too, by an amount
that depends on the process. The floor of a measure is the distribution of its values for real windows compared with other
real windows. To estimate it, real windows are repeatedly split at random into two halves, by blocks in time, and one half is
treated as if it were generated.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common import measures as fidelity
from enhsim_tf.common import two_sample
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.window_features import DECIMALS
from studies.robustness import distances

Comparison = Callable[[np.ndarray, np.ndarray], float]


@dataclass(frozen=True)
class Measure:
    """A realism measure, which computes a description of each window and compares generated with real descriptions.

    Args:
        section: Aspect that the measure belongs to: A1 (spectrum) to A7, or `rank`.
        name: Name of the measure.
        describe: Function from windows of shape `(windows, samples)` to their descriptions, one row for each window.
        compare: Function from generated and real descriptions to the value of the measure.
        perfect: Value for perfect noise. Larger and smaller values are both worse.
        is_ratio: Whether the departure from the perfect value is computed on the logarithms.
        max_resplits: Maximum number of resamples for the real-vs-real baseline; fewer for expensive measures.
        p_value: Function from the same descriptions to a permutation p-value, or None.
    """

    section: str
    name: str
    describe: Callable[[np.ndarray], np.ndarray]
    compare: Comparison
    perfect: float = 0.0
    is_ratio: bool = False
    max_resplits: int = 200
    p_value: Comparison | None = None

    def departure(self, value: float) -> float:
        """Returns the distance of a value from the perfect value, which is at least 0."""
        return float(abs(np.log(max(value, 1e-12) / self.perfect)) if self.is_ratio else abs(value - self.perfect))


def _values(windows: np.ndarray) -> np.ndarray:
    return windows


def _products(windows: np.ndarray) -> np.ndarray:
    return fidelity.lagged_products(windows, min(50, windows.shape[1] // 2))


def _square_products(windows: np.ndarray) -> np.ndarray:
    return distances.lagged_square_products(windows, min(50, windows.shape[1] // 2))


def _rank_ratio(generated: np.ndarray, real: np.ndarray) -> float:
    return fidelity.effective_rank(generated) / fidelity.effective_rank(real)


def _boosted_auc(generated: np.ndarray, real: np.ndarray) -> float:
    return two_sample.boosted_trees(generated, real).auc


def _boosted_p(generated: np.ndarray, real: np.ndarray) -> float:
    return two_sample.boosted_trees(generated, real).p_value()


def _linear_auc(generated: np.ndarray, real: np.ndarray) -> float:
    return two_sample.linear_classifier(generated, real).auc


def _linear_p(generated: np.ndarray, real: np.ndarray) -> float:
    return two_sample.linear_classifier(generated, real).p_value()


MEASURES = (
    Measure("A1", "geodesic distance", distances.window_spectra, distances.geodesic_distance),
    Measure("A1", "log spectral distance", distances.window_spectra, distances.log_spectral_distance),
    Measure("A2", "scale difference", _values, fidelity.scale_difference),
    Measure("A2", "log scale distance", distances.log_scales, distances.log_scale_distance),
    Measure("A3", "marginal distance", _values, fidelity.marginal_distance, max_resplits=100),
    Measure("A3", "kurtosis difference", _values, distances.kurtosis_difference),
    Measure("A3", "tail ratio", _values, distances.tail_ratio, perfect=1.0, is_ratio=True),
    Measure("A4", "autocorrelation distance", _products, distances.autocorrelation_distance),
    Measure("A4", "autocorrelation distance of squares", _square_products, distances.autocorrelation_distance),
    Measure("A5", "classifier AUC, boosted trees", two_sample.window_features, _boosted_auc, 0.5, False, 20, _boosted_p),
    Measure("A5", "classifier AUC, convolutions", distances.convolution_features, _linear_auc, 0.5, False, 50, _linear_p),
    Measure("A6", "density", two_sample.window_features, distances.density, perfect=1.0, max_resplits=50),
    Measure("A6", "coverage", two_sample.window_features, distances.coverage, perfect=1 - 2.0**-5, max_resplits=50),
    Measure("A7", "MMD squared", two_sample.window_features, distances.mmd_squared, 0.0, False, 50, distances.mmd_p_value),
    Measure("rank", "effective rank ratio", _values, _rank_ratio, perfect=1.0, is_ratio=True, max_resplits=40),
)


@dataclass(frozen=True)
class Row:
    """Result of one measure for generated windows, with its real-vs-real baseline.

    Args:
        section: Aspect that the measure belongs to.
        measure: Name of the measure.
        value: Value of the measure for generated windows compared with real windows.
        departure: Distance of the value from the perfect value.
        floor_mean: Mean departure for real windows compared with real windows.
        floor_95: 95th percentile of the same departures.
        ratio: `departure` divided by `floor_mean`, which is about 1 for perfect noise.
        is_within: Whether `departure` is at most `floor_95`.
        num_resplits: Number of resamples from which the baseline was estimated.
        p_value: Permutation p-value for the two-sample tests, and NaN for all other measures.
    """

    section: str
    measure: str
    value: float
    departure: float
    floor_mean: float
    floor_95: float
    ratio: float
    is_within: bool
    num_resplits: int
    p_value: float


@dataclass(frozen=True)
class RealismReport:
    """Results of all measures for one set of generated windows.

    Args:
        rows: One `Row` for each measure.
        num_windows: Number of generated windows, and of real windows, that were compared.
    """

    rows: tuple[Row, ...]
    num_windows: int

    def __getitem__(self, measure: str) -> Row:
        """Returns the row of a measure by the name of the measure."""
        return next(row for row in self.rows if row.measure == measure)

    @property
    def worst(self) -> Row:
        """The row with the largest `ratio`."""
        return max(self.rows, key=lambda row: row.ratio)

    @property
    def verdict(self) -> str:
        """A sentence that says whether all measures lie within the 95th percentile of their baselines, and if not, which do not.

        The criterion is strict. Perfect noise exceeds the percentile of an individual measure in 5 % to 15 % of all cases; it
        is more than 5 % because the tested noise is not part of the noise that was resampled. With fifteen measures, even
        perfect noise therefore usually exceeds at least one of them. Use `worst` to see by how much.
        """
        outside = [row.measure for row in self.rows if not row.is_within]
        return f"{'distinguishable' if outside else 'indistinguishable'} at n = {self.num_windows:,}" + (
            f" by {', '.join(outside)}" if outside else ""
        )


class RealFloor:
    """Real-vs-real baselines of all measures for one kind of noise, to which generated windows are compared.

    Args:
        real: Real windows of shape `(windows, samples)`, in the order of time and without overlaps.
        later_real: The same number of other real windows, from a later time.
        num_resplits: Number of resamples. Each measure uses at most its `max_resplits`.
        block: Number of consecutive windows that stay together when the windows are split.
        seed: Seed for the resampling.
        measures: The measures.

    Raises:
        InputError: If there are fewer than 20 windows on either side, or if a value is not finite.
    """

    def __init__(
        self,
        real: np.ndarray,
        later_real: np.ndarray,
        num_resplits: int = 200,
        block: int = 10,
        seed: int = 0,
        measures: Sequence[Measure] = MEASURES,
    ):
        self.measures, self.num_windows, self.samples = tuple(measures), min(len(real), len(later_real)), np.shape(real)[1]
        self._offset, self._unit = np.mean(real, dtype=np.float64), np.std(real, dtype=np.float64)
        real, later_real = self._checked(real, "real"), self._checked(later_real, "second real")
        describe = functools.cache(lambda function: (function(real), function(later_real)))
        self._real = {measure.describe: describe(measure.describe)[0] for measure in self.measures}
        splits = list(self._resplits(num_resplits, block, np.random.default_rng(seed)))
        self.values: dict[str, np.ndarray] = {}
        for measure in self.measures:
            pooled, compare = np.concatenate(describe(measure.describe)), measure.compare
            chosen = splits[: measure.max_resplits]
            with threadpool_limits(1):  # on a busy machine, several threads that wait for each other are ten times slower
                self.values[measure.name] = np.array([compare(pooled[first], pooled[second]) for first, second in chosen])

    def evaluate(self, generated: np.ndarray) -> RealismReport:
        """Compares generated windows with the real windows.

        Args:
            generated: At least as many windows as there are real windows, of the same length and in the same unit. Additional
                windows are ignored.

        Returns:
            The results of all measures.

        Raises:
            InputError: If there are too few windows, if they have another length, or if a value is not finite.
        """
        generated = self._checked(generated, "generated")
        describe = functools.cache(lambda function: function(generated))
        rows = []
        for measure in self.measures:
            described, real = describe(measure.describe), self._real[measure.describe]
            with threadpool_limits(1):
                value = measure.compare(described, real)
            departure, floor = measure.departure(value), np.array([measure.departure(other) for other in self.values[measure.name]])
            mean, high = float(np.mean(floor)), float(np.quantile(floor, 0.95))
            p_value = measure.p_value(described, real) if measure.p_value else float("nan")
            ratio = departure / max(mean, 1e-12)
            row = Row(measure.section, measure.name, value, departure, mean, high, ratio, departure <= high, len(floor), p_value)
            rows.append(row)
        return RealismReport(tuple(rows), self.num_windows)

    def _checked(self, windows: np.ndarray, kind: str) -> np.ndarray:
        """Checks windows and returns the first `num_windows` of them, standardised by the real windows and rounded."""
        if np.ndim(windows) != 2 or len(windows) < max(20, self.num_windows) or np.shape(windows)[1] != self.samples:
            least = f"at least {max(20, self.num_windows)} {kind} windows of {self.samples} samples"
            raise InputError(f"Expected {least}. Received: shape {np.shape(windows)}.")
        if not (np.isfinite(windows).all() and self._unit > 0):
            raise InputError(f"Expected finite values that vary. Received: {kind} windows with a NaN or infinity, or all the same value.")
        standardised = (np.asarray(windows[: self.num_windows], np.float64) - self._offset) / self._unit
        return np.round(standardised, DECIMALS).astype(np.float32)

    def _resplits(self, num_resplits: int, block: int, rng: np.random.Generator):
        """Yields pairs of index arrays. Blocks in time are assigned to the halves at random; each half keeps the order of time."""
        blocks = np.array_split(np.arange(2 * self.num_windows), max(2, 2 * self.num_windows // block))
        for _ in range(num_resplits):
            order = np.concatenate([blocks[chosen] for chosen in rng.permutation(len(blocks))])
            yield np.sort(order[: self.num_windows]), np.sort(order[self.num_windows :])


def evaluate(generated: np.ndarray, real: np.ndarray, later_real: np.ndarray, num_resplits: int = 200, seed: int = 0) -> RealismReport:
    """Compares one set of generated windows with real windows. To compare several sets, create a `RealFloor` once.

    Args:
        generated: Generated windows of shape `(windows, samples)`.
        real: Real windows of the same shape, in the order of time.
        later_real: The same number of other real windows, from a later time.
        num_resplits: Maximum number of resamples of the real windows.
        seed: Seed for the resampling.

    Returns:
        The results of all measures.
    """
    return RealFloor(real, later_real, num_resplits, seed=seed).evaluate(generated)
