"""Telemetry that leaves what was learnt and stays there: said as one departure, with scores against the new operating point beside it.

The scores and flags of the samples stay as they are, because a lasting shift can be the fault itself.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from enhsim_tf.common.errors import spoken
from enhsim_tf.enhancer.model import run_starts
from enhsim_tf.simulator.joint import cut, spread_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.windows import evenly_spaced_starts

LEAST_WINDOWS = 8  # least length of a departure, in windows
LEAST_FLAGGED = 0.9  # share of its samples that are flagged
_MIXED = 2  # windows after its first sample in which a score may still see samples from before it
_CALM = 0.25  # share of the windows between that and `LEAST_WINDOWS` up to which scores against the new operating point may be alarms
_CLEAR = 0.1  # change from which a property is named, plus two widths of the middle half of its nominal values; see `properties`
_NUM_WINDOWS = 400  # nominal windows whose properties count as learnt
_NUM_PIECES, _LONGEST_PIECE = (
    12,
    2**14,
)  # pieces in which properties are measured, and their samples
_VALUES = 500_000  # of windows that are measured at a time
_PADDING = 4  # of a spectrum, which finds a period to a quarter of its width


class Departure(NamedTuple):
    """A lasting departure from what was learnt: its first sample, and what differs, as `changed_properties` names it.

    From there on, `scores` are those of the telemetry moved back to the nominal level and amplitude. From the sample `settled` on, those above 1
    are alarms against the new operating point; None if too many are at once, because more has changed than level and amplitude.
    """

    begin: int
    what: tuple[str, ...]
    scores: np.ndarray
    settled: int | None


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
    learnt = (
        []
        if simulator.nominal is None
        else simulator.judged_series(simulator.nominal, simulator.nominal_run)
    )
    if learnt:
        unit = spread_of(np.concatenate(learnt)[None])
        learnt, judged = (
            [each / unit for each in learnt],
            [(place, series / unit) for place, series in judged],
        )
        # windows of two periods or more, because a shorter one has another level and shape at each phase
        least = 0.0 if simulator.is_run_model else 2 * simulator.alignment.longest_period
        length = min(window * max(1, int(np.ceil(least / window))), max(map(len, learnt)))
        found = _in_rows(
            measured(learnt, length, evenly_spaced_starts(learnt, length, _NUM_WINDOWS))
        )
        low, high = found.min(axis=0), found.max(axis=0)
        span = np.maximum(high - low, _CLEAR)
        for place, series in judged:
            has_left[place : place + len(series)] |= beyond(series, low - span, high + span, length)
    begin = lasting(has_left, np.isfinite(scores), window)
    if begin is None:
        return None
    what, after = ("shape",), scores.copy()
    # without the first window, which may hold samples from before
    late = [
        series[max(0, begin + window - place) :]
        for place, series in judged
        if place + len(series) >= begin + 2 * window
    ]
    if learnt and late:
        length = min(max(map(len, late)), max(map(len, learnt)) // 2, _LONGEST_PIECE)
        old, new = (
            measured(series, length, evenly_spaced_starts(series, length, _NUM_PIECES))
            for series in (learnt, late)
        )
        what = changed_properties(old, new, simulator.channels)
        (old_level, old_size), (new_level, new_size) = (
            [np.median(each[name], axis=0) for name in ("level", "amplitude")]
            for each in (old, new)
        )
        for place, series in judged:
            moved = old_level + (series[max(0, begin - place) :] - new_level) * np.exp(
                old_size - new_size
            )
            if len(moved) >= window:
                after[place + len(series) - len(moved) : place + len(series)] = score_series(
                    moved * unit
                )
    settled = begin + _MIXED * window
    first = after[settled : begin + LEAST_WINDOWS * window]
    return Departure(begin, what, after, settled if np.mean(first > 1) <= _CALM else None)


def lasting(has_left: np.ndarray, is_scored: np.ndarray, window: int) -> int | None:
    """Returns the first sample from which on at least `LEAST_FLAGGED` of the scored samples have left, or None.

    So must as many of the next `LEAST_WINDOWS` windows, so that an alarm long before a departure is none of it.
    """
    places, least = np.flatnonzero(is_scored), LEAST_WINDOWS * window
    flags = has_left[places]
    starts = np.flatnonzero(flags[: max(0, len(flags) - least + 1)])
    before = np.append(0, np.cumsum(flags))
    soon, ever = (
        before[ends] - before[starts] >= LEAST_FLAGGED * (ends - starts)
        for ends in (starts + least, len(flags))
    )
    possible = starts[soon & ever]
    return int(places[possible[0]]) if len(possible) else None


def beyond(series: np.ndarray, low: np.ndarray, high: np.ndarray, length: int) -> np.ndarray:
    """Marks the samples whose nearest window leaves the lowest or highest values of its properties; none if the series is shorter."""
    if len(series) < length:
        return np.zeros(len(series), bool)
    starts = run_starts(len(series), length, max(1, length // 2))
    found = _in_rows(measured([series], length, starts))
    outside = ((found < low) | (found > high)).any(axis=1)
    return outside[np.searchsorted((starts[1:] + starts[:-1] + length) / 2, np.arange(len(series)))]


def _in_rows(found: dict[str, np.ndarray]) -> np.ndarray:
    return np.concatenate([values.reshape(len(values), -1) for values in found.values()], axis=1)


def measured(
    series: Sequence[np.ndarray], length: int, starts: np.ndarray
) -> dict[str, np.ndarray]:
    """Measures `properties` of windows of series, some at a time; starts as in `telemetry.windows`."""
    step = max(1, _VALUES // (length * series[0].shape[1]))
    found = [
        properties(cut(series, starts[first : first + step], length))
        for first in range(0, len(starts), step)
    ]
    return {name: np.concatenate([each[name] for each in found]) for name in found[0]}


def properties(windows: np.ndarray) -> dict[str, np.ndarray]:
    """Measures windows of shape `(windows, samples, channels)`, in units of their nominal standard deviation.

    Returns, for each channel, its mean, the logarithms of standard deviation and frequency, and as its shape the share of the power that lies
    below its harmonics; and for each two channels real and imaginary part of their correlation, which a delay turns.
    """
    values = np.asarray(windows, np.float64)
    length, level = values.shape[1], values.mean(axis=1)
    spectrum = np.fft.rfft(
        np.hanning(length)[:, None] * (values - level[:, None]), _PADDING * length, axis=1
    )
    power = np.abs(spectrum) ** 2 + 1e-300
    frequency = _PADDING + np.argmax(power[:, _PADDING:], axis=1)  # at least one period
    below = np.arange(power.shape[1])[:, None] < 1.5 * frequency[:, None]
    unit = spectrum / np.sqrt(power.sum(axis=1, keepdims=True))
    relation = unit.transpose(0, 2, 1) @ unit.conj()
    return {
        "level": level,
        "amplitude": np.log(
            values.std(axis=1) + 1e-6 * (1 + np.abs(level))
        ),  # above the rounding of float32
        "period": np.log(frequency),
        "shape": (power * below).sum(axis=1) / power.sum(axis=1),
        "channel relation": np.stack([relation.real, relation.imag], axis=1),
    }


def changed_properties(
    old: dict[str, np.ndarray], new: dict[str, np.ndarray], channels: Sequence[str]
) -> tuple[str, ...]:
    """Names what differs between two of `measured`, and of several channels in which, for example `level of volts`.

    A shape is not named beside another amplitude or period of its channel, with which it changes, and for the same reason no relation beside these.
    """
    clear = {}
    for name, values in old.items():
        low, middle, high = np.quantile(values, (0.25, 0.5, 0.75), axis=0)
        clear[name] = np.abs(np.median(new[name], axis=0) - middle) > _CLEAR + 2 * (high - low)
    clear["shape"] &= ~(clear["amplitude"] | clear["period"])
    other = clear["amplitude"] | clear["period"] | clear["shape"]
    number = (clear["channel relation"].any(axis=0) & ~(other[:, None] | other)).sum(axis=0)
    clear["channel relation"] = (number > 0) & (
        number == number.max()
    )  # the channel whose relation to most others has changed
    found = []
    for name, marks in clear.items():
        names = [channel for channel, is_clear in zip(channels, marks, strict=True) if is_clear]
        if names:
            found.append(
                name
                if len(channels) == 1
                else f"{name} of {' and '.join(names) if len(names) <= 3 else spoken(names)}"
            )
    return tuple(found) or ("shape",)
