"""Channels of one source on one clock: telemetry of several channels is a `Recording` whose columns are the channels."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from enhsim_tf.coarse_simulator.recording import SAME_RATE, Recording, Run
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds
from enhsim_tf.telemetry.windows import places_in_parts

_LEAST_SHARED = 0.5  # channels that share a smaller part of their time do not become one model


def join_channels(channels: Mapping[str, Sequence[Telemetry] | Telemetry]) -> list[Recording]:
    """Brings channels onto one clock and cuts them to the time that all of them cover.

    Channels with other sampling intervals, or that share less than half of their time with the others, get a recording of their own.

    Args:
        channels: For each channel, the contiguous parts of its telemetry.

    Returns:
        One recording for each group of channels, in the order of the channels.

    Raises:
        InputError: If there is no channel, or a part is not telemetry.
    """
    if not channels:
        raise InputError("Expected at least one channel. Received: none. Give telemetry.")
    parts = {
        name: [each] if isinstance(each, Telemetry) else list(each)
        for name, each in channels.items()
    }
    groups: list[list[str]] = []
    for name, each in parts.items():
        for part in each:
            check_telemetry(part)
        own = each[0]
        for group in groups:
            first = parts[group[0]][0]
            if (
                first.has_time == own.has_time
                and abs(first.interval_s / own.interval_s - 1) <= SAME_RATE
            ):
                break
        else:
            groups.append(group := [])
        group.append(name)
    found = []
    for group in groups:
        joined = _joined({name: parts[name] for name in group})
        most = max(sum(map(len, parts[name])) for name in group)
        is_shared = joined is not None and len(joined) >= _LEAST_SHARED * most
        found += [joined] if is_shared else [_joined({name: parts[name]}) for name in group]
    return found


def telemetry_of(recording: Recording, channel: int = 0) -> list[Telemetry]:
    """Returns the parts of one channel, given by its number."""
    interval_s, start, name = recording.interval_s, recording.start, recording.columns[channel]
    return [
        Telemetry(part.values[:, channel], interval_s, part.offset_s, start, name)
        for part in recording.parts
    ]


def _joined(channels: Mapping[str, Sequence[Telemetry]]) -> Recording | None:
    """Returns the stretches that all channels cover; None if there are none."""
    first = next(iter(channels.values()))[0]
    interval_s, zero = (
        first.interval_s,
        nanoseconds(dataclasses.replace(first, offset_s=0.0), 0, 1)[0],
    )
    placed = [
        [
            (round(float(nanoseconds(part, 0, 1)[0] - zero) / 1e9 / interval_s), part)
            for part in parts
        ]
        for parts in channels.values()
    ]
    edges = sorted(
        edge
        for own in placed
        for begin, part in own
        for edge in ((begin, 1), (begin + len(part), -1))
    )
    covering = itertools.accumulate(
        change for _, change in edges
    )  # number of channels that cover the time after each edge
    runs = []
    for ((low, _), (high, _)), number in zip(itertools.pairwise(edges), covering, strict=False):
        if number == len(placed) and low < high:
            columns = [
                part.values[low - begin : high - begin]
                for own in placed
                for begin, part in own
                if begin <= low < begin + len(part)
            ]
            runs.append(Run(np.stack(columns, axis=1).astype(np.float32), low * interval_s))
    names = tuple(channels)
    return (
        Recording(tuple(runs), names, interval_s, first.start, ", ".join(names)) if runs else None
    )


def split_end(
    recording: Recording | None, share: float
) -> tuple[Recording | None, Recording | None]:
    """Splits telemetry into its beginning and its end, which has this share of the samples, below 1; None for what has no sample."""
    if recording is None:
        return None, None
    left = len(recording) - round(share * len(recording))
    first, rest = [], []
    for part in recording.parts:
        cut = min(max(left, 0), len(part))
        first += [Run(part.values[:cut], part.offset_s)] if cut else []
        rest += (
            [Run(part.values[cut:], part.offset_s + cut * recording.interval_s)]
            if cut < len(part)
            else []
        )
        left -= len(part)
    return tuple(
        dataclasses.replace(recording, parts=tuple(some)) if some else None
        for some in (first, rest)
    )


def long_enough(recording: Recording | None, window: int) -> Recording | None:
    """Returns the parts that are at least a window long; None if there are none."""
    parts = (
        () if recording is None else tuple(part for part in recording.parts if len(part) >= window)
    )
    return dataclasses.replace(recording, parts=parts) if parts else None


def cut(series: Sequence[np.ndarray], starts: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows out of series `(samples, columns)`, float32 of shape `(windows, samples, columns)`; starts as in `telemetry.windows`."""
    usable = [each for each in series if len(each) >= window]
    which, places = places_in_parts(usable, starts, window)
    windows = np.empty((len(starts), window, series[0].shape[1]), np.float32)
    for number in np.unique(which):
        rows = which == number if len(usable) > 1 else slice(None)
        view = np.lib.stride_tricks.sliding_window_view(usable[number], window, axis=0)
        windows[rows] = view[places[rows]].transpose(0, 2, 1)
    return windows


def windows_of(recording: Recording, starts: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows out of the parts of a recording, see `cut`."""
    return cut([part.values for part in recording.parts], starts, window)


def times_of(recording: Recording, starts: np.ndarray, window: int) -> np.ndarray:
    """Returns the first sample of each window on the clock of the recording, integers of shape `(windows,)`."""
    usable = [part for part in recording.parts if len(part) >= window]
    which, places = places_in_parts(usable, starts, window)
    return (
        np.array([round(part.offset_s / recording.interval_s) for part in usable])[which] + places
    )


def spread_of(windows: np.ndarray) -> np.ndarray:
    """Returns the standard deviation of each channel of windows, float64; 1 where it is 0."""
    deviation = np.std(windows, axis=(0, 1), dtype=np.float64)
    return np.where(deviation > 0, deviation, 1.0)


def nrmse(estimate: np.ndarray, windows: np.ndarray) -> np.ndarray:
    """Returns the root-mean-square error of each channel, divided by the standard deviation of its windows."""
    return np.sqrt(np.mean((estimate - windows) ** 2, axis=(0, 1), dtype=np.float64)) / spread_of(
        windows
    )


def rounded(values: np.ndarray, quantisation: Sequence[Levels | None]) -> np.ndarray:
    """Rounds quantised channels, the last axis, to their levels in place, and returns the values."""
    for channel, levels in enumerate(quantisation):
        if levels is not None:
            values[..., channel] = levels.round(values[..., channel])
    return values
