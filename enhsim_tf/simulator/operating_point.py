"""Telemetry that leaves what was learnt and stays there: said as one departure.

The scores and flags of the samples stay as they are, because a lasting shift can be the fault itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.enhancer.model import run_starts
from enhsim_tf.simulator.joint import cut
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.windows import evenly_spaced_starts

LEAST_WINDOWS = 8  # least length of a departure, in windows
LEAST_FLAGGED = 0.9  # share of its samples that are flagged
_NUM_WINDOWS = 400  # nominal windows of which the limits are measured


class Departure(NamedTuple):
    """A lasting departure from what was learnt: its first sample, and what differs: level, amplitude, or else the shape."""

    begin: int
    what: tuple[str, ...]


def find_departure(simulator: EnhancedSimulator, scores: np.ndarray, judged: Sequence[tuple[int, np.ndarray]]) -> Departure | None:
    """Finds a departure that lasts until the end of the telemetry; None if the flags do not last.

    Scores are NaN where nothing was scored; `judged` are the first sample and the series of shape `(samples, channels)` of each stretch that was
    judged.
    """
    window, has_left = simulator.window, scores > 1
    learnt = [] if simulator.nominal is None else simulator.judged_series(simulator.nominal, simulator.nominal_run)
    outside = np.zeros((2, len(scores)), bool)  # of the level and the amplitude
    if learnt:
        limits = _limits_of(cut(learnt, evenly_spaced_starts(learnt, window, _NUM_WINDOWS), window))
        for place, series in judged:
            outside[:, place : place + len(series)] = beyond(series, limits, window)
    begin = lasting(has_left | outside.any(axis=0), np.isfinite(scores), window)
    if begin is None:
        return None
    scored = np.isfinite(scores[begin:])
    what = [name for name, marks in zip(("level", "amplitude"), outside[:, begin:], strict=True) if marks[scored].mean() > 0.5]
    return Departure(begin, tuple(what) or ("shape",))


def lasting(has_left: np.ndarray, is_scored: np.ndarray, window: int) -> int | None:
    """Returns the first sample from which on at least `LEAST_FLAGGED` of the scored samples have left, over `LEAST_WINDOWS` windows; or None."""
    places = np.flatnonzero(is_scored)
    flags = has_left[places]
    following = np.cumsum(flags[::-1])[::-1] / np.arange(len(flags), 0, -1)
    possible = np.flatnonzero(flags & (following >= LEAST_FLAGGED))
    possible = possible[possible <= len(flags) - LEAST_WINDOWS * window]
    return int(places[possible[0]]) if len(possible) else None


def beyond(series: np.ndarray, limits: tuple[np.ndarray, np.ndarray], window: int) -> np.ndarray:
    """Marks the samples of windows whose level or amplitude leaves the lowest and highest ones, each of shape `(2, channels)`.

    Returns the marks of the level and of the amplitude, shape `(2, samples)`.
    """
    starts = run_starts(len(series), window, max(1, window // 2))
    found = _level_and_amplitude(cut([series], starts, window))
    marks = np.zeros((2, len(series)), bool)
    for start, is_out in zip(starts, ((found < limits[0]) | (found > limits[1])).any(axis=2), strict=True):
        marks[is_out, start : start + window] = True
    return marks


def _limits_of(nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest level and amplitude that count as learnt: those of nominal windows, and their span beyond."""
    found = _level_and_amplitude(nominal)
    low, high = found.min(axis=0), found.max(axis=0)
    span = np.maximum(high - low, 0.1 * np.median(found[:, 1], axis=0))
    return low - span, high + span


def _level_and_amplitude(windows: np.ndarray) -> np.ndarray:
    return np.stack([windows.mean(axis=1, dtype=np.float64), windows.std(axis=1, dtype=np.float64)], axis=1)
