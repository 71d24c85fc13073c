"""Channels of one source on one clock."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.telemetry.series import Clock, Part, Telemetry, check_telemetry

_LEAST_SHARED = 0.5  # channels that share a smaller part of their time do not become one model
_APART = 0.5  # samples by which clocks of one rate may run apart over the whole length


def join_channels(channels: Mapping[str, Sequence[Telemetry] | Telemetry]) -> list[Telemetry]:
    """Brings channels onto one clock and cuts them to the time that all of them cover.

    Channels with other sampling intervals, or that share less than half of their time with the
    others, get telemetry of their own.

    Args:
        channels: For each channel, its telemetry, or the parts of it.

    Returns:
        Telemetry of each group of channels, in the order of the channels.

    Raises:
        InputError: If there is no channel, or a part is not telemetry.
    """
    if not channels:
        raise InputError("Expected at least one channel. Received: none. Give telemetry.")
    single = {name: _single(name, given) for name, given in channels.items()}
    groups: list[list[str]] = []
    for name, telemetry in single.items():
        for group in groups:
            if _is_alike(single[group[0]], telemetry):
                group.append(name)
                break
        else:
            groups.append([name])
    joined = []
    for group in groups:
        together = _joined([single[name] for name in group])
        most = max(len(single[name]) for name in group)
        if together is not None and len(together) >= _LEAST_SHARED * most:
            joined.append(together)
        else:
            joined += [_joined([single[name]]) for name in group]
    return joined


def _single(name: str, given: Sequence[Telemetry] | Telemetry) -> Telemetry:
    pieces = [given] if isinstance(given, Telemetry) else list(given)
    if not pieces:
        raise InputError(
            f"Expected at least one part of each channel. Received: none of {name}. Leave the "
            "channel out."
        )
    for piece in pieces:
        check_telemetry(piece)
        if len(piece.columns) > 1:
            raise InputError(
                f"Expected parts of one channel. Received: {counted(len(piece.columns), 'channel')}"
                f" in {piece.name}. Give each of its telemetry on its own."
            )
    clock = pieces[0].clock
    if len(pieces) == 1:
        return Telemetry(pieces[0].parts, (name,), clock)
    placed = [(_place(clock, piece.clock, part), part) for piece in pieces for part in piece.parts]
    placed.sort(key=lambda item: item[0])
    pairs = itertools.pairwise(placed)
    overlap = any(begin + len(part) > after for (begin, part), (after, _) in pairs)
    if overlap or not all(_is_alike(pieces[0], piece) for piece in pieces):
        raise InputError(
            f"Expected parts of {name} with one sampling interval that do not overlap. Received: "
            f"{len(pieces)} others. Correct their start and interval_s."
        )
    parts = [dataclasses.replace(part, offset_s=begin * clock.interval_s) for begin, part in placed]
    return Telemetry(tuple(parts), (name,), clock)


def _is_alike(one: Telemetry, other: Telemetry) -> bool:
    """Whether the samples of two channels can be counted by one clock, to the last of them."""
    longest_s = max(
        channel.parts[-1].offset_s + channel.interval_s * len(channel.parts[-1]) - channel.offset_s
        for channel in (one, other)
    )
    apart = abs(1 / one.interval_s - 1 / other.interval_s) * longest_s
    return one.clock.has_time == other.clock.has_time and apart <= _APART


def _joined(channels: Sequence[Telemetry]) -> Telemetry | None:
    """Returns the stretches that all channels cover; None if there are none."""
    clock = channels[0].clock
    placed = [
        [(_place(clock, channel.clock, part), part) for part in channel.parts]
        for channel in channels
    ]
    edges = sorted(
        edge
        for parts in placed
        for begin, part in parts
        for edge in ((begin, 1), (begin + len(part), -1))
    )
    # number of channels that cover the time after each edge
    covering = itertools.accumulate(change for _, change in edges)
    shared = []
    for ((low, _), (high, _)), number in zip(itertools.pairwise(edges), covering, strict=False):
        if number == len(placed) and low < high:
            pieces = [
                (part, slice(low - begin, high - begin))
                for parts in placed
                for begin, part in parts
                if begin <= low < begin + len(part)
            ]
            values = np.stack([part.values[here, 0] for part, here in pieces], axis=1)
            marks = [part.measured[here, 0] for part, here in pieces]
            measured = None if all(map(np.all, marks)) else np.stack(marks, axis=1)
            begin_s = low * clock.interval_s
            shared.append(Part(values.astype(np.float32), begin_s, measured=measured))
    names = tuple(channel.columns[0] for channel in channels)
    return Telemetry(tuple(shared), names, clock) if shared else None


def _place(clock: Clock, of_part: Clock, part: Part) -> int:
    """Returns the number of the first sample of a part on a clock."""
    since_ns = of_part.nanoseconds(part.offset_s) - clock.start_ns
    # `round` would place two halves of a sample, which follow each other, at one
    return math.floor(float(since_ns) / 1e9 / clock.interval_s + 0.5)


def one_series(
    telemetry: Telemetry | Sequence[Telemetry] | Mapping[str, Sequence[Telemetry]],
) -> Telemetry:
    """Returns telemetry, the parts of one channel, or the parts of several channels by name, as one
    series; raises InputError if they are none, or share too little time.
    """
    if isinstance(telemetry, Telemetry):
        return telemetry
    if not isinstance(telemetry, Mapping | Sequence):
        check_telemetry(telemetry)
    if not isinstance(telemetry, Mapping):
        if len(telemetry) == 1:
            check_telemetry(telemetry[0])
            return telemetry[0]
        telemetry = {getattr(next(iter(telemetry), None), "name", "telemetry"): telemetry}
    groups = join_channels(telemetry)
    if len(groups) > 1:
        raise InputError(
            "Expected channels of one sampling interval that share most of their time. Received: "
            f"{len(groups)} groups: "
            f"{'; '.join(group.name for group in groups)[:160]}. Give each group on its own."
        )
    return groups[0]
