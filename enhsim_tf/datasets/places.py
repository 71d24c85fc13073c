"""Scenarios, lengths, times and places of events as they are written on the command line, and shares of windows. Nothing slow is imported."""

import dataclasses
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

_PLACE = re.compile(r"(?P<kind>\w+)(?::(?P<severity>[^@]+))?@(?P<begin>.+)/(?P<length>[^/]+)")
_SECONDS = {"d": 86_400, "h": 3_600, "min": 60, "s": 1, "ms": 1e-3}
_LENGTH = re.compile(
    r"(?P<number>[0-9]{1,15}(?:\.[0-9]{1,15}(?= *[a-z]))?) *(?P<unit>d|h|min|s|ms)?"
)  # decimals need a unit, because a number of samples is a whole number
_MOST_SAMPLES = 20_000_000  # of a series, which is held in memory


def parse_scenario(text: str) -> Degraded:
    """Parses `mode:severity` or `mode:severity:onset`, such as `stuck:0.5`, with `CHANNEL=` before it for one of several channels."""
    channel, is_named, rest = text.rpartition("=")
    mode, *numbers = rest.split(":")
    try:
        severity, onset = map(float, numbers if len(numbers) == 2 else [*numbers, Degraded.onset])
        return Degraded(mode, severity, onset, channel if is_named else None)
    except ValueError:
        raise InputError(
            f"Expected mode:severity or mode:severity:onset with numbers from 0 to 1, such as stuck:0.5, mode one of: {', '.join(MODES)}. "
            f"Received: {text!r}."
        ) from None


def parse_length(text: str) -> tuple[float, str]:
    """Parses a length such as `1d`, `6h`, `90min`, `30s`, or a number of samples.

    Returns:
        The number and its unit, for example `(86400.0, "s")` or `(5000.0, "samples")`.
    """
    found = _LENGTH.fullmatch(text.casefold())
    length = float(found["number"]) if found else 0.0
    if not 0 < length < float("inf"):
        raise InputError(f"Expected a length such as 1d, 6h, 90min, 30s or 5000 (samples). Received: {text[:80]!r}.")
    return (length * _SECONDS[found["unit"]], "s") if found["unit"] else (length, "samples")


def parse_num_samples(text: str, interval_s: float) -> int:
    """Converts a length in the form of `parse_length` to a number of samples, one every `interval_s` seconds."""
    length, unit = parse_length(str(text))
    samples = length if unit == "samples" else length / interval_s
    if not 0.5 <= samples <= _MOST_SAMPLES:
        raise InputError(
            f"Expected a length of 1 to {_MOST_SAMPLES:,} samples, one every {interval_s:g} s. Received: {str(text)[:80]!r}, which is "
            f"{samples:,.10g} samples. Write several series, each with its own --seed."
        )
    return max(1, round(samples))


def parse_start(start: "str | pd.Timestamp") -> "pd.Timestamp":
    """Converts a time such as `2024-01-01`, from 1700 to 2200, to UTC. A time without a time zone is taken as UTC."""
    import pandas as pd

    try:
        time = pd.to_datetime(start, utc=True, format="ISO8601").as_unit("ns")
    except (ValueError, TypeError, OverflowError, AttributeError):
        time = pd.NaT
    if pd.isna(time) or not 1700 <= time.year <= 2200:
        raise InputError(f"Expected a start such as 2024-01-01 or 2024-01-01T12:00, from 1700 to 2200. Received: {str(start)[:80]!r}.")
    return time


@dataclasses.dataclass(frozen=True)
class Place:
    """An event at a given place, as it was written."""

    kind: str
    severity: float | None
    begin: str  # a sample number, or a time
    length: str

    def samples(self, index: "pd.Index", interval_s: float) -> tuple[int, int]:
        """Returns the first sample and the number of samples; the index of the series has times in UTC, or is that of one without times."""
        length = parse_num_samples(self.length, interval_s)
        if self.begin.isdecimal():
            return int(self.begin[:12]), length
        time = parse_start(self.begin)
        if not hasattr(index, "tz"):
            raise InputError(f"Expected a sample number as the place, since the series has no times. Received: {self.begin[:80]!r}.")
        first = int(index.searchsorted(time))
        if time < index[0] or first == len(index) or (index[first] - time).total_seconds() > interval_s:
            raise InputError(
                f"Expected a time from {index[0].isoformat()} to {index[-1].isoformat()}, not in a gap. Received: {self.begin[:80]!r}. "
                "Choose another."
            )
        return first, length


def parse_place(text: str, severity: float | None = None) -> Place:
    """Parses `KIND[:SEVERITY]@BEGIN/LENGTH`, such as `ramp:4@5000/200` or `stuck:1@2024-01-05T12:00/2h`. The kind is not checked."""
    found = _PLACE.fullmatch(text)
    try:
        if not found:
            raise ValueError
        severity = float(found["severity"]) if found["severity"] else severity
    except ValueError:
        raise InputError(
            f"Expected KIND[:SEVERITY]@BEGIN/LENGTH, such as stuck:1@5000/200 or drift:0.5@2024-01-05T12:00/2h. Received: {text[:80]!r}."
        ) from None
    parse_length(found["length"])
    return Place(found["kind"], severity, found["begin"], found["length"])


def length_limits(limits: Sequence[str], interval_s: float) -> tuple[int, int]:
    """Converts the least and the greatest length of events to samples, one every `interval_s` seconds."""
    shortest, longest = (parse_num_samples(text, interval_s) for text in limits)
    if shortest > longest:
        raise InputError(f"Expected lengths with the least first. Received: {limits[0]}:{limits[1]}.")
    return shortest, longest


def split_limits(name: str, text: str) -> tuple[str, str]:
    """Splits `least:greatest`, the value of the option `--name`; one value stands for both."""
    least, colon, greatest = text.partition(":")
    if not least or (colon and not greatest) or ":" in greatest:
        raise InputError(f"Expected --{name} as one value, or as least:greatest. Received: --{name} {text}.")
    return least, greatest or least


def draw_between(limits: tuple[float, float], rng: np.random.Generator) -> float:
    """Draws a number uniformly between two limits; if they are equal, it is that number and nothing is drawn."""
    low, high = limits
    return low if low == high else float(rng.uniform(low, high))


@dataclasses.dataclass(frozen=True)
class Share:
    """A part of a training set: windows of one scenario, or nominal ones, with a random seed of their own."""

    scenario: Degraded | None
    num_windows: int
    seed: int


def divide_windows(scenarios: Sequence[Degraded], nominal_share: float, num_windows: int, seed: int) -> list[Share]:
    """Divides windows between nominal telemetry and scenarios. Scenarios get equal numbers; the first ones get the remainder."""
    if num_windows < 1:
        raise InputError(f"Expected at least one window. Received: --windows {num_windows}.")
    num_nominal = round(nominal_share * num_windows) if scenarios else num_windows
    each, left = divmod(num_windows - num_nominal, len(scenarios) or 1)
    counts = [num_nominal, *(each + (number < left) for number in range(len(scenarios)))]
    if scenarios and nominal_share < 1 and counts[-1] == 0:
        raise InputError(
            f"Expected at least one window for each of {len(scenarios)} scenarios. Received: {num_windows} windows, of which a share of "
            f"{nominal_share:g} is nominal. Ask for more windows."
        )
    seeds = np.random.SeedSequence(seed).generate_state(len(counts)).tolist()
    return [Share(*share) for share in zip([None, *scenarios], counts, seeds, strict=True) if share[1]]
