"""Telemetry that leaves what was learnt and stays there: said as one departure, with scores against the new operating point beside it.

The scores and flags of the samples stay as they are, because a lasting shift can be the fault itself.
"""

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.simulator.joint import cut, telemetry_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.pandas_series import to_series
from enhsim_tf.telemetry.windows import evenly_spaced_starts

LEAST_WINDOWS = 8  # least length of a departure, in windows
LEAST_FLAGGED = 0.9  # share of its samples that are flagged
_CLEAR = 3.0  # change of a property, in widths of its nominal middle half, from which it is named
_NUM_WINDOWS = 400  # windows of which properties are measured


class Judge(Protocol):
    """What is needed of a detector, see `scoring.Scorer`."""

    simulator: EnhancedSimulator
    window: int

    def score_series(self, series: np.ndarray) -> np.ndarray:
        """Scores every sample of a series of shape `(samples, channels)`."""


@dataclasses.dataclass(frozen=True, eq=False)
class Departure:
    """A lasting departure from what was learnt.

    Args:
        begin: Its first sample, counted over all parts.
        what: What differs: names of `properties`, the clearest first; `shape` if none of them does.
        said: A sentence.
        scores: Scores of all samples, from `begin` on those of the telemetry moved back to the nominal level and amplitude.
    """

    begin: int
    what: tuple[str, ...]
    said: str
    scores: np.ndarray


def find_departure(
    scorer: Judge, telemetry: Recording, scores: Sequence[np.ndarray], judged: Sequence[tuple[int, int, np.ndarray]]
) -> Departure | None:
    """Finds a departure that lasts until the end of the telemetry.

    Args:
        scorer: The detector.
        telemetry: The telemetry.
        scores: Scores of each part, shape `(samples,)`, NaN where nothing was scored.
        judged: For each scored stretch the number of its part, its first sample there, and what was judged, shape `(samples, channels)`.

    Returns:
        The departure; None if the flags do not last.
    """
    every = np.concatenate(list(scores))
    before = np.cumsum([0, *map(len, scores)])
    learnt = _nominal_of(scorer)
    nominal = _windows_of(learnt, scorer.window) if learnt else None
    has_left = every > 1
    if nominal is not None:
        limits = _limits_of(nominal)
        for number, first, series in judged:
            place = int(before[number]) + first
            has_left[place : place + len(series)] |= beyond(series, limits, scorer.window)
    begin = lasting(has_left, np.isfinite(every), scorer.window)
    if begin is None:
        return None
    late = []  # of each stretch the samples of the departure, and the place of the first of them
    for number, first, series in judged:
        skip = max(0, begin - int(before[number]) - first)
        if len(series) - skip >= scorer.window:
            late.append((int(before[number]) + first + skip, series[skip:]))
    what, after = ("shape",), every.copy()
    if nominal is not None and late:
        windows = _windows_of([series for _, series in late], scorer.window)
        what = changed_properties(nominal, windows)
        (old_level, old_size), (new_level, new_size) = _level_and_size(nominal), _level_and_size(windows)
        ratio = np.where(new_size > 0, old_size / np.where(new_size > 0, new_size, 1.0), 1.0)
        for place, series in late:
            after[place : place + len(series)] = scorer.score_series(old_level + (series - new_level) * ratio)
    part = int(np.searchsorted(before, begin, "right") - 1)
    since = to_series(telemetry_of(telemetry)[part]).index[begin - int(before[part])]
    return Departure(
        begin,
        what,
        f"since {since} the telemetry has left what was learnt and stays there ({', '.join(what)}): one event. It is a lasting fault, or the "
        "new normal: then go on with `update`. score_after are scores against the new operating point.",
        after,
    )


def lasting(has_left: np.ndarray, is_scored: np.ndarray, window: int) -> int | None:
    """Returns the first sample of a departure that lasts until the end, or None.

    From there on at least `LEAST_FLAGGED` of the scored samples have left what was learnt, over at least `LEAST_WINDOWS` windows.

    Args:
        has_left: Whether a sample is flagged, or in a window whose level or amplitude was never seen, shape `(samples,)`.
        is_scored: Whether a sample has a score.
        window: Length of a window in samples.
    """
    places = np.flatnonzero(is_scored)
    if len(places) < LEAST_WINDOWS * window:
        return None
    flags = has_left[places]
    following = np.cumsum(flags[::-1])[::-1] / np.arange(len(flags), 0, -1)
    possible = np.flatnonzero(flags & (following >= LEAST_FLAGGED))
    possible = possible[possible <= len(flags) - LEAST_WINDOWS * window]
    return int(places[possible[0]]) if len(possible) else None


def beyond(series: np.ndarray, limits: tuple[np.ndarray, np.ndarray], window: int) -> np.ndarray:
    """Marks the samples of windows whose level or amplitude leaves the limits, shape `(samples,)`.

    Args:
        series: Shape `(samples, channels)`, with at least a window of samples.
        limits: Lowest and highest level and amplitude of each channel, each of shape `(2, channels)`.
        window: Length of a window in samples.
    """
    starts = np.unique(np.append(np.arange(0, len(series) - window + 1, max(1, window // 2)), len(series) - window))
    windows = cut([series], starts, window)
    found = np.stack([windows.mean(axis=1, dtype=np.float64), windows.std(axis=1, dtype=np.float64)], axis=1)
    marks = np.zeros(len(series), bool)
    for start in starts[((found < limits[0]) | (found > limits[1])).any(axis=(1, 2))]:
        marks[start : start + window] = True
    return marks


def _limits_of(nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest level and amplitude that count as learnt: those of nominal windows, and their span beyond."""
    found = np.stack([nominal.mean(axis=1, dtype=np.float64), nominal.std(axis=1, dtype=np.float64)], axis=1)
    low, high = found.min(axis=0), found.max(axis=0)
    span = np.maximum(high - low, 0.1 * np.median(found[:, 1], axis=0))
    return low - span, high + span


def changed_properties(nominal: np.ndarray, after: np.ndarray) -> tuple[str, ...]:
    """Names what differs between nominal windows and those of a departure, the clearest difference first.

    Args:
        nominal: Shape `(windows, samples, channels)`.
        after: Shape `(windows, samples, channels)`.
    """
    old, new, found = properties(nominal), properties(after), []
    for name, values in old.items():
        low, middle, high = np.quantile(values, (0.25, 0.5, 0.75), axis=0)
        tiny = 1e-9 + 1e-3 * np.abs(middle) + (0.05 if name in ("channel relation", "period") else 0.0)
        apart = np.abs(np.median(new[name], axis=0) - middle) / (high - low + tiny)
        if apart.size and apart.max() >= _CLEAR:
            found.append((float(apart.max()), name))
    return tuple(name for _, name in sorted(found, reverse=True)) or ("shape",)


def properties(windows: np.ndarray) -> dict[str, np.ndarray]:
    """Measures level, amplitude, period and the relation of the channels of each window.

    Args:
        windows: Shape `(windows, samples, channels)`.

    Returns:
        For each property an array of shape `(windows, values)`: the mean, the standard deviation, the logarithm of the mean frequency, and the
        correlations of all pairs of channels.
    """
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


def _nominal_of(scorer: Judge) -> list[np.ndarray]:
    """What the detector sees of the nominal telemetry of the fit."""
    simulator, nominal = scorer.simulator, scorer.simulator.nominal
    if nominal is None:
        return []
    long = [number for number, part in enumerate(nominal.parts) if len(part) >= scorer.window]
    if not simulator.is_run_model:
        return [nominal.parts[number].values for number in long]
    runs = simulator.alignment.nominal.parts
    return [nominal.parts[number].values - simulator.enhance_run(runs[number].values) for number in long]


def _windows_of(series: Sequence[np.ndarray], window: int) -> np.ndarray:
    return cut(series, evenly_spaced_starts(series, window, _NUM_WINDOWS), window)


def _level_and_size(windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.median(windows.mean(axis=1), axis=0), np.median(windows.std(axis=1), axis=0)
