"""Degraded modes at given places in a series: each mode begins, ends, and is followed by nominal operation."""

import dataclasses
import itertools
from collections.abc import Sequence

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.common.errors import InputError


@dataclasses.dataclass(frozen=True)
class ScheduledMode:
    """A degraded mode during some samples of a series.

    The mode acts on these samples as it does on a window with the onset 0, and the signal is nominal after the last of them. A
    stuck mechanism, for example, stands still for the fraction `severity` of the samples and then continues at the time that it
    would have reached without the fault.

    Args:
        mode: One of `degraded.MODES`.
        severity: Severity from 0 to 1.
        begin: First sample.
        length: Number of samples.

    Raises:
        InputError: If the mode is unknown or a number is out of range.
    """

    mode: str
    severity: float
    begin: int
    length: int

    def __post_init__(self):
        Degraded(self.mode, self.severity, 0.0)
        if self.begin < 0 or self.length < 1:
            raise InputError(f"Expected an event of at least one sample, from sample 0 on. Received: {self}.")

    @property
    def end(self) -> int:
        """First sample after the event."""
        return self.begin + self.length


def held_samples(scenario: Degraded | None, num_samples: int) -> tuple[int, int] | None:
    """Returns the samples of a window or series at which a stuck mechanism stands still, as its first sample and its end.

    Args:
        scenario: A degraded mode, or None.
        num_samples: Length of the window or series.

    Returns:
        None if the mechanism is not stuck.
    """
    if scenario is None or scenario.mode != "stuck" or scenario.severity == 0:
        return None
    begin = min(scenario.first_sample(num_samples), num_samples - 1)
    return begin, begin + int(round(scenario.severity * (num_samples - 1 - begin), 6)) + 1


def check_schedule(schedule: Sequence[ScheduledMode], num_samples: int) -> list[ScheduledMode]:
    """Checks that the events of a schedule do not overlap and lie within a series.

    Args:
        schedule: The events.
        num_samples: Length of the series.

    Returns:
        The events in the order of time.

    Raises:
        InputError: If two events overlap or touch, or one extends beyond the series.
    """
    ordered = sorted(schedule, key=lambda event: event.begin)
    for before, after in itertools.pairwise(ordered):
        if after.begin <= before.end:
            raise InputError(
                f"Expected events with nominal samples between them. Received: {before.mode} until sample {before.end} and {after.mode} from "
                f"sample {after.begin}. Move one."
            )
    if ordered and ordered[-1].end > num_samples:
        raise InputError(
            f"Expected events within {num_samples:,} samples. Received: {ordered[-1].mode} until sample {ordered[-1].end}. Move or shorten it."
        )
    return ordered
