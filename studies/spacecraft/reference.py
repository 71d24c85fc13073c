"""What needs no trained detector: the residual of a simulator that is aligned with a window, and left discord, for comparison."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.detection.detectors import following_drift
from enhsim_tf.detection.registry import RESIDUAL
from enhsim_tf.paper.telemetry import cut_windows
from studies.common.settings import Settings
from studies.spacecraft.judging import STRIDES, Judge
from studies.spacecraft.telemanom import LabelledChannel
from studies.spacecraft.training_data import REAL

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator

REFERENCE = "reference"
"""What the table names as the training data of detectors that judge the residual of a simulator."""
NETWORK, RIDGE = "residual", "ridge residual"
"""Residual detectors by their enhancer: the paper's network, and ridge regression."""
BOUNDS = {"": 1.0, ", scale followed": 1.5}
"""Endings of their names with the bounds within which the threshold follows the scale of nominal residuals."""
DISCORD = "left discord"
_FLAT = 1e-6  # a window whose standard deviation is below this share of the largest one is constant


def reference_rows(
    judge: Judge,
    channel: LabelledChannel,
    simulators: "Mapping[str, EnhancedSimulator]",
    settings: Settings,
) -> list[dict[str, Any]]:
    """Judges residual detectors, named as the simulators that were fitted to the train part of the channel, and left discord."""
    from enhsim_tf.simulator.options import ScoreOptions
    from enhsim_tf.simulator.scoring import Scorer

    window, seed, train = judge.window, settings.seed, channel.train.values
    number, step = settings.spacecraft.num_arm_windows, max(1, window // STRIDES)

    def windows_of(series: np.ndarray) -> np.ndarray:
        return cut_windows(series, np.arange(0, len(series) - window + 1, step), window)

    rows = []
    for name, simulator in simulators.items():
        series = simulator.generate_series(number // 2 * window, seed=seed + 1)[
            :, 0
        ]  # of 1,000 windows, as in the command `score`
        scorer = Scorer(
            simulator, ScoreOptions(RESIDUAL, number, settings.spacecraft.false_alarm_rate, seed)
        )
        sizes = [
            scorer.score_windows(windows[:, :, None])
            for windows in (judge.windows, windows_of(series), windows_of(train))
        ]
        for ending, bound in BOUNDS.items():
            followed = [following_drift(each, scorer.typical_size, bound) for each in sizes]
            rows.append({"training": REFERENCE, "detector": name + ending} | judge.judge(*followed))
    starts = np.arange(0, len(train) - window + 1, step)
    late = starts[starts >= len(train) // 3]  # the first windows have hardly any before them
    before = left_discord(train, late, window)
    whole = np.concatenate([train, channel.test.values])
    found = judge.judge(left_discord(whole, len(train) + judge.begins, window), before, before)
    return [*rows, {"training": REAL, "detector": DISCORD} | found]


def left_discord(series: np.ndarray, begins: np.ndarray, window: int) -> np.ndarray:
    """Left matrix-profile discord: how far a window is from all windows before it (Yeh et al. 2016; Lu et al. 2022).

    Each window is normalised to mean 0 and standard deviation 1 and compared with every window that ends before it begins.

    Args:
        series: The whole series, training part included, shape `(samples,)`.
        begins: First samples of the windows to score, shape `(windows,)`.
        window: Length of a window in samples.

    Returns:
        For each window, the Euclidean distance to its nearest neighbour, float64 of shape `(windows,)`. It is the largest possible
        distance, `2 * sqrt(window)`, if there is none. The distance between a constant window and one that is not constant is
        `sqrt(window)`, and between two constant ones 0.
    """
    every = np.lib.stride_tricks.sliding_window_view(np.asarray(series, np.float64), window)
    mean, spread = every.mean(axis=1), every.std(axis=1)
    is_flat = spread <= _FLAT * spread.max(initial=0.0)
    found = np.full(len(begins), 2.0 * np.sqrt(window))
    for number, begin in enumerate(begins):
        earlier = slice(0, max(0, begin - window + 1))
        if not len(mean[earlier]):
            continue
        if is_flat[begin] or is_flat[earlier].all():
            found[number] = 0.0 if is_flat[begin] and is_flat[earlier].any() else np.sqrt(window)
            continue
        centred = (every[begin] - mean[begin]) / spread[begin]
        scale = np.where(is_flat[earlier], np.inf, spread[earlier])
        correlation = (
            every[earlier] @ centred / (window * scale)
        )  # the centred window has mean 0, so the means of the others do not count
        found[number] = np.sqrt(max(2 * window * (1 - correlation.max()), 0.0))
    return found
