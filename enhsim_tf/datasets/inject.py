"""Makes a labelled test set without a simulator, by adding anomalies to a user's own nominal telemetry."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.label_columns import label_samples
from enhsim_tf.datasets.labelled_windows import parse_length
from enhsim_tf.datasets.places import Place, draw_between, length_limits, parse_place
from enhsim_tf.detection.anomalies import INJECTIONS, Anomaly, check_kind, estimate_noise_sd, inject_anomalies
from enhsim_tf.telemetry.series import Telemetry

if TYPE_CHECKING:
    import pandas as pd

_MOST = 10_000  # anomalies in a channel


@dataclasses.dataclass(frozen=True)
class InjectOptions:
    """Settings of `inject_channel`.

    Args:
        kinds: Kinds of the anomalies whose places are drawn, keys of `anomalies.INJECTIONS`. They are used in turn.
        severity: Least and greatest severity, in units of the standard deviation of the noise. Each anomaly draws its own.
        length: Least and greatest length, in the form of `labelled_windows.parse_length`: samples, or a time such as `10min`. Each
            anomaly draws its own.
        number: Number of anomalies whose places are drawn. None: one of each kind.
        at: Anomalies at given places, `KIND[:SEVERITY]@BEGIN/LENGTH`. BEGIN is a sample number or a time. The severity is drawn if it
            is not given.
        gap: Least number of samples between a drawn anomaly and any other. None: the length of the longest drawn anomaly.
        noise_sd: Standard deviation of the noise, in the unit of the channel. None: `anomalies.estimate_noise_sd`.
        seed: Random seed. Each channel draws from its own generator, which depends on the seed and the name of the channel.

    Raises:
        InputError: If a kind is unknown or a number is out of range.
    """

    kinds: Sequence[str] = ()
    severity: tuple[float, float] = (4.0, 4.0)
    length: tuple[str, str] = ("100", "100")
    number: int | None = None
    at: Sequence[str] = ()
    gap: int | None = None
    noise_sd: float | None = None
    seed: int = 0

    def __post_init__(self):
        low, high = self.severity
        for kind in self.kinds:
            check_kind(kind, low)
        if not (0 <= low <= high and (high < np.inf or low == high)):
            raise InputError(f"Expected severities from 0 on, the least first. Received: {low:g}:{high:g}.")
        if not self.kinds and not self.at:
            raise InputError(f"Expected kinds of anomaly or places. Received: neither. Give --kinds, of {', '.join(INJECTIONS)}, or --at.")
        if self.number is not None and (not 1 <= self.number <= _MOST or not self.kinds):
            raise InputError(f"Expected 1 to {_MOST:,} anomalies with drawn places, of given kinds. Received: number={self.number}.")
        if self.gap is not None and self.gap < 0:
            raise InputError(f"Expected a gap of 0 or more samples. Received: gap={self.gap}.")
        if self.noise_sd is not None and not 0 < self.noise_sd < np.inf:
            raise InputError(f"Expected a standard deviation of the noise above 0. Received: noise_sd={self.noise_sd}.")
        for text in self.length:
            parse_length(str(text))
        for text in self.at:
            _checked_place(text)


def inject_channel(parts: Sequence[Telemetry], options: InjectOptions) -> "pd.DataFrame":
    """Injects anomalies into the nominal telemetry of a channel.

    Args:
        parts: Regularly sampled parts of telemetry, as returned by `cleaning.clean`.
        options: Which anomalies are injected, and where.

    Returns:
        A data frame with the index of `sources.to_series` and the columns `value` and `label_columns.LABELS`. `frame.attrs` holds
        `noise_sd`, and `anomalies`, a list of `anomalies.Anomaly` in the order of time. Samples that are not marked keep the value
        of the telemetry.

    Raises:
        InputError: If anomalies overlap, do not fit or change no sample, or if the noise of the channel cannot be estimated.
    """
    import pandas as pd

    from enhsim_tf.telemetry.pandas_series import to_series

    rng = np.random.default_rng([options.seed, *parts[0].name.encode()])
    values, interval_s = [part.values for part in parts], parts[0].interval_s
    noise_sd = estimate_noise_sd(values) if options.noise_sd is None else options.noise_sd
    if not noise_sd > 0:
        raise InputError(
            f"Expected telemetry with noise, whose standard deviation is the unit of severity. Received: {parts[0].name}, in which every "
            "second difference is zero. Give the standard deviation with --noise-sd."
        )
    index = pd.concat([to_series(part) for part in parts]).index
    shortest, longest = length_limits(options.length, interval_s)
    number = (len(options.kinds) if options.number is None else options.number) if options.kinds else 0
    drawn = [
        (options.kinds[each % len(options.kinds)], draw_between(options.severity, rng), int(rng.integers(shortest, longest + 1)))
        for each in range(number)
    ]
    given = []
    for place in map(_checked_place, options.at):
        severity = draw_between(options.severity, rng) if place.severity is None else place.severity
        given.append(Anomaly(place.kind, severity, *place.samples(index, interval_s)))
    gap = max([length for *_, length in drawn], default=0) if options.gap is None else options.gap
    changed, mask, anomalies = inject_anomalies(values, given, drawn, noise_sd, gap, rng)
    events = [(each.kind, each.severity, each.begin, each.end) for each in anomalies]
    frame = pd.DataFrame({"value": changed, **label_samples(mask, events)}, index=index)
    frame.attrs.update(noise_sd=noise_sd, anomalies=anomalies)
    return frame


def _checked_place(text: str) -> Place:
    place = parse_place(text)
    check_kind(place.kind, 1.0 if place.severity is None else place.severity)
    return place
