"""Recorded runs of a user's simulator: several columns on one clock (step 3 of the pipeline, "which is also recorded").

A recording has the interface of a coarse simulator; it refuses scenarios, and times that it does not cover.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.coarse_simulator.interface import CoarseSimulator, check_columns, name_of, simulate
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry

if TYPE_CHECKING:
    import pandas as pd

SAME_RATE = 1e-3  # largest relative difference of two sampling intervals that count as one
_TOLERANCE = 1e-3  # in intervals: a time this far outside a part still belongs to it


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """A regularly sampled run without gaps; `carried` are columns that are no inputs, such as `scenario`, with a value per sample each."""

    values: np.ndarray  # float32 of shape `(samples, columns)`
    offset_s: float = 0.0  # time of the first sample in seconds after the start of the recording
    carried: Mapping[str, "pd.Series | np.ndarray"] = dataclasses.field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.values)


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """The recorded output of a simulator.

    Args:
        parts: Runs in chronological order, which share columns, interval and clock; more than one if there are gaps.
        columns: Names of the columns.
        interval_s: Sampling interval in seconds; 1 (one sample) if the recording has no times.
        start: Zero of the time axis as ISO 8601 text in UTC, or None if the recording has no times.
        name: Name in messages.
        notes: What was repaired or left out when the recording was read, one line each.
    """

    parts: tuple[Run, ...]
    columns: tuple[str, ...]
    interval_s: float = 1.0
    start: str | None = None
    name: str = "the coarse run"
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        check_columns(self.columns)
        if not self.parts or any(
            part.values.shape[1:] != (len(self.columns),) for part in self.parts
        ):
            raise InputError(
                f"Expected runs of {len(self.columns)} columns. Received: {[part.values.shape for part in self.parts]}."
            )

    def __len__(self) -> int:
        return sum(map(len, self.parts))

    @property
    def values(self) -> np.ndarray:
        """The values of all parts, one after another, float32 of shape `(samples, columns)`."""
        return np.concatenate([part.values for part in self.parts])

    def run(
        self, time_s: np.ndarray, scenario: Any = None, rng: np.random.Generator | None = None
    ) -> np.ndarray:
        """Returns what was recorded, as `at`; raises InputError if a scenario is given or a time is not covered."""
        if scenario is not None:
            raise InputError(
                f"Expected no scenario with a recorded run. Received: {str(scenario)[:80]!r}. Record a run of it and give that."
            )
        values = self.at(time_s)
        missing = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(missing):
            last_s = max(part.offset_s + self.interval_s * (len(part) - 1) for part in self.parts)
            raise InputError(
                f"Expected times that {self.name} covers, from {self.parts[0].offset_s:g} s to {last_s:g} s without gaps. "
                f"Received: {np.asarray(time_s)[missing[0]]:g} s. Give a longer recording."
            )
        return values

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Returns what was recorded at times in seconds after the start, float32 of shape `(samples, columns)`.

        Between samples it is interpolated linearly; where nothing was recorded, it is NaN.
        """
        time_s = np.asarray(time_s, np.float64)
        values = np.full((len(time_s), len(self.columns)), np.nan, np.float32)
        for part in self.parts:
            position = (time_s - part.offset_s) / self.interval_s
            inside = (position >= -_TOLERANCE) & (position <= len(part) - 1 + _TOLERANCE)
            position = position[inside]
            nearest = np.round(position)
            position = np.where(
                np.abs(position - nearest) <= _TOLERANCE, nearest, position
            )  # samples are returned unchanged
            for column in range(len(self.columns)):
                values[inside, column] = np.interp(
                    position, np.arange(len(part)), part.values[:, column]
                )
        return values

    def clock(self, part: Run | None = None) -> Telemetry:
        """Returns a series with the times of a part, or of the recording's start, whose values mean nothing."""
        length, offset_s = (1, 0.0) if part is None else (len(part), part.offset_s)
        return Telemetry(
            np.zeros(length, np.float32), self.interval_s, offset_s, self.start, self.name
        )

    def select(self, columns: Sequence[str]) -> "Recording":
        """Returns the recording with the named columns, in the given order; raises InputError if one is missing."""
        missing = [name for name in columns if name not in self.columns]
        if missing:
            raise InputError(
                f"Expected the coarse columns {', '.join(columns)[:120]}. Received: {self.name} without {missing[0]!r}. "
                "Record it, with the name that it had in the fit."
            )
        places = [self.columns.index(name) for name in columns]
        parts = tuple(
            dataclasses.replace(part, values=np.ascontiguousarray(part.values[:, places]))
            for part in self.parts
        )
        return dataclasses.replace(self, parts=parts, columns=tuple(columns))


def record(
    simulator: CoarseSimulator,
    time_s: np.ndarray,
    scenario: Any = None,
    rng: np.random.Generator | None = None,
    start: str | None = None,
    labels: Mapping[str, Any] | None = None,
) -> Recording:
    """Runs a simulator and returns a recording of its output.

    Args:
        simulator: The simulator.
        time_s: Times in seconds at a regular interval, shape `(samples,)`.
        scenario: What differs from nominal operation, or None.
        rng: Random number generator. None: one with seed 0.
        start: Zero of the time axis as ISO 8601 text, or None.
        labels: Values to carry to every sample, such as `{"scenario": "weak heater", "severity": 0.5}`; a value is one
            number or text, or an array with one element per sample.

    Raises:
        InputError: If the times are not regular, or the simulator returns something unusable.
    """
    time_s = np.asarray(time_s, np.float64)
    steps = np.diff(time_s)
    if (
        time_s.ndim != 1
        or len(time_s) < 2
        or not (steps > 0).all()
        or np.ptp(steps) > 1e-3 * steps.mean()
    ):
        raise InputError(
            f"Expected at least two ascending times at a regular interval. Received: {len(time_s)} times. Give regular times."
        )
    values = simulate(simulator, time_s, scenario, rng)
    carried = {
        name: np.broadcast_to(np.asarray(value), len(time_s))
        for name, value in (labels or {}).items()
    }
    run = Run(values, float(time_s[0]), carried)
    return Recording(
        (run,), tuple(simulator.columns), float(steps.mean()), start, name_of(simulator)
    )
