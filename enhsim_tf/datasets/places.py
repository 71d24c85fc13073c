"""Scenarios, lengths, times and places of events as they are written on the command line.

Nothing slow is imported, since they are checked before anything else.
"""

import dataclasses
import functools
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse.degraded import MODES, Degraded
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.anomalies import check_kind

if TYPE_CHECKING:
    import pandas as pd

_PLACE = re.compile(r"(?P<kind>\w+)(?::(?P<severity>[^@]+))?@(?P<begin>.+)/(?P<length>[^/]+)")
_SECONDS = {"d": 86_400, "h": 3_600, "min": 60, "s": 1, "ms": 1e-3}
_LENGTH = re.compile(
    r"(?P<number>[0-9]{1,15}(?:\.[0-9]{1,15}(?= *[a-z]))?) *(?P<unit>d|h|min|s|ms)?"
)  # decimals need a unit, because a number of samples is a whole number
_MOST_SAMPLES = 20_000_000  # of a series, which is held in memory
# thousands of windows of one scenario without a range share one object
_degraded = functools.lru_cache(128)(Degraded)


@dataclasses.dataclass(frozen=True)
class ScenarioRange:
    """A degraded mode whose severity and onset are drawn for each window or event.

    Args:
        mode: One of `degraded.MODES`.
        severity: Least and greatest severity, from 0 to 1.
        onset: Least and greatest onset, as a share of the window or series: at least 0 and less
            than 1.
        channel: The only channel that is degraded; None for all.

    Raises:
        InputError: If the mode is unknown, a number is out of range, or a range has the greater
            number first.
    """

    mode: str
    severity: tuple[float, float]
    onset: tuple[float, float] = (Degraded.onset, Degraded.onset)
    channel: str | None = None

    def __post_init__(self):
        for severity, onset in zip(self.severity, self.onset, strict=True):
            Degraded(self.mode, severity, onset)  # checks all three
        if self.severity[0] > self.severity[1] or self.onset[0] > self.onset[1]:
            raise InputError(
                f"Expected ranges with the lower number first. Received: {self.severity} and "
                f"{self.onset}."
            )

    def __str__(self) -> str:
        """The mode and its severity, such as `stuck at 0.2-0.8`."""
        return f"{self.mode} at {'-'.join(f'{limit:g}' for limit in dict.fromkeys(self.severity))}"

    def draw(self, rng: np.random.Generator) -> Degraded:
        """Draws the scenario of a window or event."""
        return _degraded(
            self.mode, draw_between(self.severity, rng), draw_between(self.onset, rng), self.channel
        )


def parse_scenario(text: str) -> ScenarioRange:
    """Parses `[CHANNEL=]MODE:SEVERITY[:ONSET]`, in which both are a number or a range `low-high`,
    such as `volts=stuck:0.2-0.8:0.5`.
    """
    channel, is_named, rest = text.rpartition("=")
    mode, *numbers = rest.split(":")
    try:
        severity, onset = map(
            _limits, numbers if len(numbers) == 2 else [*numbers, str(Degraded.onset)]
        )
        return ScenarioRange(mode, severity, onset, channel if is_named else None)
    except ValueError:
        raise InputError(
            "Expected MODE:SEVERITY or MODE:SEVERITY:ONSET with numbers from 0 to 1 (the onset "
            "below 1) or ranges low-high, such as stuck:0.5 "
            f"or stuck:0.2-0.8:0.1-0.9, mode one of: {', '.join(MODES)}. Received: {text!r}."
        ) from None


def _limits(text: str) -> tuple[float, float]:
    # the hyphen of 1e-3 follows a letter
    numbers = [float(number) for number in re.split(r"(?<=[\d.])-", text, maxsplit=1)]
    return numbers[0], numbers[-1]


def parse_length(text: str) -> tuple[float, str]:
    """Parses a length such as `1d`, `6h`, `90min`, `30s`, or a number of samples.

    Returns:
        The number and its unit, for example `(86400.0, "s")` or `(5000.0, "samples")`.
    """
    match = _LENGTH.fullmatch(text.casefold())
    length = float(match["number"]) if match else 0.0
    if length == 0:
        raise InputError(
            "Expected a length such as 1d, 6h, 90min, 30s or 5000 (samples). Received: "
            f"{text[:80]!r}."
        )
    return (length * _SECONDS[match["unit"]], "s") if match["unit"] else (length, "samples")


def parse_num_samples(text: str, interval_s: float) -> int:
    """Converts a length in the form of `parse_length` to a number of samples, one every
    `interval_s` seconds.
    """
    length, unit = parse_length(str(text))
    samples = length if unit == "samples" else length / interval_s
    if not 0.5 <= samples <= _MOST_SAMPLES:
        raise InputError(
            f"Expected a length of 1 to {_MOST_SAMPLES:,} samples, one every {interval_s:g} s. "
            f"Received: {str(text)[:80]!r}, which is "
            f"{samples:,.10g} samples. Write several series, each with its own --seed."
        )
    return max(1, round(samples))


def parse_start(start: "str | pd.Timestamp") -> "pd.Timestamp":
    """Converts a time such as `2024-01-01`, from 1700 to 2200, to UTC. A time without a time zone
    is taken as UTC.
    """
    import pandas as pd

    try:
        time = pd.to_datetime(start, utc=True, format="ISO8601").as_unit("ns")
    except (ValueError, TypeError, OverflowError, AttributeError):
        time = pd.NaT
    if pd.isna(time) or not 1700 <= time.year <= 2200:
        raise InputError(
            "Expected a start such as 2024-01-01 or 2024-01-01T12:00, from 1700 to 2200. "
            f"Received: {str(start)[:80]!r}."
        )
    return time


@dataclasses.dataclass(frozen=True)
class Place:
    """An event at a given place, as it was written."""

    kind: str
    severity: float | None
    begin: str  # a sample number, or a time
    length: str

    def samples(self, index: "pd.Index", interval_s: float) -> tuple[int, int]:
        """Returns the first sample and the number of samples; the index of the series has times in
        UTC, or is that of one without times.
        """
        length = parse_num_samples(self.length, interval_s)
        if self.begin.isdecimal():
            return int(self.begin[:12]), length
        time = parse_start(self.begin)
        if not hasattr(index, "tz"):
            raise InputError(
                "Expected a sample number as the place, since the series has no times. Received: "
                f"{self.begin[:80]!r}."
            )
        first = int(index.searchsorted(time))
        if (
            time < index[0]
            or first == len(index)
            or (index[first] - time).total_seconds() > interval_s
        ):
            raise InputError(
                f"Expected a time from {index[0].isoformat()} to {index[-1].isoformat()}, not in a "
                f"gap. Received: {self.begin[:80]!r}. "
                "Choose another."
            )
        return first, length


def parse_place(text: str, severity: float | None = None) -> Place:
    """Parses `KIND[:SEVERITY]@BEGIN/LENGTH`, such as `ramp:4@5000/200` or
    `stuck:1@2024-01-05T12:00/2h`. The kind is not checked.
    """
    match = _PLACE.fullmatch(text)
    try:
        if not match:
            raise ValueError
        severity = float(match["severity"]) if match["severity"] else severity
    except ValueError:
        raise InputError(
            "Expected KIND[:SEVERITY]@BEGIN/LENGTH, such as stuck:1@5000/200 or "
            f"drift:0.5@2024-01-05T12:00/2h. Received: {text[:80]!r}."
        ) from None
    parse_length(match["length"])
    return Place(match["kind"], severity, match["begin"], match["length"])


def length_limits(limits: Sequence[str], interval_s: float) -> tuple[int, int]:
    """Converts the least and the greatest length of events to samples, one every `interval_s`
    seconds.
    """
    shortest, longest = (parse_num_samples(text, interval_s) for text in limits)
    if shortest > longest:
        raise InputError(
            f"Expected lengths with the least first. Received: {limits[0]}:{limits[1]}."
        )
    return shortest, longest


def draw_between(limits: tuple[float, float], rng: np.random.Generator) -> float:
    """Draws a number uniformly between two limits; if they are equal, it is that number and nothing
    is drawn.
    """
    low, high = limits
    return low if low == high else float(rng.uniform(low, high))


def checked_place(text: str) -> Place:
    """Parses a place with a kind of anomaly and its severity, and checks them."""
    place = parse_place(text)
    check_kind(place.kind, 1.0 if place.severity is None else place.severity)
    return place
