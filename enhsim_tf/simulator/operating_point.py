"""Telemetry that leaves what was learnt and stays there: said as one departure, with scores against the new operating point beside it.

The scores and flags of the samples stay as they are, because a lasting shift can be the fault itself.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.enhancer.model import run_starts
from enhsim_tf.simulator.joint import cut
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.windows import evenly_spaced_starts

LEAST_WINDOWS = 8  # least length of a departure, in windows
LEAST_FLAGGED = 0.9  # share of its samples that are flagged
_CLEAR = 3.0  # change of a property, in widths of its nominal middle half, from which it is named
_NUM_WINDOWS = 400  # windows of which properties are measured


class Departure(NamedTuple):
    """A lasting departure from what was learnt: its first sample, and what differs, as `changed_properties` names it.

    From there on, `scores` are those of the telemetry moved back to the nominal level and amplitude.
    """

    begin: int
    what: tuple[str, ...]
    scores: np.ndarray


def find_departure(
    simulator: EnhancedSimulator,
    score_series: Callable[[np.ndarray], np.ndarray],
    scores: np.ndarray,
    judged: Sequence[tuple[int, np.ndarray]],
) -> Departure | None:
    """Finds a departure that lasts until the end of the telemetry; None if the flags do not last.

    Scores are NaN where nothing was scored; `score_series` is that of a `Scorer`, and `judged` are the first sample and the series of shape
    `(samples, channels)` of each stretch that it has judged.
    """
    window, has_left = simulator.window, scores > 1
    learnt = [] if simulator.nominal is None else simulator.judged_series(simulator.nominal, simulator.nominal_run)
    if learnt:
        nominal = _windows_of(learnt, window)
        limits = _limits_of(nominal)
        for place, series in judged:
            has_left[place : place + len(series)] |= beyond(series, limits, window)
    begin = lasting(has_left, np.isfinite(scores), window)
    if begin is None:
        return None
    late = []  # of each stretch the samples of the departure, and the place of the first of them
    for place, series in judged:
        skip = max(0, begin - place)
        if len(series) - skip >= window:
            late.append((place + skip, series[skip:]))
    what, after = ("shape",), scores.copy()
    if learnt and late:
        windows = _windows_of([series for _, series in late], window)
        what = changed_properties(nominal, windows)
        (old_level, old_size), (new_level, new_size) = (
            (np.median(each.mean(axis=1), axis=0), np.median(each.std(axis=1), axis=0)) for each in (nominal, windows)
        )
        ratio = np.where(new_size > 0, old_size / np.where(new_size > 0, new_size, 1.0), 1.0)
        for place, series in late:
            after[place : place + len(series)] = score_series(old_level + (series - new_level) * ratio)
    return Departure(begin, what, after)


def lasting(has_left: np.ndarray, is_scored: np.ndarray, window: int) -> int | None:
    """Returns the first sample from which on at least `LEAST_FLAGGED` of the scored samples have left, over `LEAST_WINDOWS` windows; or None."""
    places = np.flatnonzero(is_scored)
    flags = has_left[places]
    following = np.cumsum(flags[::-1])[::-1] / np.arange(len(flags), 0, -1)
    possible = np.flatnonzero(flags & (following >= LEAST_FLAGGED))
    possible = possible[possible <= len(flags) - LEAST_WINDOWS * window]
    return int(places[possible[0]]) if len(possible) else None


def beyond(series: np.ndarray, limits: tuple[np.ndarray, np.ndarray], window: int) -> np.ndarray:
    """Marks the samples of windows whose level or amplitude leaves the lowest and highest ones, each of shape `(2, channels)`."""
    starts = run_starts(len(series), window, max(1, window // 2))
    found = _level_and_amplitude(cut([series], starts, window))
    marks = np.zeros(len(series), bool)
    for start in starts[((found < limits[0]) | (found > limits[1])).any(axis=(1, 2))]:
        marks[start : start + window] = True
    return marks


def _limits_of(nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest level and amplitude that count as learnt: those of nominal windows, and their span beyond."""
    found = _level_and_amplitude(nominal)
    low, high = found.min(axis=0), found.max(axis=0)
    span = np.maximum(high - low, 0.1 * np.median(found[:, 1], axis=0))
    return low - span, high + span


def _level_and_amplitude(windows: np.ndarray) -> np.ndarray:
    return np.stack([windows.mean(axis=1, dtype=np.float64), windows.std(axis=1, dtype=np.float64)], axis=1)


def changed_properties(nominal: np.ndarray, after: np.ndarray) -> tuple[str, ...]:
    """Names what differs between nominal windows and those of a departure, both of shape `(windows, samples, channels)`, the clearest first."""
    old, new, found = properties(nominal), properties(after), []
    for name, values in old.items():
        low, middle, high = np.quantile(values, (0.25, 0.5, 0.75), axis=0)
        tiny = 1e-9 + 1e-3 * np.abs(middle) + (0.05 if name in ("channel relation", "period") else 0.0)
        apart = np.abs(np.median(new[name], axis=0) - middle) / (high - low + tiny)
        if apart.size and apart.max() >= _CLEAR:
            found.append((float(apart.max()), name))
    return tuple(name for _, name in sorted(found, reverse=True)) or ("shape",)


def properties(windows: np.ndarray) -> dict[str, np.ndarray]:
    """Mean, standard deviation, logarithm of the mean frequency, and correlations of pairs of channels of windows, shape `(windows, values)`."""
    values = np.asarray(windows, np.float64)
    centred = values - values.mean(axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(centred, axis=1)) ** 2
    frequency = np.sum(power * np.arange(power.shape[1])[:, None], axis=1) / np.maximum(power.sum(axis=1), 1e-300)
    covariance = np.einsum("wsa,wsb->wab", centred, centred)
    size = np.sqrt(np.maximum(np.einsum("waa->wa", covariance), 1e-300))
    relation = (covariance / (size[:, :, None] * size[:, None]))[:, *np.triu_indices(values.shape[2], 1)]
    return {
        "level": values.mean(axis=1),
        "amplitude": values.std(axis=1),
        "period": np.log(np.maximum(frequency, 0.5)),
        "channel relation": relation,
    }


def _windows_of(series: Sequence[np.ndarray], window: int) -> np.ndarray:
    return cut(series, evenly_spaced_starts(series, window, _NUM_WINDOWS), window)
