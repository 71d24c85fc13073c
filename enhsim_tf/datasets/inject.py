"""Makes a labelled test set without a simulator, by adding anomalies to a user's own nominal
telemetry.

Most kinds of anomaly change one channel. Those of `JOINT_KINDS` need several: three leave the
values of every channel as usual and change how channels move together, and one is a fault that acts
on all of them.
"""

import bisect
import dataclasses
import functools
import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.anomalies import INJECTIONS, estimate_noise_sd
from enhsim_tf.datasets.label_columns import series_table
from enhsim_tf.datasets.options import WITHOUT_SEVERITY, InjectOptions
from enhsim_tf.datasets.places import checked_place, draw_between, length_limits
from enhsim_tf.telemetry.joining import one_series
from enhsim_tf.telemetry.placing import FreeStretches, PlacedEvent, in_order, place_events
from enhsim_tf.telemetry.series import Clock, Telemetry


@dataclasses.dataclass(frozen=True, eq=False)
class Injected:
    """Telemetry with anomalies, as `inject` returns it.

    Args:
        table: One row per sample, with the index of `Telemetry.index` and the columns `value` (of
            several channels, their names, and `mask NAME` for each) and `label_columns.LABELS`.
            Samples that are not marked keep the value of the telemetry.
        anomalies: The anomalies in the order of time, each from its first to its last changed
            sample.
        noise_sd: Standard deviation of the noise of each channel, the unit of severity.
        clock: The clock of the telemetry.
    """

    table: pd.DataFrame
    anomalies: tuple[PlacedEvent, ...]
    noise_sd: tuple[float, ...]
    clock: Clock


def inject(telemetry: Telemetry | Sequence[Telemetry], options: InjectOptions) -> Injected:
    """Injects anomalies into nominal telemetry: into one channel, or into several, of which each
    anomaly changes one or, of some kinds, all.

    Args:
        telemetry: Several channels, as `join_channels` returns them, or the parts of one channel,
            as `clean` returns them.
        options: Which anomalies are injected, and where.

    Raises:
        InputError: If anomalies overlap, do not fit or change no sample, or if the noise of the
            channel cannot be estimated.
    """
    telemetry = one_series(telemetry)
    names = telemetry.columns
    if options.is_joint and len(names) < 2:
        raise InputError(
            f"Expected several channels for {', '.join(options.kinds)}. Received: {telemetry.name} "
            "alone. Give more columns."
        )
    rng = np.random.default_rng([options.seed, *([61] if len(names) > 1 else names[0].encode())])
    series = _Series(telemetry, _noise_of(telemetry, options), rng)
    drawn = _draw(options, telemetry.interval_s, rng)
    given = _given(options, telemetry, rng)
    for event in in_order(given, series.bounds):
        if not series.change(event):
            raise InputError(
                f"Expected an anomaly that changes the telemetry. Received: {event}, which changes "
                "no sample. "
                "Choose another place, a longer one or a higher severity."
            )
    longest = max([length for *_, length in drawn], default=0)
    place_events(given, drawn, series.bounds, longest, series.change, rng)
    anomalies = tuple(sorted(series.anomalies, key=lambda anomaly: anomaly.begin))
    is_changed = series.values != series.nominal
    table = series_table(series.values, is_changed, names, anomalies, telemetry.index)
    return Injected(table, anomalies, tuple(series.noise_sd.tolist()), telemetry.clock)


def _noise_of(telemetry: Telemetry, options: InjectOptions) -> np.ndarray:
    """Returns the standard deviation of the noise of each channel; raises InputError if anomalies
    need one and there is none.
    """
    noise_sd = np.array(
        [
            options.noise_sd
            or estimate_noise_sd([part.measured_values(channel) for part in telemetry.parts])
            for channel in range(len(telemetry.columns))
        ]
    )
    if not noise_sd.any() and (options.at or set(options.kinds) & set(INJECTIONS)):
        raise InputError(
            "Expected telemetry with noise, whose standard deviation is the unit of severity. "
            f"Received: {telemetry.name}, in which every "
            "second difference is zero. Give the standard deviation with --noise-sd."
        )
    return noise_sd


def _draw(
    options: InjectOptions, interval_s: float, rng: np.random.Generator
) -> list[tuple[str, float, int]]:
    """Draws kind, severity and length of the anomalies at drawn places."""
    shortest, longest = length_limits(options.length, interval_s)
    kinds = itertools.islice(itertools.cycle(options.kinds), options.number or len(options.kinds))
    return [
        (
            kind,
            1.0 if kind in WITHOUT_SEVERITY else draw_between(options.severity, rng),
            int(rng.integers(shortest, longest + 1)),
        )
        for kind in kinds
    ]


def _given(
    options: InjectOptions, telemetry: Telemetry, rng: np.random.Generator
) -> list[PlacedEvent]:
    """Returns the anomalies at given places; severities that are not given are drawn."""
    index = telemetry.index
    given = []
    for place in map(checked_place, options.at):
        severity = draw_between(options.severity, rng) if place.severity is None else place.severity
        span = place.samples(index, telemetry.interval_s)
        given.append(PlacedEvent(place.kind, severity, *span))
    return given


class _Series:
    """Telemetry of shape `(samples, channels)` into which anomalies are put."""

    def __init__(self, telemetry: Telemetry, noise_sd: np.ndarray, rng: np.random.Generator):
        self.names = telemetry.columns
        self.noise_sd = noise_sd
        self.rng = rng
        self.nominal = telemetry.values.astype(np.float32)
        self.values = self.nominal.copy()
        self.anomalies: list[PlacedEvent] = []
        lengths = map(len, telemetry.parts)
        self.bounds = list(itertools.pairwise(np.cumsum([0, *lengths]).tolist()))
        self._begins = [begin for begin, _ in self.bounds]
        self._mean = functools.cache(self._mean_of)
        self._followed = functools.cache(self._followed_by)

    def change(self, event: PlacedEvent) -> bool:
        """Puts an anomaly into the series; returns whether it has changed a sample."""
        noisy = np.flatnonzero(self.noise_sd > 0)
        among = noisy if event.kind in INJECTIONS else np.arange(len(self.names))
        here = slice(event.begin, event.end)
        channel = int(among[self.rng.integers(len(among))])
        is_common = event.kind == "common_shift"
        with np.errstate(over="ignore", invalid="ignore"):
            if is_common:
                shift = (event.severity * self.noise_sd).astype(np.float32)
                self.values[here] = self.nominal[here] + shift
            else:
                self.values[here, channel] = self._changed(event, channel)
        if not np.isfinite(self.values[here]).all():
            raise InputError(
                f"Expected anomalies within the range of float32. Received: {event}. Choose a "
                "lower severity."
            )
        places = np.flatnonzero((self.values[here] != self.nominal[here]).any(axis=1))
        if not len(places):
            return False
        begin = event.begin + int(places[0])
        length = int(places[-1] - places[0]) + 1
        name = None if is_common else self.names[channel]
        changed = dataclasses.replace(event, begin=begin, length=length, channel=name)
        self.anomalies.append(changed)
        return True

    def _changed(self, event: PlacedEvent, channel: int) -> np.ndarray:
        """Returns what a channel becomes during an anomaly of one channel."""
        values = self.nominal[:, channel]
        here = slice(event.begin, event.end)
        length = event.length
        part = bisect.bisect(self._begins, event.begin) - 1
        if event.kind in INJECTIONS:
            pieces = values[None, here].astype(np.float64)
            size = event.severity * self.noise_sd[channel]
            return INJECTIONS[event.kind](pieces, size, self._mean(part, channel), self.rng)[0]
        if event.kind == "delay":
            late = np.arange(event.begin, event.end) - max(1, length // 4)
            return values[np.maximum(late, self._begins[part])]
        free = FreeStretches(self.bounds, 0)
        free.take(event.begin, event.end)
        first = free.draw(length, self.rng)
        away = slice(first, first + length)
        if event.kind == "another_time":
            return values[away]
        followed = self._followed(channel)
        return values[here] - followed[here] + followed[away]

    def _mean_of(self, part: int, channel: int) -> np.ndarray:
        values = self.nominal[None, slice(*self.bounds[part]), channel]
        return values.mean(axis=1, dtype=np.float64, keepdims=True)

    def _followed_by(self, channel: int) -> np.ndarray:
        """The part of a channel that the other channels explain, in every sample."""
        others = np.delete(self.nominal, channel, axis=1).astype(np.float64)
        centred = others - others.mean(axis=0)
        values = self.nominal[:, channel]
        weights, *_ = np.linalg.lstsq(centred, values - values.mean(dtype=np.float64), rcond=None)
        return centred @ weights
