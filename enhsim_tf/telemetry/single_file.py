"""Reads one column of one file as telemetry at a regular interval."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import READ_ERRORS, check_parquet, load_npy, short_reason
from enhsim_tf.telemetry.series import Telemetry, check_values

if TYPE_CHECKING:
    import pandas as pd


def load_array(path: str | os.PathLike) -> np.ndarray:
    """Reads a `.npy` file of one or two dimensions, without pickle, so that its content cannot run code.

    Args:
        path: The file.

    Returns:
        The array.

    Raises:
        InputError: If the file cannot be read or is not such an array.
    """
    path = Path(path)
    try:
        array = load_npy(path)
    except ValueError as error:
        raise InputError(
            f"Expected a NumPy array of numbers. Received: {path.name}, which cannot be read ({error}). Save it again."
        ) from None
    if array.ndim not in (1, 2) or array.dtype.names:
        shape = "fields" if array.dtype.names else array.shape
        raise InputError(f"Expected an array of shape (samples,) or (samples, columns). Received: {shape} in {path.name}. Reshape it.")
    return array


def read_telemetry(path: str | os.PathLike, column: str | None = None, time: str | None = None, min_samples: int = 2) -> Telemetry:
    """Reads one channel from a file.

    Args:
        path: A `.npy` array of shape `(samples,)` or `(samples, columns)`, a `.csv` or a `.parquet` table.
        column: Column that holds the values: a number for `.npy`, a name for tables. Required if there are several columns.
        time: Name of a table's time column, with regular date-times or seconds. None: the samples are counted.
        min_samples: Smallest number of samples allowed.

    Returns:
        The telemetry.

    Raises:
        InputError: If the file cannot be read, the column does not exist, or the values or times cannot be used.
    """
    path, column = Path(path), None if column is None else str(column)
    if not _is_file(path):
        raise InputError(f"Expected a telemetry file. Received: {path}, which does not exist or is not a file. Check the path.")
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
    except OSError:  # a name that the file system does not allow
        return False


def _read_array(path: Path, column: str | None, time: str | None):
    if time is not None:
        raise InputError(
            f"Expected --time with a table only. Received: --time {time} with the array {path.name}, which has no named columns. Leave it out."
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
            header = pd.read_csv(path, header=None, nrows=1, dtype=str, keep_default_na=False)  # since pandas renames repeated columns
            table, names = pd.read_csv(path), header.iloc[0].tolist()
        else:
            check_parquet(path)
            table = pd.read_parquet(path)
            names = table.columns.tolist()
    except READ_ERRORS as error:  # pandas' and Arrow's parser errors are ValueErrors
        reason = short_reason(error)
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


def _regular_interval(times: "pd.Series", what: str) -> tuple[float, str]:
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
            f"Expected regular, ascending times. Received: steps from {steps.min(initial=interval):g} s to {steps.max(initial=interval):g} s "
            f"in {what}, the first bad one before sample {where + 1}. Resample it first."
        )
    return interval, stamps.iloc[0].isoformat()


def _first(marks: "pd.Series | np.ndarray") -> int:
    """Index of the first True, or 0 if there is none."""
    return int(np.argmax(np.asarray(marks, bool)))
