"""Makes a labelled test set without a simulator, by adding anomalies to a user's own nominal telemetry.

Most kinds of anomaly change one channel. Those of `JOINT_KINDS` need several: three leave the values of every channel as usual and change
how channels move together, and one is a fault that acts on all of them.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.label_columns import series_table
from enhsim_tf.datasets.places import (
    WITHOUT_SEVERITY,
    InjectOptions,
    checked_place,
    draw_between,
    length_limits,
)
from enhsim_tf.detection.anomalies import INJECTIONS, estimate_noise_sd
from enhsim_tf.simulator.joint import join_channels, telemetry_of
from enhsim_tf.telemetry.pandas_series import index_of
from enhsim_tf.telemetry.placing import PlacedEvent, draw_begin, in_order, place_events
from enhsim_tf.telemetry.series import Telemetry


def inject(telemetry: Recording | Sequence[Telemetry], options: InjectOptions) -> pd.DataFrame:
    """Injects anomalies into nominal telemetry: into one channel, or into several, of which each anomaly changes one or, of some kinds, all.

    Args:
        telemetry: Several channels, as `join_channels` returns them, or the parts of one channel, as `clean` returns them.
        options: Which anomalies are injected, and where.

    Returns:
        A data frame with the index of `to_series` and the columns `value` (of several channels, their names, and `mask NAME` for each) and
        `label_columns.LABELS`. Samples that are not marked keep the value of the telemetry. `frame.attrs` holds `noise_sd` (of several
        channels a list); `anomalies`, a list of `placing.PlacedEvent` in the order of time, each from its first to its last changed sample;
        and `counts`, whether the clock counts from zero.

    Raises:
        InputError: If anomalies overlap, do not fit or change no sample, or if the noise of the channel cannot be estimated.
    """
    if not isinstance(telemetry, Recording):
        (telemetry,) = join_channels({telemetry[0].name: telemetry})
    kinds, names, interval_s = options.kinds, telemetry.columns, telemetry.interval_s
    if options.is_joint and len(names) < 2:
        raise InputError(
            f"Expected several channels for {', '.join(kinds)}. Received: {telemetry.name} alone. Give more columns."
        )
    nominal, index = telemetry.values.astype(np.float32), index_of(telemetry_of(telemetry))
    series = [
        [part.values[:, channel] for part in telemetry.parts] for channel in range(len(names))
    ]
    noise_sd = np.array([options.noise_sd or estimate_noise_sd(parts) for parts in series])
    noisy = np.flatnonzero(noise_sd > 0)
    if not len(noisy) and (options.at or set(kinds) & set(INJECTIONS)):
        raise InputError(
            f"Expected telemetry with noise, whose standard deviation is the unit of severity. Received: {telemetry.name}, in which every "
            "second difference is zero. Give the standard deviation with --noise-sd."
        )
    rng = np.random.default_rng([options.seed, *([61] if len(names) > 1 else names[0].encode())])
    shortest, longest = length_limits(options.length, interval_s)
    drawn = [
        (
            kind,
            1.0 if kind in WITHOUT_SEVERITY else draw_between(options.severity, rng),
            int(rng.integers(shortest, longest + 1)),
        )
        for kind in itertools.islice(itertools.cycle(kinds), options.number or len(kinds))
    ]
    given = []
    for place in map(checked_place, options.at):
        severity = draw_between(options.severity, rng) if place.severity is None else place.severity
        given.append(PlacedEvent(place.kind, severity, *place.samples(index, interval_s)))
    bounds = list(itertools.pairwise(np.cumsum([0, *map(len, telemetry.parts)]).tolist()))
    values, found = nominal.copy(), []

    def changes(event: PlacedEvent) -> bool:
        """Puts an anomaly into the series; whether it has changed a sample."""
        among = noisy if event.kind in INJECTIONS else np.arange(len(names))
        here, channel = slice(event.begin, event.end), int(among[rng.integers(len(among))])
        with np.errstate(over="ignore", invalid="ignore"):
            if event.kind == "common_shift":
                values[here] = nominal[here] + (event.severity * noise_sd).astype(np.float32)
            else:
                values[here, channel] = _changed(
                    nominal, event, channel, event.severity * noise_sd[channel], bounds, rng
                )
        if not np.isfinite(values[here]).all():
            raise InputError(
                f"Expected anomalies within the range of float32. Received: {event}. Choose a lower severity."
            )
        places = np.flatnonzero((values[here] != nominal[here]).any(axis=1))
        if len(places):
            begin, length = event.begin + int(places[0]), int(places[-1] - places[0]) + 1
            name = None if event.kind == "common_shift" else names[channel]
            found.append(dataclasses.replace(event, begin=begin, length=length, channel=name))
        return len(places) > 0

    for event in in_order(given, bounds):
        if not changes(event):
            raise InputError(
                f"Expected an anomaly that changes the telemetry. Received: {event}, which changes no sample. "
                "Choose another place, a longer one or a higher severity."
            )
    place_events(
        given, drawn, bounds, max([length for *_, length in drawn], default=0), changes, rng
    )
    found.sort(key=lambda each: each.begin)
    frame = series_table(
        values,
        values != nominal,
        names,
        [(each.kind, each.severity, each.begin, each.end) for each in found],
        index,
    )
    frame.attrs.update(
        noise_sd=noise_sd.squeeze().tolist(), anomalies=found, counts=telemetry.clock().counts
    )
    return frame


def _changed(
    nominal: np.ndarray,
    event: PlacedEvent,
    channel: int,
    size: float,
    bounds: Sequence[tuple[int, int]],
    rng: np.random.Generator,
) -> np.ndarray:
    """Returns what a channel becomes during an anomaly of one channel."""
    here, length = slice(event.begin, event.end), event.length
    start, stop = next(each for each in bounds if each[0] <= event.begin < each[1])
    if event.kind in INJECTIONS:
        centre = nominal[None, start:stop, channel].mean(axis=1, dtype=np.float64, keepdims=True)
        return INJECTIONS[event.kind](
            nominal[None, here, channel].astype(np.float64), size, centre, rng
        )[0]
    if event.kind == "delay":
        return nominal[
            np.maximum(np.arange(event.begin, event.end) - max(1, length // 4), start), channel
        ]
    first = draw_begin(bounds, [(event.begin, event.end)], length, 0, rng)
    away = slice(first, first + length)
    if event.kind == "another_time":
        return nominal[away, channel]
    others = np.delete(nominal, channel, axis=1).astype(np.float64)
    centred = others - others.mean(axis=0)
    weights, *_ = np.linalg.lstsq(
        centred, nominal[:, channel] - nominal[:, channel].mean(dtype=np.float64), rcond=None
    )
    follows = centred @ weights
    return nominal[here, channel] - follows[here] + follows[away]
