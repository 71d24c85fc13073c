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
from enhsim_tf.detection.events import confidences, events_of, false_alarms_per_day
from enhsim_tf.detection.registry import DETECTORS, RESIDUAL
from enhsim_tf.enhanced_simulator.residual_detector import AlignedResidual
from enhsim_tf.telemetry.pandas_series import to_series
from enhsim_tf.telemetry.series import Telemetry

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_THRESHOLD_WINDOWS = 1_000  # length in windows of the generated series for the threshold; only scores a window apart are independent
_STRIDES = 8  # number of scored windows that begin within one window length


@dataclasses.dataclass(frozen=True)
class ScoreOptions:
    """Settings for scoring telemetry.

    Args:
        detector: Name of a detector in `registry.DETECTORS`, or `RESIDUAL`, which judges the difference between the telemetry and the
            simulator that is aligned with it.
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
        if self.detector not in (*DETECTORS, RESIDUAL):
            raise InputError(f"Expected a detector, one of: {', '.join((*DETECTORS, RESIDUAL))}. Received: {self.detector!r}.")
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
        A data frame with the index of `pandas_series.to_series` and the columns `value`, `score` (scaled so that the threshold is
        1; NaN in parts shorter than a window) and `flag` (whether the score is above 1). `frame.attrs` contains
        `expected_false_alarm_rate` (the rate of the options, or 1 / 1,001 if that is larger), `events` (the rows of
        `events_table`), and `false_alarms_per_day`: the number that is expected on nominal telemetry, with the limits of its
        95 % interval, from a further generated series.

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
    detector = (AlignedResidual(simulator) if options.detector == RESIDUAL else DETECTORS[options.detector](options.seed)).fit(training)
    nominal = simulator.generate_series(_THRESHOLD_WINDOWS * window, seed=options.seed + 1)
    nominal_scores = score_trace(detector, nominal, window, stride)
    threshold, rate = metrics.finite_threshold(nominal_scores, options.false_alarm_rate, _THRESHOLD_WINDOWS)
    further = simulator.generate_series(_THRESHOLD_WINDOWS * window, seed=options.seed + 2)  # on it the alarms are counted
    further_scores = _relative(score_trace(detector, further, window, stride), threshold)
    frames, events = [], []
    for part in parts:
        scores = np.full(len(part), np.nan)
        if len(part) >= window:
            scores = _relative(score_trace(detector, part.values, window, stride), threshold)
        series = to_series(part)
        events += event_rows(scores, sum(map(len, frames)), further_scores, window, simulator.interval_s)
        frames.append(pd.DataFrame({"value": series, "score": scores, "flag": scores > 1}, index=series.index))
    frame = pd.concat(frames)
    note_alarms(frame, rate, events, further_scores, window, simulator.interval_s)
    return frame


def note_alarms(
    frame: "pd.DataFrame", rate: float, events: Sequence[dict], nominal_scores: np.ndarray, window: int, interval_s: float
) -> None:
    """Notes the expected false alarms and the events of a channel in `frame.attrs`, see `score_channel`.

    Args:
        frame: Scores of the channel.
        rate: Expected share of flagged nominal samples.
        events: The events, as returned by `event_rows`.
        nominal_scores: Scores of a generated nominal series, scaled so that the threshold is 1, shape `(samples,)`.
        window: Length of a window in samples.
        interval_s: Sampling interval in seconds.
    """
    num_alarms = len(events_of(nominal_scores > 1, gap=window))
    frame.attrs["expected_false_alarm_rate"] = rate
    frame.attrs["false_alarms_per_day"] = list(false_alarms_per_day(num_alarms, len(nominal_scores) * interval_s))
    frame.attrs["events"] = list(events)


def event_rows(scores: np.ndarray, before: int, nominal_scores: np.ndarray, window: int, interval_s: float) -> list[dict]:
    """Returns the events of a part in plain JSON types. Flags within a window of each other are one event, as they share windows.

    Args:
        scores: Scores of the part, scaled so that the threshold is 1, shape `(samples,)`.
        before: Number of samples before the part.
        nominal_scores: Scores of a generated nominal series, shape `(samples,)`.
        window: Length of a window in samples.
        interval_s: Sampling interval in seconds.
    """
    flags, rows = scores > 1, []
    found = events_of(flags, scores, window)
    peaks = [scores[event.peak] for event in found]
    for event, peak, confidence in zip(found, peaks, confidences(peaks, nominal_scores, window), strict=True):
        rows.append(
            {
                "begin": before + event.begin,
                "end": before + event.end,
                "peak": before + event.peak,
                "duration_s": (event.end - event.begin) * interval_s,
                "num_flagged": int(flags[event.begin : event.end].sum()),
                "score": float(peak),
                "confidence": float(confidence),
            }
        )
    return rows


def events_table(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Returns the events in the scores of a channel, one row per alarm.

    Args:
        frame: Scores, as returned by `score_channel`.

    Returns:
        A data frame with the columns `begin`, `end` and `peak` (times of the first flagged sample, of the sample after the last
        one, and of the highest score; sample numbers if the telemetry has no times), `duration_s`, `num_flagged`, `score` (the
        highest score; the threshold is 1) and `confidence` (see `events.confidences`). Runs of flags that are at most one window
        apart are one event.
    """
    import pandas as pd

    names = ["begin", "end", "peak", "duration_s", "num_flagged", "score", "confidence"]
    table = pd.DataFrame(frame.attrs["events"], columns=names)
    index, begin, end = frame.index, table["begin"].to_numpy(int), table["end"].to_numpy(int)
    if hasattr(index, "tz"):
        after = index[begin] + pd.to_timedelta(table["duration_s"].to_numpy(float), unit="s").round("us")
    else:
        after = index[end - 1] + 1
    return table.assign(begin=index[begin], end=after, peak=index[table["peak"].to_numpy(int)])


def _relative(scores: np.ndarray, threshold: float) -> np.ndarray:
    """Scales the scores so that the threshold becomes 1. If the threshold is not positive, the scores are shifted instead."""
    return scores / threshold if threshold > 0 else 1 + scores - threshold


def events_path(path: str | os.PathLike) -> Path:
    """Returns the path of the events beside a file of scores, for example `scores.events.csv` beside `scores.parquet`."""
    return Path(path).with_suffix(".events.csv")


def write_scores(path: str | os.PathLike, frame: "pd.DataFrame") -> None:
    """Writes scores to a `.parquet` or `.csv` file, and their events to `events_path`. The files appear only when both are complete.

    Args:
        path: Path of the file.
        frame: Scores, as returned by `score_channel`.
    """
    with replace_file(path) as temporary, replace_file(events_path(path)) as events:
        events_table(frame).to_csv(events, index=False)
        if Path(path).suffix == ".csv":
            frame.to_csv(temporary)
        else:
            frame.to_parquet(temporary, index=True)  # sample numbers, too, are a column for every reader
