"""Degraded modes of the coarse simulator (sections 1 and 3 of the paper)."""

import dataclasses

from enhsim_tf.common.errors import InputError
from enhsim_tf.paper.degraded import MODES


@dataclasses.dataclass(frozen=True)
class Degraded:
    """A degraded mode of the target vehicle (paper, sections 1 and 3).

    Args:
        mode: One of `MODES`: stuck, drift, gain_loss, friction, dropout, period_change.
        severity: Severity from 0 to 1. At 0 the signal is bit-identical to the nominal one.
        onset: Start of the degradation, as a fraction of the window or series: at least 0 and less
            than 1.
        channel: The only channel that is degraded; None for all.

    Raises:
        InputError: If the mode is unknown or a number is out of range.
    """

    mode: str
    severity: float = 0.5
    onset: float = 0.25
    channel: str | None = None

    def __post_init__(self):
        if self.mode not in MODES:
            raise InputError(
                f"Expected a mode, one of: {', '.join(MODES)}. Received: mode={self.mode!r}."
            )
        if not (0 <= self.severity <= 1 and 0 <= self.onset < 1):
            raise InputError(f"Expected 0 <= severity <= 1 and 0 <= onset < 1. Received: {self}.")

    def __str__(self) -> str:
        """The mode as it is written on the command line."""
        channel = "" if self.channel is None else f"{self.channel}="
        return f"{channel}{self.mode}:{self.severity:g}:{self.onset:g}"

    def first_sample(self, num_samples: int) -> int:
        """Sample at which the degradation of a window or series of this length starts."""
        # rounded first, since 0.29 * 100 is 28.999999999999996
        return min(int(round(self.onset * num_samples, 6)), num_samples - 1)


def held_samples(scenario: Degraded | None, num_samples: int) -> tuple[int, int] | None:
    """Returns the first sample and the end at which a stuck mechanism stands still in a window or
    series; None if it is not stuck.
    """
    if scenario is None or scenario.mode != "stuck" or scenario.severity == 0:
        return None
    begin = scenario.first_sample(num_samples)
    return begin, begin + int(round(scenario.severity * (num_samples - 1 - begin), 6)) + 1
