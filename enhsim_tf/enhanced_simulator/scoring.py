"""Scores of real telemetry by a detector that has seen nothing but generated nominal telemetry.

The threshold is set on a generated series that the detector has not seen, sample by sample in the way real telemetry is
scored: if simulation and reality were alike, it would flag real nominal samples at the rate it was set for.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.detectors import DETECTORS
from enhsim_tf.detection.evaluation import score_trace
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import to_series

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_THRESHOLD_WINDOWS = 1_000  # length of the generated series that sets the threshold: neighbouring scores are alike, so few are too few
_STRIDES = 8  # scored windows a window's length


@dataclasses.dataclass(frozen=True)
class ScoreOptions:
    """How telemetry is scored.

    Args:
        detector: One of `detectors.DETECTORS`.
        num_windows: Generated nominal windows that it learns from.
        false_alarm_rate: Share of nominal samples that may be flagged.
        seed: Seed of everything drawn.
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
        simulator: The fitted simulator of that channel.
        parts: Regular stretches of telemetry, as `cleaning.clean` makes them; one shorter than a window gets no scores.
        options: How.

    Returns:
        A frame with the index of `sources.to_series` and the columns `value`, `score` (1 is where the flag begins; NaN
        where a stretch is too short to be scored) and `flag`. `frame.attrs` holds `expected_false_alarm_rate`.

    Raises:
        InputError: If the sampling interval is another than the simulator's, or every stretch is shorter than a window.
    """
    import pandas as pd

    options = options or ScoreOptions()
    window, stride = simulator.window, max(1, simulator.window // _STRIDES)
    if any(abs(part.interval_s - simulator.interval_s) > 1e-3 * simulator.interval_s for part in parts):
        raise InputError(
            f"Expected a sample every {simulator.interval_s:g} s, as the simulator was fitted. Received: every {parts[0].interval_s:g} s. "
            "Give telemetry of the same rate, or --interval."
        )
    if all(len(part) < window for part in parts):
        raise InputError(
            f"Expected a stretch of at least a window of {window} samples. Received: {max(map(len, parts), default=0)}. Give more."
        )
    training = simulator.generate(options.num_windows, seed=options.seed)
    detector = DETECTORS[options.detector](options.seed).fit(training)
    nominal = simulator.generate_series(_THRESHOLD_WINDOWS * window, seed=options.seed + 1)
    threshold = float(np.quantile(score_trace(detector, nominal, window, stride), 1 - options.false_alarm_rate))
    frames = []
    for part in parts:
        scores = np.full(len(part), np.nan)
        if len(part) >= window:
            scores = _relative(score_trace(detector, part.values, window, stride), threshold)
        series = to_series(part)
        frames.append(pd.DataFrame({"value": series, "score": scores, "flag": scores > 1}, index=series.index))
    frame = pd.concat(frames)
    frame.attrs["expected_false_alarm_rate"] = options.false_alarm_rate
    return frame


def _relative(scores: np.ndarray, threshold: float) -> np.ndarray:
    """Scores moved and scaled so that the threshold is 1; a threshold that is not positive is moved only."""
    return scores / threshold if threshold > 0 else 1 + scores - threshold


def write_scores(path: str | os.PathLike, frame: "pd.DataFrame") -> None:
    """Writes scores to a `.parquet` or `.csv` file, which appears when it is complete.

    Args:
        path: The file.
        frame: What `score_channel` returned.
    """
    with replace_file(path) as temporary:
        if Path(path).suffix == ".csv":
            frame.to_csv(temporary)
        else:
            frame.to_parquet(temporary)
