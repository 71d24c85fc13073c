"""Scores real telemetry with a detector that was trained on generated nominal telemetry only.

The threshold is the conformal threshold of the detector's scores on another generated series, which is scored in the same way as
real telemetry. The chosen false-alarm rate holds for real nominal telemetry as far as the simulation is accurate.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics
from enhsim_tf.detection.evaluation import score_trace
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import to_series

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_THRESHOLD_WINDOWS = 1_000  # length in windows of the generated series for the threshold; only scores a window apart are independent
_STRIDES = 8  # number of scored windows that begin within one window length


@dataclasses.dataclass(frozen=True)
class ScoreOptions:
    """Settings for scoring telemetry.

    Args:
        detector: Name of a detector in `detectors.DETECTORS`.
        num_windows: Number of generated nominal windows for training the detector.
        false_alarm_rate: Share of generated nominal samples that the threshold flags. The threshold is set on a generated
            series of 1,000 windows; for a rate below 1 / 1,001, it is the largest score of that series.
        seed: Random seed.

    Raises:
        InputError: If the detector is unknown or a number is out of range.
    """

    detector: str = "PCA residual"
    num_windows: int = 2_000
    false_alarm_rate: float = 0.01
    seed: int = 0

    def __post_init__(self):
        if self.detector not in DETECTORS:
            raise InputError(f"Expected a detector, one of: {', '.join(DETECTORS)}. Received: {self.detector!r}.")
        if not 0 < self.false_alarm_rate < 0.5 or self.num_windows < 10:
            raise InputError(f"Expected 0 < false_alarm_rate < 0.5 and num_windows >= 10. Received: {self}.")


def score_channel(simulator: "EnhancedSimulator", parts: Sequence[Telemetry], options: ScoreOptions | None = None) -> "pd.DataFrame":
    """Scores every sample of a channel.

    Args:
        simulator: The simulator fitted to that channel.
        parts: Regularly sampled parts of telemetry, as returned by `cleaning.clean`. A part shorter than a window gets no
            scores.
        options: Settings of the scoring. None uses the defaults.

    Returns:
        A data frame with the index of `sources.to_series` and the columns `value`, `score` (scaled so that the threshold is
        1; NaN in parts shorter than a window) and `flag` (whether the score is above 1). `frame.attrs` contains
        `expected_false_alarm_rate`: the rate of the options, or 1 / 1,001 if that is larger.

    Raises:
        InputError: If the sampling interval differs from the simulator's, or if every part is shorter than a window.
    """
    import pandas as pd

    options = options or ScoreOptions()
    window, stride = simulator.window, max(1, simulator.window // _STRIDES)
    if any(abs(part.interval_s - simulator.interval_s) > 1e-3 * simulator.interval_s for part in parts):
        raise InputError(
            f"Expected a sample every {simulator.interval_s:g} s, as in the telemetry of the fit. Received: every {parts[0].interval_s:g} s. "
            "Give telemetry with the same sampling interval, or --interval."
        )
    if all(len(part) < window for part in parts):
        raise InputError(
            f"Expected a part of at least one window of {window} samples. Received: {max(map(len, parts), default=0)} samples. "
            "Give more telemetry."
        )
    training = simulator.generate(options.num_windows, seed=options.seed)
    detector = DETECTORS[options.detector](options.seed).fit(training)
    nominal = simulator.generate_series(_THRESHOLD_WINDOWS * window, seed=options.seed + 1)
    nominal_scores = score_trace(detector, nominal, window, stride)
    threshold, rate = metrics.finite_threshold(nominal_scores, options.false_alarm_rate, _THRESHOLD_WINDOWS)
    frames = []
    for part in parts:
        scores = np.full(len(part), np.nan)
        if len(part) >= window:
            scores = _relative(score_trace(detector, part.values, window, stride), threshold)
        series = to_series(part)
        frames.append(pd.DataFrame({"value": series, "score": scores, "flag": scores > 1}, index=series.index))
    frame = pd.concat(frames)
    frame.attrs["expected_false_alarm_rate"] = rate
    return frame


def _relative(scores: np.ndarray, threshold: float) -> np.ndarray:
    """Scales the scores so that the threshold becomes 1. If the threshold is not positive, the scores are shifted instead."""
    return scores / threshold if threshold > 0 else 1 + scores - threshold


def write_scores(path: str | os.PathLike, frame: "pd.DataFrame") -> None:
    """Writes scores to a `.parquet` or `.csv` file. The file appears only when it is complete.

    Args:
        path: Path of the file.
        frame: Scores, as returned by `score_channel`.
    """
    with replace_file(path) as temporary:
        if Path(path).suffix == ".csv":
            frame.to_csv(temporary)
        else:
            frame.to_parquet(temporary)
