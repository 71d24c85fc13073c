"""Is generated noise realistic? Every measure of `fidelity` and `two_sample`, each beside its real-against-real floor.

A value means nothing alone: two finite samples of one process differ too, and by how much depends on the process. So real
windows are split in two, by blocks in time, again and again, and each split is measured as if one half were generated.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.common.errors import InputError
from enhsim_tf.realism import measures as fidelity
from enhsim_tf.realism import two_sample

Comparison = Callable[[np.ndarray, np.ndarray], float]


@dataclass(frozen=True)
class Measure:
    """One measure: a comparison of what is described of each generated and each real window.

    Args:
        section: Which aspect it belongs to, A1 (spectrum) to A7, or `rank`.
        name: Its name.
        describe: From windows of shape `(windows, samples)` to as many rows.
        compare: From generated and real rows to the value.
        perfect: The value of perfect noise; larger and smaller ones are both worse.
        is_ratio: Whether the departure from perfect is that of the logarithm.
        max_resplits: Re-splits that its floor is worth at most: the dear ones take fewer.
        p_value: Permutation p-value, from the same rows.
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
        """How far a value is from perfect, 0 or more."""
        return float(abs(np.log(max(value, 1e-12) / self.perfect)) if self.is_ratio else abs(value - self.perfect))


def _values(windows: np.ndarray) -> np.ndarray:
    return windows


def _products(windows: np.ndarray) -> np.ndarray:
    return fidelity.lagged_products(windows, min(50, windows.shape[1] // 2))


def _square_products(windows: np.ndarray) -> np.ndarray:
    return fidelity.lagged_square_products(windows, min(50, windows.shape[1] // 2))


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
    Measure("A1", "geodesic distance", fidelity.window_spectra, fidelity.geodesic_distance),
    Measure("A1", "log spectral distance", fidelity.window_spectra, fidelity.log_spectral_distance),
    Measure("A2", "scale difference", _values, fidelity.scale_difference),
    Measure("A2", "log scale distance", fidelity.log_scales, fidelity.log_scale_distance),
    Measure("A3", "marginal distance", _values, fidelity.marginal_distance, max_resplits=100),
    Measure("A3", "kurtosis difference", _values, fidelity.kurtosis_difference),
    Measure("A3", "tail ratio", _values, fidelity.tail_ratio, perfect=1.0, is_ratio=True),
    Measure("A4", "autocorrelation distance", _products, fidelity.autocorrelation_distance),
    Measure("A4", "autocorrelation distance of squares", _square_products, fidelity.autocorrelation_distance),
    Measure("A5", "classifier AUC, boosted trees", two_sample.window_features, _boosted_auc, 0.5, False, 20, _boosted_p),
    Measure("A5", "classifier AUC, convolutions", two_sample.convolution_features, _linear_auc, 0.5, False, 50, _linear_p),
    Measure("A6", "density", two_sample.window_features, two_sample.density, perfect=1.0, max_resplits=50),
    Measure("A6", "coverage", two_sample.window_features, two_sample.coverage, perfect=1 - 2.0**-5, max_resplits=50),
    Measure("A7", "MMD squared", two_sample.window_features, two_sample.mmd_squared, 0.0, False, 50, two_sample.mmd_p_value),
    Measure("rank", "effective rank ratio", _values, _rank_ratio, perfect=1.0, is_ratio=True, max_resplits=40),
)


@dataclass(frozen=True)
class Row:
    """One measure of generated windows beside its floor; departures are distances from the perfect value.

    Args:
        section: Which aspect the measure belongs to.
        measure: Its name.
        value: Generated against real.
        departure: How far the value is from perfect.
        floor_mean: Mean departure of real against real.
        floor_95: 95th percentile of the departures of real against real.
        ratio: Departure in units of `floor_mean`; about 1 for perfect noise.
        is_within: Whether the departure is at most `floor_95`.
        num_resplits: Re-splits behind the floor.
        p_value: Permutation p-value of the two-sample tests, NaN elsewhere.
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
    """All rows, and the windows a side that they were measured on.

    Args:
        rows: One `Row` a measure.
        num_windows: Windows on each side.
    """

    rows: tuple[Row, ...]
    num_windows: int

    def __getitem__(self, measure: str) -> Row:
        """The row of a measure, by its name."""
        return next(row for row in self.rows if row.measure == measure)

    @property
    def worst(self) -> Row:
        """The row furthest outside its floor, by `ratio`."""
        return max(self.rows, key=lambda row: row.ratio)

    @property
    def verdict(self) -> str:
        """`indistinguishable at n` only if every measure is within its floor's 95th percentile, else by which it is not.

        Strict: perfect noise is above each floor's percentile in five to fifteen of a hundred cases (a third part of the
        real noise is not in the two that were re-split), so above one of fifteen more often than not. `worst` says by how much.
        """
        outside = [row.measure for row in self.rows if not row.is_within]
        return f"{'distinguishable' if outside else 'indistinguishable'} at n = {self.num_windows:,}" + (
            f" by {', '.join(outside)}" if outside else ""
        )


class RealFloor:
    """Real windows, measured against themselves: what every generated set of this noise is judged against.

    Args:
        real: Real windows of shape `(windows, samples)`, in the order of time, none overlapping another.
        later_real: As many other real windows, from later.
        num_resplits: Re-splits of both; a measure takes its `max_resplits` at most.
        block: Consecutive windows that stay together.
        seed: Draws the re-splits.
        measures: Which measures.

    Raises:
        InputError: If there are fewer than 20 windows a side, or values that are not finite.
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
            with threadpool_limits(1):  # threads that wait for each other on a busy machine take ten times as long
                self.values[measure.name] = np.array([compare(pooled[first], pooled[second]) for first, second in chosen])

    def evaluate(self, generated: np.ndarray) -> RealismReport:
        """Measures generated windows against the real ones.

        Args:
            generated: At least as many windows as the real ones, of the same length and in the same unit; the first count.

        Raises:
            InputError: If they are fewer, of another length, or not finite.
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
        """The first `num_windows` windows in units of the real standard deviation, about the real mean."""
        if np.ndim(windows) != 2 or len(windows) < max(20, self.num_windows) or np.shape(windows)[1] != self.samples:
            least = f"at least {max(20, self.num_windows)} {kind} windows of {self.samples} samples"
            raise InputError(f"Expected {least}. Received: shape {np.shape(windows)}.")
        if not (np.isfinite(windows).all() and self._unit > 0):
            raise InputError(f"Expected finite values that vary. Received: {kind} windows with a NaN or infinity, or all the same value.")
        return ((np.asarray(windows[: self.num_windows], np.float64) - self._offset) / self._unit).astype(np.float32)

    def _resplits(self, num_resplits: int, block: int, rng: np.random.Generator):
        """Pairs of index sets: blocks in time fall to either half by chance, and each half keeps the order of time."""
        blocks = np.array_split(np.arange(2 * self.num_windows), max(2, 2 * self.num_windows // block))
        for _ in range(num_resplits):
            order = np.concatenate([blocks[chosen] for chosen in rng.permutation(len(blocks))])
            yield np.sort(order[: self.num_windows]), np.sort(order[self.num_windows :])


def evaluate(generated: np.ndarray, real: np.ndarray, later_real: np.ndarray, num_resplits: int = 200, seed: int = 0) -> RealismReport:
    """Measures one set of generated windows against a `RealFloor` made for it; keep the floor to judge several.

    Args:
        generated: Generated windows of shape `(windows, samples)`.
        real: Real windows, in the order of time.
        later_real: As many other real windows, from later.
        num_resplits: Re-splits of the real windows at most.
        seed: Draws the re-splits.
    """
    return RealFloor(real, later_real, num_resplits, seed=seed).evaluate(generated)
