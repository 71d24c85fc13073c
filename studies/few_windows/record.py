"""What detectors are trained on, given a record of `k` windows of real telemetry.

Everything that is learnt comes from the record and from the coarse simulator. The record is
contiguous, so that it holds `k` disjoint windows, and all training data are cut from the same
overlapping windows of it, evenly spaced over all samples. What follows was fixed before the first
run:

- `real`: detectors are trained on windows of the record. Its own windows set the threshold, each
  scored by a detector that was trained on the other blocks of time.
- `simulator + ...`: tuned ridge regression from coarse to real windows, fitted to the record, plus
  noise of a simple model, fitted to residuals of blocks of time that the regression had not seen.
  Generated windows train detectors, and others set the threshold.
- `CORAL`: windows of the simulator with Gaussian noise, whose mean and covariance are aligned with
  those of the record (Sun, Feng and Saenko 2016). The covariance of the simulator comes from ten
  times as many further windows. In the first run it came from the windows that train the detectors,
  which the map whitens better than others; thresholds were too high.
"""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np

from enhsim_tf.coarse.square_waves import SquareWaveSimulator
from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.paper.telemetry import cut_windows
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts, time_blocks
from studies.common.gaussian_noise import fit_candidate

REAL = "real"
CORAL = "CORAL"
SIMULATOR = "simulator + "
"""Beginning of the names of training data with noise of a model; the name of the model follows."""
# in no environment does the noise follow the signal
NOISE_MODELS = ("gaussian", "autoregression", "residual windows")
NUM_BLOCKS = 5  # of time, for cross-fitting
_START_RANGE = 1_000_000  # generated windows begin at a random sample below this one


@dataclasses.dataclass
class Record:
    """A contiguous record of real telemetry, and the simulator that is fitted to it.

    Args:
        telemetry: The record, `num_real` windows long.
        coarse: The coarse simulator.
        window: Length of a window in samples.
        most: Maximum number of windows for training.
        seed: Seed of everything that is drawn or trained.
    """

    telemetry: Telemetry
    coarse: SquareWaveSimulator
    window: int
    most: int
    seed: int

    def __post_init__(self):
        self.starts = evenly_spaced_starts([self.telemetry], self.window, self.most)
        self.windows = cut_windows(self.telemetry.values[:, 0], self.starts, self.window)

    def _coarse(self, starts: np.ndarray) -> np.ndarray:
        return self.coarse.simulate(
            self.telemetry.offset_s
            + self.telemetry.interval_s * (starts[:, None] + np.arange(self.window))
        )

    @functools.cached_property
    def enhance(self) -> Callable[[np.ndarray], np.ndarray]:
        """Tuned ridge regression from coarse to real windows, fitted to the whole record."""
        return fit_ridge(self._coarse(self.starts), self.windows, self.starts).predict

    @functools.cached_property
    def residuals(self) -> tuple[np.ndarray, np.ndarray]:
        """Noise windows and the enhanced windows below them, from regressions that had not seen the
        block of time of the window.
        """
        coarse = self._coarse(self.starts)
        noise = np.empty_like(self.windows)
        for training, held_out in time_blocks(self.starts, NUM_BLOCKS, self.window):
            fitted = fit_ridge(coarse[training], self.windows[training], self.starts[training])
            noise[held_out] = self.windows[held_out] - fitted.predict(coarse[held_out])
        return noise, self.windows - noise

    def generate(self, name: str, num_windows: int, purpose: int) -> np.ndarray:
        """Generates windows of the simulator with noise of one of `NOISE_MODELS`; `purpose` is the
        number of the random draw.
        """
        rng = np.random.default_rng([self.seed, purpose])
        clean = self.enhance(self._coarse(rng.integers(0, _START_RANGE, num_windows)))
        return clean + fit_candidate(name, *self.residuals)(clean, rng)


def coral_alignment(source: np.ndarray, target: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Correlation alignment: a linear map that gives source windows the mean and covariance of
    target windows, `(windows, samples)`.

    Covariances are shrunk towards their mean variance, because a short record does not determine
    them. The map whitens the source and colours it as the target; it returns float32.
    """
    transfer = _power(_covariance(source), -0.5) @ _power(_covariance(target), 0.5)
    return lambda windows: (
        (windows - source.mean(axis=0)) @ transfer + target.mean(axis=0)
    ).astype(np.float32)


def _covariance(windows: np.ndarray) -> np.ndarray:
    from sklearn.covariance import ledoit_wolf

    return ledoit_wolf(np.asarray(windows, np.float64))[0]


def _power(matrix: np.ndarray, exponent: float) -> np.ndarray:
    values, vectors = np.linalg.eigh(matrix)
    values = np.maximum(values, 1e-12 * values.max())
    return (vectors * values**exponent) @ vectors.T
