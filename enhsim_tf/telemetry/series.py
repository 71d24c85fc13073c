"""A telemetry series: values with their time and unit, read from a file, checked, split by time, cut into windows.

Step 4 of the paper's pipeline (the data source) and what every other room works on. It draws no random number
that its caller does not own, and it never interprets values: a series is what its file says or it is refused.
"""

import dataclasses

import numpy as np

from enhsim_tf.common.errors import InputError

_MAX_S = 9_223_372_036  # seconds before and after 1970 that nanoseconds in 64 bits reach


@dataclasses.dataclass(frozen=True, eq=False)
class Telemetry:
    """A regularly sampled series.

    Args:
        values: float32 array of shape `(samples,)`.
        interval_s: Sampling interval in seconds (in samples, that is 1, where `has_time` is False).
        offset_s: Time of the first sample on the clock that all parts of one series share, in seconds.
        start: ISO 8601 time (UTC) of that clock's zero, or None where the source has no time.
        name: Channel name.
        unit: Unit of the values.
    """

    values: np.ndarray
    interval_s: float = 1.0
    offset_s: float = 0.0
    start: str | None = None
    name: str = "telemetry"
    unit: str = "1"

    def __len__(self) -> int:
        return len(self.values)

    @property
    def has_time(self) -> bool:
        """Whether the source said when its samples were taken."""
        return self.start is not None

    @property
    def time_unit(self) -> str:
        """What the time axis counts: seconds, or samples where the source has no time."""
        return "s" if self.has_time else "samples"

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample on the series' clock, float64 of shape `(samples,)`."""
        return self.offset_s + self.interval_s * np.arange(len(self))

    def part(self, start: int, stop: int) -> "Telemetry":
        """The samples from `start` to before `stop`, on the same clock."""
        return dataclasses.replace(self, values=self.values[start:stop], offset_s=self.offset_s + self.interval_s * start)


def nanoseconds(telemetry: Telemetry, first: int = 0, stop: int | None = None) -> np.ndarray:
    """When each sample was taken.

    Args:
        telemetry: The series, or one of another length on its clock.
        first: The first sample that is asked for.
        stop: The one behind the last; None: behind the series' last.

    Returns:
        Nanoseconds since 1970 (UTC), int64 array of shape `(samples,)`; since the clock's zero where the source has no time.

    Raises:
        InputError: If its start is no time, or its samples do not lie from 1678 to 2261, the years that such numbers can hold.
    """
    import pandas as pd  # it reads every form of ISO 8601, with any zone

    try:
        text = telemetry.start or "1970-01-01"
        start = pd.Timestamp(text if text[0].isdigit() else None)  # "now" is no start
        start = start.tz_localize("UTC") if start.tz is None else start.tz_convert("UTC")
        samples = np.arange(first, len(telemetry) if stop is None else stop)
        start_s, since_s = start.timestamp(), telemetry.offset_s + telemetry.interval_s * samples
    except (ValueError, TypeError, AttributeError, OverflowError):
        raise InputError(f"Expected start as an ISO 8601 time. Received: {telemetry.start!r}. Correct it.") from None
    if not max(abs(start_s), np.abs(since_s).max(initial=0), np.abs(start_s + since_s).max(initial=0)) < _MAX_S:
        raise InputError(
            f"Expected times from 1678 to 2261. Received: start={telemetry.start}, offset_s={telemetry.offset_s}. Correct them."
        )
    return start.as_unit("ns").value + np.round(since_s * 1e9).astype(np.int64)


def check_telemetry(telemetry: Telemetry) -> None:
    """Says in one line that something else than a series was given.

    Raises:
        InputError: If it is no `Telemetry`.
    """
    if not isinstance(telemetry, Telemetry):
        raise InputError(
            f"Expected a Telemetry. Received: {type(telemetry).__name__}. Wrap an array as Telemetry(check_values(values, 'my channel'))."
        )


def check_values(values: np.ndarray, what: str, min_samples: int = 2) -> np.ndarray:
    """Returns `values` as a float32 series, or says in one line why it cannot be one.

    Args:
        values: Array of shape `(samples,)`.
        what: Where the values come from, for the message.
        min_samples: Fewest samples that can be used.

    Raises:
        InputError: If the values are not numeric (true and false are no numbers), not one-dimensional, empty, NaN, infinite,
            beyond float32, too short or constant.
    """
    given = values = np.asarray(values)
    if values.ndim != 1:
        raise InputError(f"Expected one series of shape (samples,). Received: shape {values.shape} from {what}. Name a --column.")
    if len(values) == 0:
        raise InputError(f"Expected samples. Received: none from {what}. Give a file that holds a series.")
    if values.dtype.kind not in "fiu":
        raise InputError(f"Expected numbers. Received: dtype {values.dtype} from {what}. Name a numeric --column.")
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite and is refused below
        values = values.astype(np.float32)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad) and np.isfinite(given[bad]).all():
        raise InputError(
            f"Expected values that float32 holds, up to {np.finfo(np.float32).max:.1e}. "
            f"Received: {len(bad)} beyond it in {what}, the first ({given[bad[0]]:g}) at sample {bad[0]}. Give another unit."
        )
    bad = bad[~np.isfinite(given[bad])]
    if len(bad):
        kind = "NaN" if np.isnan(values[bad[0]]) else "infinite"
        raise InputError(
            f"Expected finite values. Received: {len(bad)} NaN or infinite in {what}, the first ({kind}) at sample {bad[0]}. Fill or cut them."
        )
    if len(values) < min_samples:
        raise InputError(
            f"Expected at least {min_samples} samples. Received: {len(values)} from {what}. Give a longer series or a smaller window."
        )
    if np.ptp(values) == 0:
        raise InputError(f"Expected values that vary. Received: the constant {values[0]:g} in {what}. Choose another channel.")
    return values
