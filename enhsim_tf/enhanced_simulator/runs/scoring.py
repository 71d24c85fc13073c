"""Judges telemetry by its difference from the enhanced run of the same time, with a detector trained on generated noise."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics
from enhsim_tf.detection.evaluation import score_trace
from enhsim_tf.detection.interface import Detector
from enhsim_tf.detection.registry import DETECTORS, RESIDUAL
from enhsim_tf.detection.residual_size import ResidualSize
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions, event_rows, note_alarms
from enhsim_tf.telemetry.pandas_series import to_series
from enhsim_tf.telemetry.series import Telemetry

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.runs.model import RunModel

_THRESHOLD_WINDOWS = 1_000  # length in windows of the generated noise for the threshold
_STRIDES = 8  # number of scored windows that begin within one window length


class ResidualDetector:
    """A detector of differences between telemetry and enhanced run. It is trained on generated noise only.

    The threshold is the conformal one of the scores of another generated series, see `detection.metrics.finite_threshold`. The chosen
    false-alarm rate holds for real nominal telemetry as far as the generated noise has the properties of the real residual.

    Args:
        model: The run model.
        options: Settings of the scoring.
    """

    def __init__(self, model: "RunModel", options: ScoreOptions):
        self.window, self.stride = model.window, max(1, model.window // _STRIDES)
        clean = np.concatenate([*model.nominal_chunks(options.num_windows, np.random.default_rng([options.seed, 7]))])
        noise = model.draw_noise(clean, np.random.default_rng([options.seed, 3]))
        self.detector: Detector = (ResidualSize() if options.detector == RESIDUAL else DETECTORS[options.detector](options.seed)).fit(noise)
        clean = model.nominal_series(_THRESHOLD_WINDOWS * self.window)
        series, further = (model.draw_noise(clean, np.random.default_rng([options.seed, number])) for number in (4, 6))
        scores = score_trace(self.detector, series, self.window, self.stride)
        self.threshold, self.rate = metrics.finite_threshold(scores, options.false_alarm_rate, _THRESHOLD_WINDOWS)
        self.nominal_scores = self.score(further)  # on it the alarms are counted

    def score(self, residual: np.ndarray) -> np.ndarray:
        """Scores every sample of a residual; scores above 1 are anomalous.

        Args:
            residual: Telemetry minus enhanced run, shape `(samples,)`, with at least a window of samples.

        Returns:
            float64 array of shape `(samples,)`, scaled so that the threshold is 1.
        """
        scores = score_trace(self.detector, residual, self.window, self.stride)
        return scores / self.threshold if self.threshold > 0 else 1 + scores - self.threshold


def score_run(model: "RunModel", parts: Sequence[Telemetry], recording: Recording, options: ScoreOptions | None = None) -> "pd.DataFrame":
    """Scores every sample of telemetry by its difference from the enhanced run of the same time.

    Args:
        model: The run model.
        parts: Contiguous parts of telemetry, as returned by `cleaning.clean`.
        recording: The coarse run of the same time.
        options: Settings of the scoring. None uses the defaults.

    Returns:
        A data frame with the index of `pandas_series.to_series` and the columns `value`, `enhanced`, `score` (scaled so that the
        threshold is 1), `flag` (whether the score is above 1) and `out_of_range` (above 1, the coarse run is outside the
        training range). Samples without a coarse run, or in stretches shorter than a window, have NaN in place of numbers.
        `frame.attrs` is that of `scoring.score_channel`.

    Raises:
        InputError: If the sampling interval differs from the model's, or telemetry and run share no window.
    """
    import pandas as pd

    options = options or ScoreOptions()
    if any(abs(part.interval_s - model.interval_s) > 1e-3 * model.interval_s for part in parts):
        raise InputError(
            f"Expected a sample every {model.interval_s:g} s, as in the telemetry of the fit. Received: every {parts[0].interval_s:g} s. "
            "Give telemetry with the same sampling interval, or --interval."
        )
    pairs = model.pair(parts, recording)
    detector = ResidualDetector(model, options)
    frames, events = [], []
    for part in parts:
        columns = {name: np.full(len(part), np.nan) for name in ("enhanced", "score", "out_of_range")}
        for pair in pairs:
            first = round((pair.telemetry.offset_s - part.offset_s) / part.interval_s)
            if 0 <= first < len(part):
                here = slice(first, first + len(pair))
                columns["enhanced"][here] = model.enhance(pair.coarse)
                columns["score"][here] = detector.score(pair.telemetry.values - columns["enhanced"][here].astype(np.float32))
                columns["out_of_range"][here] = model.coverage.score(pair.coarse)
        series = to_series(part)
        events += event_rows(columns["score"], sum(map(len, frames)), detector.nominal_scores, model.window, model.interval_s)
        order = {"value": series, "enhanced": columns["enhanced"], "score": columns["score"], "flag": columns["score"] > 1}
        frames.append(pd.DataFrame(order | {"out_of_range": columns["out_of_range"]}, index=series.index))
    frame = pd.concat(frames)
    note_alarms(frame, detector.rate, events, detector.nominal_scores, model.window, model.interval_s)
    return frame
