"""Events at places of a series, anomalies or degraded modes: given ones, which are checked, and drawn ones, which do not overlap."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError, counted

_TRIES = 100  # drawn places of an event, before the series is said to have no place where it changes a sample


@dataclasses.dataclass(frozen=True)
class PlacedEvent:
    """An anomaly or a degraded mode at a place in a series, which is nominal after its last sample."""

    kind: str  # of `anomalies.INJECTIONS`, `places.JOINT_KINDS` or `degraded.MODES`
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
    """Returns events in the order of time; raises InputError if two are less than `gap` samples apart or one is not within one of the parts.

    `bounds` are first sample and end of each part of the series, also of the functions below.
    """
    ordered = sorted(events, key=lambda event: event.begin)
    for event in ordered:
        if not any(start <= event.begin < event.end <= stop for start, stop in bounds):
            raise InputError(
                f"Expected events of a sample or more within a part of the series, of {counted(bounds[-1][1], 'sample')} in "
                f"{counted(len(bounds), 'part')}. Received: {event}. Choose a place that no gap and no end cuts."
            )
    for before, after in itertools.pairwise(ordered):
        if after.begin < before.end + gap:
            raise InputError(
                f"Expected events that do not overlap{' or touch' * (gap > 0)}. Received: {before}, and {after}. Move one."
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
    """Adds events, each a kind, a severity and a length, at drawn places to given ones; returns all in the order of time.

    The longest are placed first, each uniformly among all places that are free and at least `gap` samples away from other events. A place
    where `changes` says that the event changes no sample is drawn again; after 100, InputError is raised.
    """
    placed = list(given)
    for kind, severity, length in sorted(drawn, key=lambda each: -each[2]):
        taken = [(event.begin, event.end) for event in placed]
        tries = (
            PlacedEvent(kind, severity, draw_begin(bounds, taken, length, gap, rng), length)
            for _ in range(_TRIES)
        )
        event = next(filter(changes, tries), None)
        if event is None:
            raise InputError(
                f"Expected a place where the event changes a sample. Received: {kind} at {severity:g} over {counted(length, 'sample')}, "
                f"which changes nothing at {_TRIES} drawn places. Leave it out, or give it a higher severity or a greater length."
            )
        placed.append(event)
    return sorted(placed, key=lambda event: event.begin)


def draw_begin(
    bounds: Sequence[tuple[int, int]],
    taken: Sequence[tuple[int, int]],
    length: int,
    gap: int,
    rng: np.random.Generator,
) -> int:
    """Draws the first sample of an event of this length uniformly from all samples at which it fits; raises InputError if there are none.

    `taken` are first sample and end of the events that are placed already, and `gap` is the least number of samples between two events.
    """
    places = [np.zeros(0, np.int64)]
    for start, stop in bounds:
        begin = start
        for first, end in [
            *sorted(each for each in taken if start <= each[0] < stop),
            (stop + gap, stop),
        ]:
            places.append(np.arange(begin, first - gap - length + 1))
            begin = end + gap
    free = np.concatenate(places)
    if not len(free):
        raise InputError(
            f"Expected room for events that do not overlap. Received: {counted(bounds[-1][1], 'sample')} with "
            f"{counted(len(taken), 'event')}, nowhere {length:,} free ones with {gap:,} more on each side. Ask for fewer or shorter ones."
        )
    return int(free[rng.integers(len(free))])
