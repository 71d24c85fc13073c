"""Reads telemetry from tables, arrays, the folder of a store, or InfluxDB, as one raw pandas Series per channel.

Values are returned as they are in the source, and times are parsed but neither sorted nor dropped; that is done by `cleaning`.
Findings made while reading are stored in `series.attrs["findings"]` and become part of the cleaning report.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import MAX_COLUMNS
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.cleaning.times import parse_times
from enhsim_tf.telemetry.parquet_store import ParquetStore
from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds
from enhsim_tf.telemetry.single_file import load_array
from enhsim_tf.telemetry.tables import NO_TIME, numeric_columns, read_table, time_column

INFLUX = "influxdb://"
_HINT = "Give a .csv, .parquet or .npy file, a store's folder (or folder#channel), or influxdb://bucket/measurement/field"


def read_source(
    source: str | os.PathLike, columns: Sequence[str] | None = None, time: str | None = None, options: Cleaning | None = None
) -> dict[str, pd.Series]:
    """Reads raw channels from a source.

    Args:
        source: A `.csv`, `.parquet` or `.npy` file, the folder of a `ParquetStore`, `folder#channel`, or
            `influxdb://bucket/measurement/field?tag=value`.
        columns: Names of the channels: columns of a table, column numbers of an array, or series of a store. None: all
            channels that hold numbers.
        time: Name of a table's time column. None: the column is detected, if there is one. `NO_TIME` ("none"): the samples
            are counted.
        options: Options for parsing times: `time_unit`, `time_format` and `on_bad_times`. Other options are ignored here.

    Returns:
        Raw channels by name, in the order of the source. A channel with times has a `DatetimeIndex`, with NaT where a time is
        missing; a channel without times has a `RangeIndex`. `series.attrs["unit"]` holds the unit, if it is known.

    Raises:
        InputError: If the source cannot be read, or a column does not exist.
    """
    source, options = os.fspath(source), options or Cleaning()
    if isinstance(columns, str):
        columns = [columns]
    columns = None if columns is None else [str(column) for column in columns]
    if columns is not None and (not columns or len(set(columns)) < len(columns)):
        raise InputError(f"Expected columns of different names. Received: columns={columns}. Name each once.")
    if source.startswith(INFLUX):
        return _read_influx(source, columns, time)
    path, channel = Path(source), None
    if not _exists(path) and "#" in source:
        folder, channel = source.rsplit("#", 1)
        path = Path(folder)
    if not _exists(path):
        raise InputError(f"Expected a source of telemetry. Received: {source}, which does not exist. {_HINT}.")
    if path.is_dir():
        return _read_store(path, columns if channel is None else [channel], time)
    if channel is not None:
        raise InputError(f"Expected folder#channel with a store's folder only. Received: {source}. Name the column of a file instead.")
    readers = {".csv": _read_table, ".txt": _read_table, ".tsv": _read_table, ".parquet": _read_table, ".npy": _read_array}
    if path.suffix.lower() not in readers:
        raise InputError(f"Expected a source of telemetry. Received: {path.name}. {_HINT}.")
    return readers[path.suffix.lower()](path, columns, time, options)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that the file system does not allow
        return False


def _read_influx(source: str, columns: list[str] | None, time: str | None) -> dict[str, pd.Series]:
    """Reads the series written by an `InfluxStore`, or otherwise the one series at the address, named after its field."""
    from enhsim_tf.telemetry.influx_store import InfluxStore  # the client is an optional extra

    if time is not None:
        raise InputError(f"Expected time with a table only. Received: time={time!r} with {source}. Leave it out.")
    store = InfluxStore(source)
    names = store.names()
    if names:
        return {name: to_series(store.read(name)) for name in (names if columns is None else columns)}
    if columns is not None:
        raise InputError(f"Expected the field in the address alone. Received: columns={columns} with {source}. Leave them out.")
    blocks = list(store.chunks())
    times, values = (np.concatenate([block[part] for block in blocks]) for part in (0, 1)) if blocks else (np.empty(0, int), np.empty(0))
    field = store.location.field
    return {field: pd.Series(values, index=pd.DatetimeIndex(times.astype("datetime64[ns]"), tz="UTC", name="time"), name=field)}


def _read_store(folder: Path, columns: list[str] | None, time: str | None) -> dict[str, pd.Series]:
    if (folder / "labeled_anomalies.csv").is_file():
        raise InputError(
            f"Expected a store's folder. Received: {folder}, which holds labelled channels. "
            "Load it with load_labelled, or name one array, such as train/T-1.npy with column 0."
        )
    if time is not None:
        raise InputError(f"Expected time with a table only. Received: time={time!r} with the store {folder}. Leave it out.")
    store = ParquetStore(folder)
    names = store.names() if columns is None else columns
    if not names:
        raise InputError(f"Expected a store with at least one series. Received: the folder {folder} without any. {_HINT}.")
    return {name: to_series(store.read(name)) for name in names}


def _read_array(path: Path, columns: list[str] | None, time: str | None, options: Cleaning) -> dict[str, pd.Series]:
    if time not in (None, NO_TIME):
        raise InputError(f"Expected time with a table only. Received: time={time!r} with {path.name}. Leave it out.")
    array = load_array(path)
    array = array.reshape(len(array), -1) if array.size else array.reshape(0, 1)
    if columns is None and array.shape[1] > MAX_COLUMNS:
        raise InputError(f"Expected at most {MAX_COLUMNS:,} columns. Received: {array.shape[1]:,} in {path.name}. Name those to be read.")
    known = [str(number) for number in range(array.shape[1])]
    for column in columns or ():
        if column not in known:
            raise InputError(
                f"Expected a column of {path.name}, a number from 0 to {len(known) - 1}. Received: {column!r}. Name one of these."
            )
    names = {column: path.stem if len(known) == 1 else f"{path.stem}.{column}" for column in known}
    return {names[column]: pd.Series(array[:, int(column)], name=names[column]) for column in columns or known}


def _read_table(path: Path, columns: list[str] | None, time: str | None, options: Cleaning) -> dict[str, pd.Series]:
    table, findings = read_table(path)
    repeated = set(table.columns[table.columns.duplicated()])
    for name in [*(columns or ()), *([time] if time not in (None, NO_TIME) else [])]:
        if name in repeated:
            raise InputError(f"Expected columns of different names. Received: {name!r} more than once in {path.name}. Rename them.")
        if name not in table.columns:
            known = ", ".join(table.columns[:8])
            raise InputError(f"Expected a column of {path.name}: {known}. Received: {name!r}. Name one of these.")
    if columns is None and repeated:
        raise InputError(f"Expected columns of different names. Received: {min(repeated)!r} more than once in {path.name}. Rename them.")
    found = time_column(table, path.name) if time is None else time
    if time is None and found is not None:
        findings.append(Finding("time column", 1, f"the time column is {found!r}"))
    index = pd.RangeIndex(len(table))
    if found not in (None, NO_TIME):
        what = f"the times {found!r} of {path.name}"
        stamps, bad, noted = parse_times(table[found], what, options.on_bad_times == "drop", options.time_unit, options.time_format)
        if bad.any():
            rows = tuple(f"row {row}" for row in np.flatnonzero(bad)[:3])
            noted = [*noted, Finding("bad times", int(bad.sum()), f"times that cannot be read, taken as missing: {int(bad.sum()):,}", rows)]
        index, findings = stamps.rename(str(found)), [*findings, *noted]
    if columns is None:
        columns, others = numeric_columns(table.drop(columns=[found] if found in table.columns else []))
        if others:
            findings.append(Finding("columns left out", len(others), f"columns without numbers: {', '.join(others[:8])}"))
        if not columns:
            raise InputError(f"Expected a column of numbers. Received: none in {path.name} beside the times. Give another table.")
    channels = {}
    for column in columns:
        channels[column] = pd.Series(table[column].array, index=index, name=column, copy=False)
        channels[column].attrs["findings"] = [finding.to_dict() for finding in findings]
    return channels


def to_series(telemetry: Telemetry) -> pd.Series:
    """Converts telemetry to a pandas Series.

    Args:
        telemetry: The telemetry.

    Returns:
        The series, with a `DatetimeIndex` in UTC, or with a `RangeIndex` of sample numbers if the telemetry has no times. The
        unit is in `series.attrs["unit"]`.
    """
    check_telemetry(telemetry)
    if telemetry.has_time:
        index = pd.DatetimeIndex(nanoseconds(telemetry).astype("datetime64[ns]"), tz="UTC", name="time")
    else:
        first = round(telemetry.offset_s)
        index = pd.RangeIndex(first, first + len(telemetry), name="sample")
    series = pd.Series(telemetry.values, index=index, name=telemetry.name)
    series.attrs["unit"] = telemetry.unit
    return series


def from_series(series: pd.Series, unit: str | None = None) -> Telemetry:
    """Converts a regular pandas Series to telemetry.

    Args:
        series: Numbers with a regular `DatetimeIndex` or a `RangeIndex`.
        unit: Unit of the values. None: `series.attrs["unit"]`, or "1".

    Returns:
        The telemetry.

    Raises:
        InputError: If the series would need repairs. Use `clean` for such a series.
    """
    cleaned = clean(series, Cleaning(max_fill=0, min_part=1, same_time="refuse"))
    touched = [finding for finding in cleaned.report.findings if finding.action != "accepted"]
    if touched or len(cleaned.parts) > 1:
        line = touched[0].text if touched else "a gap"
        raise InputError(f"Expected a regular series. Received: {cleaned.report.channel} with {line}. Clean it first: clean(series).")
    (telemetry,) = cleaned.parts
    return Telemetry(
        telemetry.values,
        telemetry.interval_s,
        telemetry.offset_s,
        telemetry.start,
        telemetry.name,
        telemetry.unit if unit is None else unit,
    )
