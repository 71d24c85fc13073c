"""The simulator as a reference: what is left of a window after the simulator was aligned with it; and left discord, for comparison."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.detection.registry import RESIDUAL
from enhsim_tf.detection.residual_size import ResidualSize
from enhsim_tf.telemetry.windows import cut_windows
from studies.common.settings import Settings
from studies.spacecraft.discord import left_discord
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


def reference_rows(
    judge: Judge, channel: LabelledChannel, simulators: "Mapping[str, EnhancedSimulator]", settings: Settings
) -> list[dict[str, Any]]:
    """Judges residual detectors, and the distance of each window to the most similar earlier one.

    Args:
        judge: The test part.
        channel: The channel.
        simulators: Simulators that were fitted to its train part, with the window of `judge`, by the name of their residual detector.
        settings: All settings; `labelled` and `seed` are used.
    """
    from enhsim_tf.simulator.options import ScoreOptions
    from enhsim_tf.simulator.scoring import Scorer

    window, seed, train = judge.window, settings.seed, channel.train.values
    number = settings.labelled.num_arm_windows
    starts = np.arange(0, len(train) - window + 1, max(1, window // STRIDES))
    past = cut_windows(train, starts, window)
    rows = []
    for name, simulator in simulators.items():
        series = simulator.generate_series(number // 2 * window, seed=seed + 1)[:, 0]  # of 1,000 windows, as in the command `score`
        generated = cut_windows(series, np.arange(0, len(series) - window + 1, max(1, window // STRIDES)), window)
        scorer = Scorer(simulator, ScoreOptions(RESIDUAL, number, settings.labelled.false_alarm_rate, seed))
        sizes = [scorer.score_windows(windows[:, :, None]) for windows in (judge.windows, generated, past)]
        for ending, bound in BOUNDS.items():
            detector = ResidualSize(bound).fit_sizes(np.array([scorer.detector.typical]))
            rows.append({"training": REFERENCE, "detector": name + ending} | judge.judge(*map(detector.score_sizes, sizes)))
    late = starts[starts >= len(train) // 3]  # the first windows have hardly any before them
    before = left_discord(train, late, window)
    whole = np.concatenate([train, channel.test.values])
    found = judge.judge(left_discord(whole, len(train) + judge.begins, window), before, before)
    return [*rows, {"training": REAL, "detector": DISCORD} | found]
