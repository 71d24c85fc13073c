"""What users would pick instead: detectors of pyod, the matrix profile of stumpy, two that take a
line, and random scores, each with the settings that are tried.

pyod and stumpy are imported when they are used.
"""

import contextlib
import functools
import importlib
import itertools
import warnings
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from studies.common.detectors import Control, RandomScore
from studies.public_benchmarks.methods import (
    Method,
    OnWindows,
    SampleScores,
    begins_of,
    sample_scores,
)

WINDOWS, CENTRED, SAMPLES = INPUTS = ("windows", "centred windows", "samples")
"""What a detector sees: windows, windows without their means, or windows of one sample."""


class PyOD:
    """A detector of pyod; scores that are not finite count as 0.

    Args:
        path: Module within `pyod.models` and class.
        **settings: Its arguments.
    """

    def __init__(self, path: str, **settings: Any):
        module, _, name = path.partition(".")
        made = getattr(_imported(f"pyod.models.{module}"), name)
        self._detector = made(**settings)

    def fit(self, windows: np.ndarray) -> "PyOD":
        """Fits the detector to nominal windows."""
        with quiet():
            self._detector.fit(windows.reshape(len(windows), -1))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the scores of windows."""
        with quiet():
            found = self._detector.decision_function(windows.reshape(len(windows), -1))
        return np.nan_to_num(found, posinf=0.0, neginf=0.0)


class PCAError:
    """Squared error of a window that is reconstructed from the principal components with a share of
    the variance.
    """

    def __init__(self, share: float):
        self.share = share

    def fit(self, windows: np.ndarray) -> "PCAError":
        """Computes the principal components of nominal windows."""
        flat = windows.reshape(len(windows), -1).astype(np.float64)
        self._mean = flat.mean(axis=0)
        _, sizes, axes = np.linalg.svd(flat - self._mean, full_matrices=False)
        variance = np.cumsum(sizes**2)
        number = np.searchsorted(variance, self.share * variance[-1]) + 1
        self._axes = axes[: number if variance[-1] else 0]
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the mean squared error of each window."""
        apart = windows.reshape(len(windows), -1) - self._mean
        return np.mean((apart - apart @ self._axes.T @ self._axes) ** 2, axis=1)


class MovingDeviation(Control):
    """Standard deviation within a window, of several channels the largest."""

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the deviation of each window."""
        return windows.std(axis=1).max(axis=1)


class MatrixProfile:
    """Distance of a window to the nearest nominal one by stumpy, where each has mean 0 and standard
    deviation 1; the mean over channels.

    Args:
        window: Length of a window in samples.
    """

    def __init__(self, window: int):
        self.window = window
        self._profile = _stump()

    def fit(self, nominal: np.ndarray) -> "MatrixProfile":
        """Keeps the telemetry; windows with NaN are never the nearest."""
        self._nominal = nominal.astype(np.float64)
        return self

    def score(self, series: np.ndarray) -> SampleScores:
        """Scores the samples of a series."""
        begins = begins_of(len(series), self.window)
        with quiet():
            profiles = [
                self._profile(judged, self.window, nominal, ignore_trivial=False)
                for judged, nominal in zip(
                    series.T.astype(np.float64), self._nominal.T, strict=True
                )
            ]
        scores = np.mean([profile[begins, 0].astype(np.float64) for profile in profiles], axis=0)
        return sample_scores(scores, len(series), self.window)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Without warnings of the peers, of windows that do not vary or are equal to nominal ones."""
    with warnings.catch_warnings(), np.errstate(invalid="ignore", divide="ignore"):
        warnings.filterwarnings("ignore", "(invalid value|divide by zero|Precision loss)")
        warnings.filterwarnings("ignore", "A large number of values in `P`")
        yield


def _imported(module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(
            f"Expected the peers that the study compares with. Received: {error}. Install them "
            'with: pip install -e ".[peers]"'
        ) from None


@functools.cache
def _stump() -> Callable[..., np.ndarray]:
    """`stumpy.stump` in one thread, compiled, so that its time is that of later calls."""
    _imported("numba").set_num_threads(1)
    stump = _imported("stumpy").stump
    series = np.random.default_rng(0).random(40)
    stump(series, 8, series[::-1].copy(), ignore_trivial=False)
    return stump


_PYOD = {  # class of each detector, and the settings that are tried
    "PCA": ("pca.PCA", {"n_components": (None, 0.95)}),
    "isolation forest": ("iforest.IForest", {}),
    "nearest neighbours": ("knn.KNN", {"n_neighbors": (1, 5, 20)}),
    "ECOD": ("ecod.ECOD", {}),
}
SHARES = (0.9, 0.95, 0.99)
WIDTHS = (8, 16, 32, 64)
RANDOM = "random score"
PEERS = (*_PYOD, "PCA error", "matrix profile", "moving deviation")


def peers(window: int, seed: int) -> dict[str, dict[str, Callable[[], Method]]]:
    """The peers by name, each with a function that makes it for every setting that is tried.

    Args:
        window: Length of a window in samples.
        seed: Seed of those that draw.
    """

    def on(what: str, detector: Callable[[], Any]) -> Callable[[], Method]:
        length = 1 if what == SAMPLES else window
        return lambda: OnWindows(detector(), length, what == CENTRED)

    found: dict[str, dict[str, Callable[[], Method]]] = {}
    for name, (path, grid) in _PYOD.items():
        seeded = {"random_state": seed} if name == "isolation forest" else {}
        for what, *values in itertools.product(INPUTS, *grid.values()):
            given = dict(zip(grid, values, strict=True))
            told = [what, *(f"{key}={value}" for key, value in given.items())]
            made = functools.partial(PyOD, path, **given, **seeded)
            found.setdefault(name, {})[", ".join(told)] = on(what, made)
    found["PCA error"] = {
        f"{what}, share={share}": on(what, functools.partial(PCAError, share))
        for what in INPUTS
        for share in SHARES
    }
    found["matrix profile"] = {"": functools.partial(MatrixProfile, window)}
    found["moving deviation"] = {
        f"width={width}": functools.partial(OnWindows, MovingDeviation(), width) for width in WIDTHS
    }
    found[RANDOM] = {"": lambda: OnWindows(RandomScore(seed), window)}
    return found
