"""Parses the places of events on the command line, `KIND[:SEVERITY]@BEGIN/LENGTH`, and the ranges of their random lengths."""

import dataclasses
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.labelled_windows import parse_length, parse_start

if TYPE_CHECKING:
    import pandas as pd

_FORM = re.compile(r"(?P<kind>\w+)(?::(?P<severity>[^@]+))?@(?P<begin>.+)/(?P<length>[^/]+)")


@dataclasses.dataclass(frozen=True)
class Place:
    """An event at a given place.

    Args:
        kind: Kind of the event.
        severity: Severity, or None if it is not given.
        begin: A sample number, or a time.
        length: A length in the form of `labelled_windows.parse_length`.
    """

    kind: str
    severity: float | None
    begin: str
    length: str

    def samples(self, index: "pd.Index", interval_s: float) -> tuple[int, int]:
        """Returns the first sample and the number of samples.

        Args:
            index: Index of the series: times in UTC, or anything else for a series without times.
            interval_s: Sampling interval in seconds.

        Raises:
            InputError: If the place is a time outside the series, or in a gap of it.
        """
        length = num_samples(self.length, interval_s)
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


def parse_place(text: str) -> Place:
    """Parses `KIND[:SEVERITY]@BEGIN/LENGTH`. The kind itself is not checked.

    Args:
        text: The place, for example `ramp:4@5000/200` or `stuck:1@2024-01-05T12:00/2h`.

    Raises:
        InputError: If the text has another form.
    """
    found = _FORM.fullmatch(text)
    try:
        if not found:
            raise ValueError
        severity = float(found["severity"]) if found["severity"] else None
    except ValueError:
        raise InputError(
            f"Expected KIND[:SEVERITY]@BEGIN/LENGTH, such as stuck:1@5000/200 or drift:0.5@2024-01-05T12:00/2h. Received: {text[:80]!r}."
        ) from None
    parse_length(found["length"])
    return Place(found["kind"], severity, found["begin"], found["length"])


def num_samples(text: str, interval_s: float) -> int:
    """Converts the length of an event to samples, at least one.

    Args:
        text: The length, in the form of `labelled_windows.parse_length`.
        interval_s: Sampling interval in seconds.

    Raises:
        InputError: If the length is less than a sample.
    """
    length, unit = parse_length(str(text))
    samples = length if unit == "samples" else length / interval_s
    if not 0.5 <= samples < 1e9:
        raise InputError(f"Expected a length of at least one sample, one every {interval_s:g} s. Received: {str(text)[:40]!r}.")
    return max(1, round(samples))


def length_limits(limits: Sequence[str], interval_s: float) -> tuple[int, int]:
    """Converts the least and the greatest length of events to samples.

    Args:
        limits: The two lengths.
        interval_s: Sampling interval in seconds.

    Raises:
        InputError: If the first is greater than the second.
    """
    shortest, longest = (num_samples(text, interval_s) for text in limits)
    if shortest > longest:
        raise InputError(f"Expected lengths with the least first. Received: {limits[0]}:{limits[1]}.")
    return shortest, longest


def split_limits(name: str, text: str) -> tuple[str, str]:
    """Splits `least:greatest`; one value stands for both.

    Args:
        name: Name of the option, for messages.
        text: Its value.

    Raises:
        InputError: If there are more than two values, or an empty one.
    """
    least, colon, greatest = text.partition(":")
    if not least or (colon and not greatest) or ":" in greatest:
        raise InputError(f"Expected --{name} as one value, or as least:greatest. Received: --{name} {text}.")
    return least, greatest or least


def draw_between(limits: tuple[float, float], rng: np.random.Generator) -> float:
    """Draws a number uniformly between two limits; if they are equal, it is that number and nothing is drawn."""
    low, high = limits
    return low if low == high else float(rng.uniform(low, high))
