"""A telemetry series: values with their time and unit, read from a file, checked, split by time, cut into windows.

Step 4 of the paper's pipeline (the data source) and what every other room works on. It draws no random number
that its caller does not own, and it never interprets values: a series is what its file says or it is refused.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enhsim_tf.declared_sizes import DAMAGES, check_parquet, reason_of, whole_array
from enhsim_tf.errors import InputError

_MOST_S = 9_223_372_036  # seconds before and after 1970 that nanoseconds in 64 bits reach


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
    if not max(abs(start_s), np.abs(since_s).max(initial=0), np.abs(start_s + since_s).max(initial=0)) < _MOST_S:
        raise InputError(
            f"Expected times from 1678 to 2261. Received: start={telemetry.start}, offset_s={telemetry.offset_s}. Correct them."
        )
    return start.as_unit("ns").value + np.round(since_s * 1e9).astype(np.int64)


def load_array(path: str | os.PathLike) -> np.ndarray:
    """Reads a `.npy` file of one or two dimensions; nothing in it can run code.

    Args:
        path: The file.

    Raises:
        InputError: If it cannot be read, or is something else.
    """
    path = Path(path)
    try:
        array = whole_array(path)
    except ValueError as error:
        raise InputError(
            f"Expected a NumPy array of numbers. Received: {path.name}, which cannot be read ({error}). Save it again."
        ) from None
    if array.ndim not in (1, 2) or array.dtype.names:
        shape = "fields" if array.dtype.names else array.shape
        raise InputError(f"Expected an array of shape (samples,) or (samples, columns). Received: {shape} in {path.name}. Reshape it.")
    return array


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


def read_telemetry(path: str | os.PathLike, column: str | None = None, time: str | None = None, min_samples: int = 2) -> Telemetry:
    """Reads one channel from a file.

    Args:
        path: A `.npy` array of shape `(samples,)` or `(samples, columns)`, a `.csv` or a `.parquet` table.
        column: Which column holds the values: a number for `.npy`, a name for tables. Needed when there are several.
        time: Name of a table's time column (date-times or seconds), regularly sampled. None: samples are counted.
        min_samples: Fewest samples that can be used.

    Returns:
        The checked `Telemetry`.

    Raises:
        InputError: If the file cannot be read, the column is not there, or the values or times cannot be used.
    """
    path, column = Path(path), None if column is None else str(column)
    if not _is_file(path):
        raise InputError(f"Expected a telemetry file. Received: {path}, which does not exist or is no file. Check the path.")
    readers = {".npy": _read_array, ".csv": _read_table, ".parquet": _read_table}
    if path.suffix.lower() not in readers:
        raise InputError(f"Expected a .npy, .csv or .parquet file. Received: {path.name}. Convert it to one of these.")
    values, times, label = readers[path.suffix.lower()](path, column, time)
    values = check_values(values, f"{path.name}{label}", min_samples)
    interval_s, start = (1.0, None) if times is None else _regular_interval(times, path.name)
    return Telemetry(values, interval_s=interval_s, start=start, name=path.stem)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that no file system takes
        return False


def _read_array(path: Path, column: str | None, time: str | None):
    if time is not None:
        raise InputError(
            f"Expected --time with a table only. Received: --time {time} with {path.name}, an array has no named columns. Leave it out."
        )
    array = load_array(path)
    if array.ndim == 1 and column is None:
        return array, None, ""
    columns = 1 if array.ndim == 1 else array.shape[1]
    if column is None and columns > 1:
        raise InputError(
            f"Expected --column, a number from 0 to {columns - 1}. Received: none with {path.name} of shape {array.shape}. Name one."
        )
    index = column or "0"
    if not (index.isdecimal() and int(index) < columns):
        raise InputError(f"Expected --column, a number from 0 to {columns - 1}. Received: {column!r} with {path.name}. Name one of these.")
    return array.reshape(len(array), columns)[:, int(index)], None, f" column {index}"


def _read_table(path: Path, column: str | None, time: str | None):
    import pandas as pd  # only tables need it

    try:
        if path.suffix.lower() == ".csv":
            header = pd.read_csv(path, header=None, nrows=1, dtype=str, keep_default_na=False)  # before pandas makes names differ
            table, names = pd.read_csv(path), header.iloc[0].tolist()
        else:
            check_parquet(path)
            table = pd.read_parquet(path)
            names = table.columns.tolist()
    except DAMAGES as error:  # pandas' and Arrow's parser errors are ValueErrors
        reason = reason_of(error)
        raise InputError(f"Expected a table. Received: {path.name}, which cannot be read ({reason}). Save it again.") from None
    twice = [name for name in dict.fromkeys(names) if name != "" and names.count(name) > 1 and (column is None or name in (column, time))]
    if twice:
        raise InputError(f"Expected columns of different names. Received: {twice[0]!r} more than once in {path.name}. Rename them.")
    for name in (column, time):
        if name is not None and name not in table.columns:
            known = ", ".join(map(str, table.columns[:8]))
            raise InputError(f"Expected a column of {path.name}: {known}. Received: {name!r}. Name one of these.")
    if column is None:
        others = [name for name in table.columns if name != time]
        if len(others) != 1:
            raise InputError(f"Expected --column, one of: {', '.join(map(str, others[:8]))}. Received: none with {path.name}. Name one.")
        column = others[0]
    return table[column].to_numpy(), None if time is None else table[time], f" column {column}"


def _regular_interval(times, what: str) -> tuple[float, str]:
    import pandas as pd

    numeric = pd.api.types.is_numeric_dtype(times)
    form = {"unit": "s"} if numeric else {"format": "ISO8601"}
    try:
        stamps = pd.to_datetime(times, utc=True, **form)
    except (ValueError, TypeError):
        row = _first(pd.to_datetime(times, utc=True, errors="coerce", **form).isna() & times.notna())
        raise InputError(
            f"Expected times as ISO 8601 date-times or seconds. Received: {str(times.iloc[row])!r} at sample {row} in {what}. "
            "Correct it or name another --time."
        ) from None
    if stamps.isna().any():
        raise InputError(f"Expected a time for every sample. Received: none at sample {_first(stamps.isna())} in {what}. Fill or cut it.")
    steps = np.diff(stamps.dt.tz_convert(None).to_numpy().astype("datetime64[ns]").astype(np.int64)) / 1e9
    interval = float(np.median(steps)) if len(steps) else 0.0
    uneven = np.abs(steps - interval) > 0.01 * interval
    if interval <= 0 or uneven.any():
        where = _first(uneven if interval > 0 else steps <= 0)
        raise InputError(
            f"Expected regular, rising times. Received: steps from {steps.min(initial=interval):g} s to {steps.max(initial=interval):g} s "
            f"in {what}, the first bad one before sample {where + 1}. Resample it first."
        )
    return interval, stamps.iloc[0].isoformat()


def _first(marks) -> int:
    """Number of the first mark that is set; 0 where none is."""
    return int(np.argmax(np.asarray(marks, bool)))


def split_by_time(telemetry: Telemetry, fractions: Sequence[float], gap: int) -> list[Telemetry]:
    """Splits a series into consecutive parts with a gap between them, so that no window of one part touches another.

    Args:
        telemetry: The series.
        fractions: Share of each part; they add up to 1.
        gap: Samples left out between two parts, at least a window.
    """
    if abs(sum(fractions) - 1) > 1e-9 or min(fractions) <= 0:
        raise InputError(f"Expected positive fractions that add up to 1. Received: fractions={tuple(fractions)}. Correct them.")
    usable = len(telemetry) - gap * (len(fractions) - 1)
    lengths = [int(usable * fraction) for fraction in fractions]
    if min(lengths) < 1:
        raise InputError(
            f"Expected a series longer than its gaps. Received: {len(telemetry)} samples with gaps of {gap}. Give a longer one."
        )
    starts = np.cumsum([0] + [length + gap for length in lengths[:-1]])
    return [telemetry.part(start, start + length) for start, length in zip(starts.tolist(), lengths, strict=True)]


def random_offsets(num_samples: int, window: int, num_windows: int, rng: np.random.Generator) -> np.ndarray:
    """First samples of windows "whose beginning and end are offset by a random amount" (paper, section 2.2).

    Args:
        num_samples: Length of the series.
        window: Samples of a window.
        num_windows: Number of windows.
        rng: Draws the offsets.

    Returns:
        Integer array of shape `(num_windows,)`.

    Raises:
        InputError: If the series is shorter than a window.
    """
    if num_samples < window:
        raise InputError(f"Expected at least one window of {window} samples. Received: {num_samples} samples. Give a longer series.")
    return rng.integers(0, num_samples - window + 1, num_windows)


def disjoint_offsets(num_samples: int, window: int) -> np.ndarray:
    """First samples of windows that share no sample: the independent units of a test."""
    return np.arange(num_samples // window) * window


def even_offsets(num_samples: int, window: int, num_windows: int) -> np.ndarray:
    """First samples of windows spread evenly over a series, in the order of time.

    Args:
        num_samples: Length of the series.
        window: Samples of a window.
        num_windows: Number of windows.

    Returns:
        Integer array of shape `(num_windows,)`.
    """
    return np.linspace(0, num_samples - window, num_windows).astype(np.int64)


def cut_windows(values: np.ndarray, offsets: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows out of a series.

    Args:
        values: Series of shape `(samples,)`.
        offsets: First sample of each window, shape `(windows,)`.
        window: Samples of a window.

    Returns:
        Array of shape `(windows, window)`, of the type of `values`.
    """
    return np.lib.stride_tricks.sliding_window_view(values, window)[offsets]
