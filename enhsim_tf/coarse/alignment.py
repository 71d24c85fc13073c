"""Alignment: how telemetry finds its coarse signal, which is all in which square waves and recorded
runs differ.

`waves.Waves` aligns each window by phase, offset and gain; `runs.Runs` aligns by the clock. Both
have the same methods: a simulator asks its alignment, and never which of the two it is.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from enhsim_tf.telemetry.series import Telemetry

# windows begin at a random sample below this one, so that every phase of the waves occurs
START_RANGE = 1_000_000


class Drawn(NamedTuple):
    """Coarse windows for generated telemetry."""

    coarse: np.ndarray  # float32 of shape `(windows, samples, columns)`
    nominal: np.ndarray  # the same without a degraded mode
    # of each sample the one whose value it has: itself, or the first of a mechanism that is stuck;
    # None if there is no degraded mode
    held: np.ndarray | None = None


class CleanSeries(NamedTuple):
    """A generated series without noise, float32 of shape `(samples, channels)`."""

    nominal: np.ndarray
    degraded: np.ndarray  # with the events, of which the enhancer changes all samples nearby
    drawn: Drawn | None = None  # the coarse series, as one window; None of runs


@dataclasses.dataclass(frozen=True, eq=False)
class Paired:
    """Telemetry in parts that can be judged, and the coarse run of the same parts, None for square
    waves.
    """

    telemetry: Telemetry
    run: Telemetry | None = None

    def __len__(self) -> int:
        return len(self.telemetry)

    def long_enough(self, window: int) -> "Paired | None":
        """Returns the parts that are at least a window long; None if there are none."""
        return self._both(lambda series: series.long_enough(window))

    def places_in(self, telemetry: Telemetry) -> list[int]:
        """Returns the first sample of each part among all samples of the telemetry that was cut."""
        begins_s = np.array([part.offset_s for part in self.telemetry.parts])
        # half a sample earlier, whatever the rounding
        return np.searchsorted(telemetry.time_s, begins_s - telemetry.interval_s / 2).tolist()

    def split_end(self, share: float) -> tuple["Paired | None", "Paired | None"]:
        """Splits off the end, which has this share of the samples, below 1; None for what has no
        sample.
        """
        begin = self._both(lambda series: series.split_end(share)[0])
        return begin, self._both(lambda series: series.split_end(share)[1])

    def _both(self, of: Callable[[Telemetry], Telemetry | None]) -> "Paired | None":
        telemetry = of(self.telemetry)
        return telemetry and Paired(telemetry, self.run and of(self.run))


class Enhances(Protocol):
    """What an alignment needs of an enhancer, see `enhancer.model.Enhancer`."""

    def enhance(
        self, coarse: np.ndarray, shift: np.ndarray | None = None, gain: np.ndarray | None = None
    ) -> np.ndarray:
        """Enhances windows."""

    def enhance_run(self, coarse: np.ndarray) -> np.ndarray:
        """Enhances a run without gaps."""
