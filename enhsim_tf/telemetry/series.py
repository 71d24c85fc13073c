"""The telemetry series, which all other packages work on: values of one or several channels with
their times.

This is the data source, step 4 of the paper's pipeline. Values are checked but never changed or
interpreted.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

SAME_RATE = 1e-3  # largest relative difference of two sampling intervals that count as one
_MAX_S = 9_223_372_036  # largest number of seconds from 1970 that fits into 64-bit nanoseconds
_TOLERANCE = 1e-3  # in intervals: a time this far outside a part still belongs to it
DATES = "dates"
COUNTED = "counted"
SAMPLES = "samples"
"""Kinds of clocks: of dates, of seconds from a zero of its own, and of samples that are counted."""


@dataclasses.dataclass(frozen=True)
class Clock:
    """The times of a series, which begin at a zero and are an interval apart.

    Args:
        interval_s: Sampling interval in seconds. It is 1 (one sample) if samples are counted.
        start_ns: Zero of the times in nanoseconds since 1970 in UTC, or since the clock's own zero.
        kind: `DATES`, `COUNTED` or `SAMPLES`.
    """

    interval_s: float = 1.0
    start_ns: int = 0
    kind: str = SAMPLES

    def __post_init__(self):
        if not abs(self.start_ns) < _MAX_S * 10**9:
            raise InputError(
                f"Expected times from 1678 to 2261. Received: start={self.start_ns / 1e9:g} s "
                "since 1970. Correct it."
            )

    @classmethod
    def of(cls, interval_s: float = 1.0, start: str | None = None) -> "Clock":
        """Makes a clock with a zero as ISO 8601 text in UTC. Dates of 1970 are those of a clock
        that counts from zero; without a zone they are in UTC; None counts samples.
        """
        if start is None:
            return cls(interval_s)
        import pandas as pd  # it parses every form of ISO 8601, with any zone

        try:
            stamp = pd.Timestamp(start if start[0].isdigit() else None)  # it would accept "now"
            stamp = stamp.tz_localize("UTC") if stamp.tz is None else stamp.tz_convert("UTC")
            start_ns = stamp.as_unit("ns").value
        except (ValueError, TypeError, AttributeError, IndexError):
            raise InputError(
                "Expected start as an ISO 8601 time from 1678 to 2261. Received: "
                f"{str(start)[:80]!r}. Correct it."
            ) from None
        kind = COUNTED if stamp.year == 1970 else DATES
        return cls(interval_s, start_ns, kind)

    @property
    def has_time(self) -> bool:
        """Whether the source has times."""
        return self.kind != SAMPLES

    @property
    def counts(self) -> bool:
        """Whether the times count from a zero of their own."""
        return self.kind == COUNTED

    @property
    def unit(self) -> str:
        """Unit of the time axis: "s", or "samples" if the source has no times."""
        return "s" if self.has_time else "samples"

    def nanoseconds(self, since_s: np.ndarray | float) -> np.ndarray:
        """Returns times, given in seconds after the zero, in nanoseconds since 1970 in UTC, or
        since the clock's own zero or sample 0; int64 of the same shape.

        Raises:
            InputError: If one lies outside the years 1678 to 2261, the range of int64 nanoseconds.
        """
        since_s = np.asarray(since_s, np.float64)
        start_s = self.start_ns / 1e9
        size = max(np.abs(since_s).max(initial=0), np.abs(start_s + since_s).max(initial=0))
        if not size < _MAX_S:
            raise InputError(
                f"Expected times from 1678 to 2261. Received: times up to {size:g} s. Correct them."
            )
        return self.start_ns + np.round(since_s * 1e9).astype(np.int64)

    def index(self, since_s: np.ndarray) -> "pd.Index":
        """Returns times, given in seconds after the zero, as a `DatetimeIndex` in UTC, or a
        `RangeIndex` of sample numbers if there are no times.
        """
        import pandas as pd

        if not self.has_time:
            first = round(float(since_s[0])) if len(since_s) else 0
            return pd.RangeIndex(first, first + len(since_s), name="sample")
        stamps = self.nanoseconds(since_s).astype("datetime64[ns]")
        return pd.DatetimeIndex(stamps, tz="UTC", name="time")


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """Regular samples without gaps.

    Args:
        values: float32 array of shape `(samples, channels)`.
        offset_s: Time of the first sample in seconds after the zero of the clock, or in samples.
        carried: Columns that are no channels, such as `scenario`, with a value per sample each.
        measured: Which values were measured and not filled in, of the shape of `values`; all, if
            it is not given.
    """

    values: np.ndarray
    offset_s: float = 0.0
    carried: Mapping[str, "pd.Series | np.ndarray"] = dataclasses.field(default_factory=dict)
    measured: np.ndarray | None = None

    def __post_init__(self):
        if self.measured is None:
            object.__setattr__(self, "measured", np.broadcast_to(True, self.values.shape))

    def measured_values(self, channel: int) -> np.ndarray:
        """The values of a channel that were measured, one after another."""
        return self.values[self.measured[:, channel], channel]

    def cut(self, first: int, stop: int, interval_s: float) -> "Part":
        """The samples from `first` up to, but not including, `stop`."""
        return Part(
            self.values[first:stop],
            self.offset_s + interval_s * first,
            {name: values[first:stop] for name, values in self.carried.items()},
            self.measured[first:stop],
        )

    def __len__(self) -> int:
        return len(self.values)


@dataclasses.dataclass(frozen=True, eq=False)
class Telemetry:
    """A regularly sampled series of one or several channels. A recorded run of a simulator is one,
    and is itself a coarse simulator, which refuses scenarios and times that it does not cover.

    Args:
        parts: Parts between gaps, in chronological order; all share channels and clock.
        columns: Names of the channels.
        clock: Zero and interval of the times.
        name: Name in messages. None: the names of the channels.
        notes: What was repaired or left out when it was read, one line each.

    Raises:
        InputError: If the names are not different texts, or the parts have other channels.
    """

    parts: tuple[Part, ...]
    columns: tuple[str, ...]
    clock: Clock = Clock()
    name: str | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        names = check_columns(self.columns)
        shapes = [part.values.shape for part in self.parts]
        if not shapes or any(shape[1:] != (len(names),) for shape in shapes):
            raise InputError(
                f"Expected parts of {len(names)} channels. Received: {shapes}. Give each channel a "
                "name."
            )
        object.__setattr__(self, "columns", names)
        object.__setattr__(self, "name", ", ".join(names) if self.name is None else self.name)

    @classmethod
    def of(
        cls,
        values: np.ndarray,
        interval_s: float = 1.0,
        offset_s: float = 0.0,
        start: str | None = None,
        name: str | Sequence[str] = "telemetry",
    ) -> "Telemetry":
        """Makes telemetry without gaps.

        Args:
            values: Array of shape `(samples,)`, or `(samples, channels)`.
            interval_s: Sampling interval in seconds.
            offset_s: Time of the first sample in seconds after `start`.
            start: Zero of the times as ISO 8601 text in UTC, or None if samples are counted.
            name: Name of the channel, or names of the channels.
        """
        values = np.asarray(values)
        names = (name,) if isinstance(name, str) else tuple(name)
        part = Part(values[:, None] if values.ndim == 1 else values, offset_s)
        return cls((part,), names, Clock.of(interval_s, start))

    def __len__(self) -> int:
        return sum(map(len, self.parts))

    @property
    def values(self) -> np.ndarray:
        """The values of all parts, one after another, of shape `(samples, channels)`."""
        return np.concatenate([part.values for part in self.parts])

    @property
    def interval_s(self) -> float:
        """Sampling interval in seconds; 1 (one sample) if samples are counted."""
        return self.clock.interval_s

    @property
    def start(self) -> str | None:
        """Zero of the times as ISO 8601 text in UTC, or None if samples are counted."""
        return iso_time(self.clock.start_ns) if self.clock.has_time else None

    @property
    def offset_s(self) -> float:
        """Time of the first sample in seconds after the zero of the clock."""
        return self.parts[0].offset_s

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample in seconds after the zero of the clock, float64 of shape
        `(samples,)`.
        """
        return np.concatenate(
            [part.offset_s + self.interval_s * np.arange(len(part)) for part in self.parts]
        )

    @property
    def nanoseconds(self) -> np.ndarray:
        """Time of each sample, see `Clock.nanoseconds`."""
        return self.clock.nanoseconds(self.time_s)

    @property
    def index(self) -> "pd.Index":
        """Time of each sample, see `Clock.index`."""
        indices = [self.clock.index(piece.time_s) for piece in self.pieces()]
        return indices[0].append(indices[1:])

    def pieces(self) -> list["Telemetry"]:
        """The parts as telemetry of their own."""
        return [dataclasses.replace(self, parts=(part,)) for part in self.parts]

    def part(self, first: int, stop: int) -> "Telemetry":
        """The samples of the first part from `first` up to, but not including, `stop`."""
        piece = self.parts[0].cut(first, stop, self.interval_s)
        return dataclasses.replace(self, parts=(piece,))

    def long_enough(self, window: int) -> "Telemetry | None":
        """The parts that are at least a window long; None if there are none."""
        parts = tuple(part for part in self.parts if len(part) >= window)
        return dataclasses.replace(self, parts=parts) if parts else None

    def split_end(self, share: float) -> tuple["Telemetry | None", "Telemetry | None"]:
        """Beginning and end, which has this share of the samples, below 1; None for what has no
        sample.
        """
        left = len(self) - round(share * len(self))
        begin: list[Part] = []
        end: list[Part] = []
        for part in self.parts:
            cut = min(max(left, 0), len(part))
            begin.append(part.cut(0, cut, self.interval_s))
            end.append(part.cut(cut, len(part), self.interval_s))
            left -= len(part)
        halves = (tuple(filter(len, parts)) for parts in (begin, end))
        return tuple(dataclasses.replace(self, parts=half) if half else None for half in halves)

    def select(self, columns: Sequence[str]) -> "Telemetry":
        """The named channels, in the given order; raises InputError if one is missing."""
        missing = [name for name in columns if name not in self.columns]
        if missing:
            raise InputError(
                f"Expected the columns {', '.join(columns)[:120]}. Received: {self.name} without "
                f"{missing[0]!r}. Record it, with the name that it had in the fit."
            )
        places = [self.columns.index(name) for name in columns]
        parts = tuple(
            dataclasses.replace(
                part,
                values=np.ascontiguousarray(part.values[:, places]),
                measured=part.measured[:, places],
            )
            for part in self.parts
        )
        return dataclasses.replace(self, parts=parts, columns=tuple(columns))

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Returns the values at times in seconds after the zero of the clock, float32 of shape
        `(samples, channels)`.

        Between samples they are interpolated linearly; where there are none, they are NaN.
        """
        time_s = np.asarray(time_s, np.float64)
        values = np.full((len(time_s), len(self.columns)), np.nan, np.float32)
        for part in self.parts:
            position = (time_s - part.offset_s) / self.interval_s
            inside = (position >= -_TOLERANCE) & (position <= len(part) - 1 + _TOLERANCE)
            position = position[inside]
            nearest = np.round(position)
            # samples are returned unchanged
            position = np.where(np.abs(position - nearest) <= _TOLERANCE, nearest, position)
            for column in range(len(self.columns)):
                values[inside, column] = np.interp(
                    position, np.arange(len(part)), part.values[:, column]
                )
        return values

    def run(
        self, time_s: np.ndarray, scenario: Any = None, rng: np.random.Generator | None = None
    ) -> np.ndarray:
        """Returns what was recorded, as `at`; raises InputError if a scenario is given or a time is
        not covered.
        """
        if scenario is not None:
            raise InputError(
                f"Expected no scenario with a recorded run. Received: {str(scenario)[:80]!r}. "
                "Record a run of it and give that."
            )
        values = self.at(time_s)
        missing = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(missing):
            last_s = max(part.offset_s + self.interval_s * (len(part) - 1) for part in self.parts)
            raise InputError(
                f"Expected times that {self.name} covers, from {self.offset_s:g} s to "
                f"{last_s:g} s without gaps. "
                f"Received: {np.asarray(time_s)[missing[0]]:g} s. Give a longer recording."
            )
        return values


def check_telemetry(telemetry: Telemetry) -> None:
    """Raises an `InputError` if an argument is not a `Telemetry`."""
    if not isinstance(telemetry, Telemetry):
        raise InputError(
            f"Expected a Telemetry. Received: {type(telemetry).__name__}. Wrap an array as "
            "Telemetry.of(check_values(values, 'my channel'))."
        )


def check_columns(columns: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of channels as a tuple; raises InputError if there is none, one is no text,
    or one occurs twice.
    """
    names = (columns,) if isinstance(columns, str) else tuple(columns)
    is_text = all(isinstance(name, str) and name for name in names)
    if not names or not is_text or len(set(names)) < len(names):
        raise InputError(
            f"Expected names of columns, each different. Received: {names!r}. Name every output "
            "once."
        )
    return names


def iso_time(nanoseconds: int) -> str:
    """Formats a time in nanoseconds since 1970 as ISO 8601 text in UTC."""
    import pandas as pd

    return pd.Timestamp(int(nanoseconds), tz="UTC").isoformat()


def check_values(values: np.ndarray, what: str) -> np.ndarray:
    """Checks the values of a series and converts them to float32.

    Args:
        values: Array of shape `(samples,)`.
        what: Description of the source, for messages.

    Returns:
        float32 array of shape `(samples,)`.

    Raises:
        InputError: If the values are not numeric (booleans do not count as numbers), not
            one-dimensional, fewer than two, not finite, or beyond the range of float32.
    """
    given = values = np.asarray(values)
    if values.ndim != 1:
        raise InputError(
            f"Expected one series of shape (samples,). Received: shape {values.shape} from {what}. "
            "Name a --column."
        )
    if values.dtype.kind not in "fiu":
        raise InputError(
            f"Expected numbers. Received: dtype {values.dtype} from {what}. Name a numeric "
            "--column."
        )
    with np.errstate(over="ignore"):  # values beyond float32 become infinite and are rejected below
        values = values.astype(np.float32)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(
            f"Expected finite values, up to {np.finfo(np.float32).max:.1e} as float32 holds. "
            f"Received: {len(bad)} others in {what}, "
            f"the first ({given[bad[0]]:g}) at sample {bad[0]}. Fill or cut them, or give another "
            "unit."
        )
    if len(values) < 2:
        raise InputError(
            f"Expected at least 2 samples. Received: {len(values)} from {what}. Give a longer "
            "series."
        )
    if np.ptp(values) == 0 and np.ptp(given) != 0:
        raise InputError(
            f"Expected values that differ in float32. Received: the constant {values[0]:g} in "
            f"{what} once it is float32. Subtract the level."
        )
    return values
