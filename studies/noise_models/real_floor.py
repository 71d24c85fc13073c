"""Real-vs-real baselines ("floors") of all realism measures, to which generated noise is compared
(evaluates section 2.3 of the paper).

The value of a measure cannot be interpreted alone, because two finite samples of the same process
differ too, by an amount that depends on the process. The floor of a measure is the distribution of
its values for real windows compared with other real windows. To estimate it, real windows are
repeatedly split at random into two halves, by blocks in time, and one half is treated as if it were
generated.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from sklearn.linear_model import RidgeClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from enhsim_tf.common import measures as fidelity
from enhsim_tf.common import two_sample
from enhsim_tf.common.two_sample import window_features
from studies.noise_models import distances

# in standard deviations of the noise; smaller differences are rounding errors of 32-bit telemetry
_DECIMALS = 4
_BLOCK = 10  # consecutive windows that stay together when the windows are split


def linear_classifier(generated_features: np.ndarray, real_features: np.ndarray) -> float:
    """AUC as that of `two_sample.boosted_trees`, of a ridge classifier on standardised features,
    intended for many features.
    """
    classifier = make_pipeline(StandardScaler(), RidgeClassifier(alpha=100.0))
    return two_sample.held_out_auc(
        classifier, "decision_function", generated_features, real_features
    )


@dataclass(frozen=True)
class Measure:
    """A realism measure, which computes a description of each window and compares generated with
    real descriptions.

    Args:
        name: Name of the measure.
        describe: Function from windows of shape `(windows, samples)` to their descriptions, one row
            for each window.
        compare: Function from generated and real descriptions to the value of the measure.
        perfect: Value for perfect noise. Larger and smaller values are both worse.
        is_ratio: Whether the departure from the perfect value is computed on the logarithms.
        max_resplits: Maximum number of resamples for the real-vs-real baseline; fewer for expensive
            measures.
    """

    name: str
    describe: Callable[[np.ndarray], np.ndarray]
    compare: Callable[[np.ndarray, np.ndarray], float]
    perfect: float = 0.0
    is_ratio: bool = False
    max_resplits: int = 200

    def departure(self, value: float) -> float:
        """Returns the distance of a value from the perfect value, which is at least 0."""
        return float(
            abs(np.log(max(value, 1e-12) / self.perfect))
            if self.is_ratio
            else abs(value - self.perfect)
        )


def _values(windows: np.ndarray) -> np.ndarray:
    return windows


def _products(windows: np.ndarray) -> np.ndarray:
    return fidelity.lagged_products(windows, min(50, windows.shape[1] // 2))


def _square_products(windows: np.ndarray) -> np.ndarray:
    return distances.lagged_square_products(windows, min(50, windows.shape[1] // 2))


def _rank_ratio(generated: np.ndarray, real: np.ndarray) -> float:
    return fidelity.effective_rank(generated) / fidelity.effective_rank(real)


MEASURES = (
    Measure("geodesic distance", distances.window_spectra, distances.geodesic_distance),
    Measure("log spectral distance", distances.window_spectra, distances.log_spectral_distance),
    Measure("scale difference", _values, fidelity.scale_difference),
    Measure("log scale distance", distances.log_scales, distances.log_scale_distance),
    Measure("marginal distance", _values, fidelity.marginal_distance, max_resplits=100),
    Measure("kurtosis difference", _values, distances.kurtosis_difference),
    Measure("tail ratio", _values, distances.tail_ratio, perfect=1.0, is_ratio=True),
    Measure("autocorrelation distance", _products, distances.autocorrelation_distance),
    Measure(
        "autocorrelation distance of squares", _square_products, distances.autocorrelation_distance
    ),
    Measure(
        "classifier AUC, boosted trees",
        window_features,
        two_sample.boosted_trees,
        perfect=0.5,
        max_resplits=20,
    ),
    Measure(
        "classifier AUC, convolutions",
        distances.convolution_features,
        linear_classifier,
        perfect=0.5,
        max_resplits=50,
    ),
    Measure("density", window_features, distances.density, perfect=1.0, max_resplits=50),
    Measure("coverage", window_features, distances.coverage, perfect=1 - 2.0**-5, max_resplits=50),
    Measure("MMD squared", window_features, distances.mmd_squared, max_resplits=50),
    Measure(
        "effective rank ratio", _values, _rank_ratio, perfect=1.0, is_ratio=True, max_resplits=40
    ),
)


class Row(NamedTuple):
    """Result of one measure for generated windows.

    Args:
        measure: Name of the measure.
        value: Value of the measure for generated windows compared with real windows.
        ratio: Its departure from the perfect value, divided by the mean departure of real windows:
            about 1 for perfect noise.
    """

    measure: str
    value: float
    ratio: float


class RealFloor:
    """Real-vs-real baselines of all measures for one kind of noise, to which generated windows are
    compared.

    Args:
        real: Real windows of shape `(windows, samples)`, in the order of time and without overlaps.
        later_real: The same number of other real windows, from a later time.
        num_resplits: Number of resamples. Each measure uses at most its `max_resplits`.
        seed: Seed for the resampling.
        measures: The measures.
    """

    def __init__(
        self,
        real: np.ndarray,
        later_real: np.ndarray,
        num_resplits: int,
        seed: int = 0,
        measures: Sequence[Measure] = MEASURES,
    ):
        self.measures = tuple(measures)
        self.num_windows = min(len(real), len(later_real))
        self._offset = np.mean(real, dtype=np.float64)
        self._unit = np.std(real, dtype=np.float64)
        real = self._standardised(real)
        later_real = self._standardised(later_real)
        describe = functools.cache(lambda function: (function(real), function(later_real)))
        self._real = {measure.describe: describe(measure.describe)[0] for measure in self.measures}
        splits = list(self._resplits(num_resplits, np.random.default_rng(seed)))
        self.departures: dict[str, float] = {}
        """Mean departure of each measure for real windows compared with real windows."""
        for measure in self.measures:
            pooled = np.concatenate(describe(measure.describe))
            # on a busy machine, several threads that wait for each other are ten times slower
            with threadpool_limits(1):
                values = [
                    measure.compare(pooled[first], pooled[second])
                    for first, second in splits[: measure.max_resplits]
                ]
            self.departures[measure.name] = float(
                np.mean([measure.departure(value) for value in values])
            )

    def evaluate(self, generated: np.ndarray) -> list[Row]:
        """Compares generated windows with the real windows.

        Args:
            generated: At least as many windows as there are real windows, of the same length and in
                the same unit. Additional windows are ignored.

        Returns:
            A row for each measure.
        """
        generated = self._standardised(generated)
        describe = functools.cache(lambda function: function(generated))
        rows = []
        for measure in self.measures:
            with threadpool_limits(1):
                value = measure.compare(describe(measure.describe), self._real[measure.describe])
            rows.append(
                Row(
                    measure.name,
                    value,
                    measure.departure(value) / max(self.departures[measure.name], 1e-12),
                )
            )
        return rows

    def _standardised(self, windows: np.ndarray) -> np.ndarray:
        """The first `num_windows` windows, standardised by the real windows and rounded."""
        standardised = (
            np.asarray(windows[: self.num_windows], np.float64) - self._offset
        ) / self._unit
        return np.round(standardised, _DECIMALS).astype(np.float32)

    def _resplits(
        self, num_resplits: int, rng: np.random.Generator
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yields pairs of index arrays. Blocks in time are assigned to the halves at random; each
        half keeps the order of time.
        """
        blocks = np.array_split(
            np.arange(2 * self.num_windows), max(2, 2 * self.num_windows // _BLOCK)
        )
        for _ in range(num_resplits):
            order = np.concatenate([blocks[chosen] for chosen in rng.permutation(len(blocks))])
            yield np.sort(order[: self.num_windows]), np.sort(order[self.num_windows :])
