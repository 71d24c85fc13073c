"""Events at places of a series, anomalies or degraded modes: given ones, which are checked, and
drawn ones, which do not overlap.
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError, counted

# drawn places of an event, before the series is said to have no place where it changes a sample
_TRIES = 100


@dataclasses.dataclass(frozen=True)
class PlacedEvent:
    """An anomaly or a degraded mode at a place in a series, which is nominal after its last
    sample.
    """

    kind: str  # of `anomalies.INJECTIONS`, `options.JOINT_KINDS` or `degraded.MODES`
    severity: float
    begin: int  # first sample
    length: int  # number of samples
    channel: str | None = None  # which it changes, of several; None: all

    @property
    def end(self) -> int:
        """First sample after the event."""
        return self.begin + self.length

    def __str__(self) -> str:
        return f"{self.kind} at {self.severity:g} from sample {self.begin} to {self.end}"


def in_order(
    events: Sequence[PlacedEvent], bounds: Sequence[tuple[int, int]], gap: int = 0
) -> list[PlacedEvent]:
    """Returns events in the order of time; raises InputError if two are less than `gap` samples
    apart or one is not within one of the parts.

    `bounds` are first sample and end of each part of the series, also of the functions below.
    """
    ordered = sorted(events, key=lambda event: event.begin)
    for event in ordered:
        if not any(start <= event.begin < event.end <= stop for start, stop in bounds):
            raise InputError(
                "Expected events of a sample or more within a part of the series, of "
                f"{counted(bounds[-1][1], 'sample')} in "
                f"{counted(len(bounds), 'part')}. Received: {event}. Choose a place that no gap "
                "and no end cuts."
            )
    for before, after in itertools.pairwise(ordered):
        if after.begin < before.end + gap:
            raise InputError(
                f"Expected events that do not overlap{' or touch' * (gap > 0)}. Received: "
                f"{before}, and {after}. Move one."
            )
    return ordered


def place_events(
    given: Sequence[PlacedEvent],
    drawn: Sequence[tuple[str, float, int]],
    bounds: Sequence[tuple[int, int]],
    gap: int,
    changes: Callable[[PlacedEvent], bool],
    rng: np.random.Generator,
) -> list[PlacedEvent]:
    """Adds events, each a kind, a severity and a length, at drawn places to given ones; returns all
    in the order of time.

    The longest are placed first, each uniformly among all places that are free and at least `gap`
    samples away from other events. A place where `changes` says that the event changes no sample is
    drawn again; after 100, InputError is raised.
    """
    placed = list(given)
    free = FreeStretches(bounds, gap)
    for event in given:
        free.take(event.begin, event.end)
    for kind, severity, length in sorted(drawn, key=lambda item: -item[2]):
        tries = (PlacedEvent(kind, severity, free.draw(length, rng), length) for _ in range(_TRIES))
        event = next(filter(changes, tries), None)
        if event is None:
            raise InputError(
                f"Expected a place where the event changes a sample. Received: {kind} at "
                f"{severity:g} over {counted(length, 'sample')}, "
                f"which changes nothing at {_TRIES} drawn places. Leave it out, or give it a "
                "higher severity or a greater length."
            )
        placed.append(event)
        free.take(event.begin, event.end)
    return sorted(placed, key=lambda event: event.begin)


class FreeStretches:
    """The free stretches of a series: samples at least `gap` away from every event in their part.

    Args:
        bounds: First sample and end of each part of the series.
        gap: Least number of samples between two events.
    """

    def __init__(self, bounds: Sequence[tuple[int, int]], gap: int):
        self.gap = gap
        self.num_taken = 0
        self._begins, self._ends = np.array(bounds, np.int64).T
        self._low = self._begins
        self._high = self._ends

    def take(self, begin: int, end: int) -> None:
        """Takes the samples of an event, which lies within a part."""
        part = np.searchsorted(self._begins, begin, "right") - 1
        first = max(begin - self.gap, self._begins[part])
        last = min(end + self.gap, self._ends[part])
        cut = slice(np.searchsorted(self._high, first, "right"), np.searchsorted(self._low, last))
        low = self._low[cut]
        high = self._high[cut]
        left = [(a, first) for a in low[:1] if a < first] + [
            (last, b) for b in high[-1:] if last < b
        ]
        self._low, self._high = (
            np.concatenate(
                [edges[: cut.start], [pair[side] for pair in left], edges[cut.stop :]]
            ).astype(np.int64)
            for side, edges in enumerate((self._low, self._high))
        )
        self.num_taken += 1

    def draw(self, length: int, rng: np.random.Generator) -> int:
        """Draws the first sample of an event of this length uniformly from all samples at which it
        fits; raises InputError if there are none.
        """
        number = np.cumsum(np.maximum(self._high - self._low - length + 1, 0))
        if not len(number) or not number[-1]:
            raise InputError(
                "Expected space for events that do not overlap. Received: "
                f"{counted(int(self._ends[-1]), 'sample')} with "
                f"{counted(self.num_taken, 'event')}, nowhere {length:,} free ones with "
                f"{self.gap:,} more on each side. Ask for fewer or shorter ones."
            )
        place = rng.integers(number[-1])
        stretch = np.searchsorted(number, place, "right")
        return int(self._high[stretch] - length + 1 - (number[stretch] - place))
