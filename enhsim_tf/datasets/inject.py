"""Makes a labelled test set without a simulator, by adding anomalies to a user's own nominal telemetry.

Most kinds of anomaly change one channel. Those of `JOINT_KINDS` need several: three leave the values of every channel as usual and change
how channels move together, and one is a fault that acts on all of them.
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.inject_options import InjectOptions, checked_place
from enhsim_tf.datasets.label_columns import series_table
from enhsim_tf.datasets.places import draw_between, length_limits
from enhsim_tf.detection.anomalies import estimate_noise_sd, inject_anomalies
from enhsim_tf.simulator.joint import telemetry_of
from enhsim_tf.telemetry.pandas_series import index_of
from enhsim_tf.telemetry.placing import PlacedEvent, draw_begin, place_events
from enhsim_tf.telemetry.series import Telemetry


def inject_channel(parts: Sequence[Telemetry], options: InjectOptions) -> pd.DataFrame:
    """Injects anomalies into the nominal telemetry of a channel.

    Args:
        parts: Regularly sampled parts of telemetry, as returned by `cleaning.clean`.
        options: Which anomalies are injected, and where.

    Returns:
        A data frame with the index of `pandas_series.to_series` and the columns `value` and `label_columns.LABELS`. `frame.attrs` holds
        `noise_sd`, and `anomalies`, a list of `placing.PlacedEvent` in the order of time. Samples that are not marked keep the value
        of the telemetry.

    Raises:
        InputError: If anomalies overlap, do not fit or change no sample, or if the noise of the channel cannot be estimated.
    """
    rng = np.random.default_rng([options.seed, *parts[0].name.encode()])
    values, interval_s = [part.values for part in parts], parts[0].interval_s
    noise_sd = estimate_noise_sd(values) if options.noise_sd is None else options.noise_sd
    if not noise_sd > 0:
        raise InputError(
            f"Expected telemetry with noise, whose standard deviation is the unit of severity. Received: {parts[0].name}, in which every "
            "second difference is zero. Give the standard deviation with --noise-sd."
        )
    index = index_of(parts)
    shortest, longest = length_limits(options.length, interval_s)
    number = (len(options.kinds) if options.number is None else options.number) if options.kinds else 0
    drawn = [
        (options.kinds[each % len(options.kinds)], draw_between(options.severity, rng), int(rng.integers(shortest, longest + 1)))
        for each in range(number)
    ]
    given = []
    for place in map(checked_place, options.at):
        severity = draw_between(options.severity, rng) if place.severity is None else place.severity
        given.append(PlacedEvent(place.kind, severity, *place.samples(index, interval_s)))
    gap = max([length for *_, length in drawn], default=0)
    changed, mask, anomalies = inject_anomalies(values, given, drawn, noise_sd, gap, rng)
    events = [(each.kind, each.severity, each.begin, each.end) for each in anomalies]
    frame = series_table(changed[:, None], mask[:, None], [parts[0].name], events, index)
    frame.attrs.update(noise_sd=noise_sd, anomalies=anomalies)
    return frame


def join_injected(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Joins the tables of `inject_channel` to one with the values of all channels and `mask`, which marks what is changed in any of them."""
    (first, frame), *others = frames.items()
    for name, other in others:
        if not other.index.equals(frame.index):
            raise InputError(
                f"Expected channels with the same times for one TimeEval file. Received: {first!r} with {len(frame):,} and {name!r} with "
                f"{len(other):,} samples, or other times. Give a folder as --out, which gets one file per channel."
            )
    values = {name if others else "value": each["value"] for name, each in frames.items()}
    return pd.DataFrame(values | {"mask": np.any([each["mask"] for each in frames.values()], axis=0)}, index=frame.index)


def inject_joint(telemetry: Recording, options: InjectOptions) -> pd.DataFrame:
    """Injects anomalies of `JOINT_KINDS` into nominal telemetry of several channels, at drawn places.

    Args:
        telemetry: Nominal telemetry.
        options: Which anomalies are injected. The severity is that of `common_shift`.

    Returns:
        A data frame with one row per sample: the channels, `label_columns.LABELS` and `mask NAME` for each channel. Samples that are not marked
        keep their values. `frame.attrs["anomalies"]` has kind, severity, begin, end and channel of each.
    """
    kinds = options.kinds
    if len(telemetry.columns) < 2:
        raise InputError(f"Expected several channels for {', '.join(kinds)}. Received: {telemetry.name} alone. Give more columns.")
    rng, (shortest, longest) = np.random.default_rng([options.seed, 61]), length_limits(options.length, telemetry.interval_s)
    values = telemetry.values.astype(np.float32)
    bounds, nominal = list(itertools.pairwise(np.cumsum([0, *map(len, telemetry.parts)]).tolist())), values.copy()
    noise_sd = np.array([estimate_noise_sd([part.values[:, channel] for part in telemetry.parts]) for channel in range(values.shape[1])])
    drawn = [(kinds[each % len(kinds)], 1.0, int(rng.integers(shortest, longest + 1))) for each in range(options.number or len(kinds))]
    found: list[tuple[str, float, int, int, str]] = []

    def changes(event: PlacedEvent) -> bool:
        """Puts an anomaly into the series; whether it has changed a sample."""
        is_common, here = event.kind == "common_shift", slice(event.begin, event.end)
        degree = draw_between(options.severity, rng) if is_common else 1.0
        channel = int(rng.integers(values.shape[1]))
        if is_common:
            values[here] += (degree * noise_sd).astype(np.float32)
        else:
            values[here, channel] = _changed(nominal, event.kind, here, channel, bounds, rng)
        is_changed = bool((values[here] != nominal[here]).any())
        if is_changed:
            found.append((event.kind, degree, event.begin, event.end, "all" if is_common else telemetry.columns[channel]))
        return is_changed

    place_events([], drawn, bounds, longest, changes, rng)
    found.sort(key=lambda each: each[2])
    index = index_of(telemetry_of(telemetry))
    frame = series_table(values, values != nominal, telemetry.columns, [each[:4] for each in found], index)
    frame.attrs["anomalies"] = found
    return frame


def _changed(
    nominal: np.ndarray, kind: str, here: slice, channel: int, bounds: Sequence[tuple[int, int]], rng: np.random.Generator
) -> np.ndarray:
    """Returns what a channel becomes during an anomaly of one channel."""
    length = here.stop - here.start
    if kind == "delay":
        start = next(low for low, high in bounds if low <= here.start < high)
        return nominal[np.maximum(np.arange(here.start, here.stop) - max(1, length // 4), start), channel]
    first = draw_begin(bounds, [(here.start, here.stop)], length, 0, rng)
    away = slice(first, first + length)
    if kind == "another_time":
        return nominal[away, channel]
    others = np.delete(nominal, channel, axis=1).astype(np.float64)
    centred = others - others.mean(axis=0)
    weights, *_ = np.linalg.lstsq(centred, nominal[:, channel] - nominal[:, channel].mean(dtype=np.float64), rcond=None)
    follows = centred @ weights
    return (nominal[here, channel] - follows[here] + follows[away]).astype(np.float32)
