"""`score` as its users have it, with its own flags and events."""

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.public_benchmarks.arms import Simulators, telemetry_of
from studies.public_benchmarks.judging import Judge
from studies.public_benchmarks.series import Ranges, Series

if TYPE_CHECKING:
    from enhsim_tf.scoring.events import Event

TOOL = "score"


def judge_tool(series: Series, simulators: Simulators, window: int, rate: float) -> dict[str, Any]:
    """Fits a simulator, scores the judged part and judges the flags and events.

    Returns:
        What `Judge.judge` returns; `onset_error` and `delay` are those of the events at the own
        threshold.
    """
    from enhsim_tf.scoring.options import ScoreOptions
    from enhsim_tf.scoring.score import score

    began = time.process_time()
    simulator = simulators.fitted(series.nominal)
    scored = score(simulator, telemetry_of(series.judged), options=ScoreOptions(rate))
    seconds = time.process_time() - began
    scores = scored.table["score"].to_numpy()
    flags = scored.table["flag"].to_numpy()
    row = Judge(series.events, len(scores), window).judge(scores, scores, flags)
    onset_error, delay = times_of(scored.events, series.events)
    return row | {"onset_error": onset_error, "delay": delay, "cpu_s": seconds}


def times_of(events: Sequence["Event"], labelled: Ranges) -> tuple[float, float]:
    """Median distance of the estimated onset from the begin of a labelled event, and median time
    from there to the detection, of the first event that touches it and was not detected before.
    """
    onsets = []
    delays = []
    for begin, end in labelled:
        for event in events:
            if event.begin < end and begin <= event.detected:
                onsets.append(abs(event.begin - begin))
                delays.append(event.detected - begin)
                break
    return tuple(float(np.median(values)) if values else np.nan for values in (onsets, delays))
