"""The views of `score` in the uses that a simulator has: they learn the telemetry, telemetry that
the fitted simulator generates, or the difference between the telemetry and the enhanced simulator.
"""

import dataclasses
import functools
import zlib
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.scoring.scorer import Constants, Scorer
from enhsim_tf.scoring.views import JOINT_VIEWS, VIEWS, View
from enhsim_tf.telemetry.series import Part, Telemetry
from enhsim_tf.telemetry.windows import average_windows, run_starts, runs_of
from studies.public_benchmarks.methods import SampleScores, blocks_of, without
from studies.public_benchmarks.series import Series

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator

TELEMETRY, GENERATED, DIFFERENCE = ARMS = (
    "views of the telemetry",
    "views of generated telemetry",
    "views of the difference",
)
"""What all views learn. The first two judge telemetry, the last one the difference."""
CHOSEN = "views"
"""The views of the telemetry with the view left out, or the constant changed, that is best on other
series: like a peer.
"""
CHANGES = {
    f"{name} {value}": {name: value}
    for name, values in {
        "longest_window": (32, 48, 96),
        "windows_in_record": (12, 16, 40),
        "num_blocks": (2, 8),
        "quantile": (0.95, 1.0),
    }.items()
    for value in values
}
"""Constants of the scorer that are tried, one changed at a time."""


def window_of(nominal: np.ndarray) -> int:
    """The length of windows by the rule of `score`, which all methods use."""
    return Scorer([nominal]).window


def pieces_of(nominal: np.ndarray) -> dict[int, np.ndarray]:
    """The pieces of telemetry between NaN, by their first samples."""
    marks = np.isfinite(nominal).all(axis=1)
    return {begin: nominal[begin:end] for begin, end in runs_of(marks)}


def telemetry_of(values: np.ndarray) -> Telemetry:
    """Telemetry in its pieces between NaN."""
    parts = tuple(Part(piece, float(begin)) for begin, piece in pieces_of(values).items())
    return Telemetry(parts, tuple(f"channel {number}" for number in range(values.shape[1])))


def views_of(num_channels: int) -> dict[str, Callable[[], View]]:
    """The views of `score`."""
    return VIEWS | (JOINT_VIEWS if num_channels > 1 else {})


def settings_of_views(num_channels: int) -> "dict[str, Callable[[], Views]]":
    """The views by setting: all, all but one, and all with a constant changed."""
    settings = {"": Views}
    settings |= {
        f"without {name}": functools.partial(Views, name) for name in views_of(num_channels)
    }
    return settings | {name: functools.partial(Views, **change) for name, change in CHANGES.items()}


class Views:
    """The sum of views, on telemetry or differences.

    Args:
        left_out: The view that is left out, none by default.
        **constants: Constants of the scorer that are changed.
    """

    def __init__(self, left_out: str = "", **constants: float):
        self.left_out = left_out
        self.constants = Constants(**constants)

    def fit(self, nominal: np.ndarray) -> "Views":
        """Learns all pieces."""
        views = views_of(nominal.shape[1])
        views.pop(self.left_out, None)
        pieces = list(pieces_of(nominal).values())
        self._scorer = Scorer(pieces, views=views, constants=self.constants)
        return self

    def score(self, series: np.ndarray) -> SampleScores:
        """Scores the samples of a series by the sum of the views."""
        scorer = self._scorer
        both = scorer.score(series).samples, scorer.window_scores(series)
        return SampleScores(*(scorer.threshold * scores for scores in both))


class Simulators:
    """Simulators with default settings of one series; each piece of time is fitted once.

    Args:
        seed: Seed of the fits.
    """

    def __init__(self, seed: int):
        self.seed = seed
        self._fitted: dict[int, EnhancedSimulator] = {}

    def fitted(self, nominal: np.ndarray) -> "EnhancedSimulator":
        """The simulator of nominal telemetry, NaN where it is left out."""
        from enhsim_tf.fitting.fit import fit
        from enhsim_tf.fitting.options import FitOptions

        key = zlib.crc32(np.ascontiguousarray(nominal))
        if key not in self._fitted:
            self._fitted[key], _ = fit(
                telemetry_of(nominal), options=FitOptions(held_out=0.0, seed=self.seed)
            )
        return self._fitted[key]

    def difference(self, series: Series) -> Series:
        """The series as its difference from the enhanced simulator, which has not learnt the block
        of nominal time that it is subtracted from.
        """
        nominal = [
            _residual(self.fitted(without(series.nominal, begin, end)), series.nominal[begin:end])
            for begin, end in blocks_of(len(series.nominal))
        ]
        judged = _residual(self.fitted(series.nominal), series.judged)
        return dataclasses.replace(series, nominal=np.concatenate(nominal), judged=judged)


def _residual(simulator: "EnhancedSimulator", values: np.ndarray) -> np.ndarray:
    """The mean of `unexplained` windows, float32 of the shape of the values."""
    begins = run_starts(len(values), simulator.window)
    every = np.lib.stride_tricks.sliding_window_view(values, simulator.window, axis=0)

    def windows_at(rows: slice) -> np.ndarray:
        return unexplained(simulator, every[begins[rows]].swapaxes(1, 2))

    return average_windows(windows_at, begins, simulator.window, len(values))


def unexplained(simulator: "EnhancedSimulator", windows: np.ndarray) -> np.ndarray:
    """Windows of telemetry minus the waves that are aligned with them, enhanced.

    The gain may leave the range of the training by at most a factor of 2, so that a channel that
    stands still is not explained.
    """
    waves = simulator.alignment
    coarse, _, gain = waves.align(windows)
    learnt = waves.levels[:, :, 1]
    gain = np.clip(gain, learnt.min(axis=0) / 2, learnt.max(axis=0) * 2)
    left = windows - gain[:, None] * simulator.enhance(coarse)
    return (left - left.mean(axis=1, keepdims=True)).astype(np.float32)


class Generated(Views):
    """Views of as much generated telemetry as there is nominal one.

    Args:
        simulators: Fits the simulator.
    """

    def __init__(self, simulators: Simulators):
        super().__init__()
        self._simulators = simulators

    def fit(self, nominal: np.ndarray) -> "Generated":
        """Fits the simulator, and learns what it generates."""
        simulator = self._simulators.fitted(nominal)
        number = len(nominal)
        super().fit(simulator.generate_series(number, seed=self._simulators.seed))
        return self
