"""The telemetry series, which all other packages work on: values with their times.

This is the data source, step 4 of the paper's pipeline. Values are checked but never changed or interpreted.
"""

import dataclasses

import numpy as np

from enhsim_tf.common.errors import InputError

_MAX_S = 9_223_372_036  # largest number of seconds from 1970 that fits into 64-bit nanoseconds


@dataclasses.dataclass(frozen=True, eq=False)
class Telemetry:
    """A regularly sampled series.

    Args:
        values: float32 array of shape `(samples,)`.
        interval_s: Sampling interval in seconds. It is 1 (one sample) if `has_time` is False.
        offset_s: Time of the first sample in seconds after `start`, or in samples without times. All parts of one series share
            the same `start`.
        start: Zero of the time axis as ISO 8601 text in UTC, or None if the source has no times.
        name: Channel name.
    """

    values: np.ndarray
    interval_s: float = 1.0
    offset_s: float = 0.0
    start: str | None = None
    name: str = "telemetry"

    def __len__(self) -> int:
        return len(self.values)

    @property
    def has_time(self) -> bool:
        """Whether the source has times."""
        return self.start is not None

    @property
    def counts(self) -> bool:
        """Whether the times count from a zero of their own, which `start` writes as 1970."""
        return self.has_time and self.start.startswith("1970")

    @property
    def time_unit(self) -> str:
        """Unit of the time axis: "s", or "samples" if the source has no times."""
        return "s" if self.has_time else "samples"

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample after `start` in seconds, float64 of shape `(samples,)`."""
        return self.offset_s + self.interval_s * np.arange(len(self))

    def part(self, start: int, stop: int) -> "Telemetry":
        """The samples from `start` up to, but not including, `stop`, with their times unchanged."""
        return dataclasses.replace(
            self, values=self.values[start:stop], offset_s=self.offset_s + self.interval_s * start
        )


def nanoseconds(telemetry: Telemetry, first: int = 0, stop: int | None = None) -> np.ndarray:
    """Computes the times of the samples from `first` up to, but not including, `stop`, which may lie beyond the series (None: its end).

    Returns:
        Nanoseconds since 1970 in UTC, int64 array of shape `(samples,)`. If the source has no times, nanoseconds since sample 0.

    Raises:
        InputError: If `start` is not a time, or a sample lies outside the years 1678 to 2261, the range of int64 nanoseconds.
    """
    import pandas as pd  # it parses every form of ISO 8601, with any zone

    try:
        text = telemetry.start or "1970-01-01"
        start = pd.Timestamp(text if text[0].isdigit() else None)  # pandas would accept "now"
        start = start.tz_localize("UTC") if start.tz is None else start.tz_convert("UTC")
        samples = np.arange(first, len(telemetry) if stop is None else stop)
        start_s, since_s = start.timestamp(), telemetry.offset_s + telemetry.interval_s * samples
    except (ValueError, TypeError, AttributeError, OverflowError):
        raise InputError(
            f"Expected start as an ISO 8601 time. Received: {telemetry.start!r}. Correct it."
        ) from None
    if (
        not max(
            abs(start_s), np.abs(since_s).max(initial=0), np.abs(start_s + since_s).max(initial=0)
        )
        < _MAX_S
    ):
        raise InputError(
            f"Expected times from 1678 to 2261. Received: start={telemetry.start}, offset_s={telemetry.offset_s}. Correct them."
        )
    return start.as_unit("ns").value + np.round(since_s * 1e9).astype(np.int64)


def check_telemetry(telemetry: Telemetry) -> None:
    """Raises an `InputError` if an argument is not a `Telemetry`."""
    if not isinstance(telemetry, Telemetry):
        raise InputError(
            f"Expected a Telemetry. Received: {type(telemetry).__name__}. Wrap an array as Telemetry(check_values(values, 'my channel'))."
        )


def check_values(values: np.ndarray, what: str) -> np.ndarray:
    """Checks the values of a series and converts them to float32.

    Args:
        values: Array of shape `(samples,)`.
        what: Description of the source, for messages.

    Returns:
        float32 array of shape `(samples,)`.

    Raises:
        InputError: If the values are not numeric (booleans do not count as numbers), not one-dimensional, fewer than two,
            constant, not finite, or beyond the range of float32.
    """
    given = values = np.asarray(values)
    if values.ndim != 1:
        raise InputError(
            f"Expected one series of shape (samples,). Received: shape {values.shape} from {what}. Name a --column."
        )
    if values.dtype.kind not in "fiu":
        raise InputError(
            f"Expected numbers. Received: dtype {values.dtype} from {what}. Name a numeric --column."
        )
    with np.errstate(over="ignore"):  # values beyond float32 become infinite and are rejected below
        values = values.astype(np.float32)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(
            f"Expected finite values, up to {np.finfo(np.float32).max:.1e} as float32 holds. Received: {len(bad)} others in {what}, "
            f"the first ({given[bad[0]]:g}) at sample {bad[0]}. Fill or cut them, or give another unit."
        )
    if len(values) < 2:
        raise InputError(
            f"Expected at least 2 samples. Received: {len(values)} from {what}. Give a longer series."
        )
    if np.ptp(values) == 0:
        raise InputError(
            f"Expected values that vary. Received: the constant {values[0]:g} in {what}. Choose another channel."
        )
    return values
