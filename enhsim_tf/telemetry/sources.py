"""Reads telemetry from tables, arrays, or InfluxDB, as one raw pandas Series per channel.

Values are returned as they are in the source, and times are parsed but neither sorted nor dropped; that is done by `cleaning`.
Findings made while reading are stored in `series.attrs["findings"]` and become part of the cleaning report.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS, READ_ERRORS, short_reason
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.influx_store import InfluxStore
from enhsim_tf.telemetry.reading.channels import Channels, read_table_channels
from enhsim_tf.telemetry.reading.clock import NO_TIME
from enhsim_tf.telemetry.registry import SOURCES, TABLES, existing

_NUM_COLUMNS = (25, 55)  # of the published arrays with commands: SMAP, MSL

Source = str | os.PathLike | Sequence[str | os.PathLike] | pd.DataFrame | pd.Series


def read_source(
    source: Source,
    columns: Sequence[str] | None = None,
    time: str | None = None,
    options: Cleaning | None = None,
) -> Channels:
    """Reads raw channels from a source.

    Args:
        source: A table (`.csv`, `.tsv`, `.txt`, `.parquet`, `.xlsx`, also inside `.gz` or `.zip`), several tables with the same columns, a
            folder of tables, a `.npy` file, `influxdb://bucket/measurement/field?tag=value`, or a pandas DataFrame or Series.
        columns: Names of the channels: columns of a table, or column numbers of an array. None: all channels that hold numbers.
        time: Name of a table's time column. None: the column is detected, if there is one. `NO_TIME` ("none"): the samples
            are counted.
        options: How times, labels, series and numbers are read; see `Cleaning`.

    Returns:
        Raw channels by name, in the order of the source. A channel with times has a `DatetimeIndex`, with NaT where a time is
        missing; a channel without times has a `RangeIndex`. The dictionary also has the whole `table` and the `commands` of an array, see
        `Channels`.

    Raises:
        InputError: If the source cannot be read, or a column does not exist.
    """
    options = options or Cleaning()
    if isinstance(columns, str):
        columns = [columns]
    columns = None if columns is None else [str(column) for column in columns]
    if columns is not None and (not columns or len(set(columns)) < len(columns)):
        raise InputError(
            f"Expected columns of different names. Received: columns={columns}. Name each once."
        )
    if isinstance(source, pd.DataFrame | pd.Series):
        return read_table_channels(source, columns, time, options)
    path = existing(source)
    if isinstance(path, str):
        return _read_influx(path, columns, time)
    if isinstance(path, list):
        return read_table_channels(path if len(path) > 1 else path[0], columns, time, options)
    if path.is_dir() or path.suffix.lower() in TABLES:
        return read_table_channels(path, columns, time, options)
    if path.suffix.lower() == ".npy":
        return _read_array(path, columns, time)
    raise InputError(f"Expected a source of telemetry. Received: {path.name}. Give {SOURCES}.")


def _read_influx(source: str, columns: list[str] | None, time: str | None) -> Channels:
    """Reads the one series at an address, named after its field."""
    if time is not None or columns is not None:
        given = f"time={time!r}" if time is not None else f"columns={columns}"
        raise InputError(
            f"Expected {given.partition('=')[0]} with a table only. Received: {given} with {source}. Leave it out."
        )
    store = InfluxStore(source)
    times, values = store.read()
    index = pd.DatetimeIndex(times.astype("datetime64[ns]"), tz="UTC", name="time")
    return Channels(
        {store.location.field: pd.Series(values, index=index, name=store.location.field)}
    )


def _read_array(path: Path, columns: list[str] | None, time: str | None) -> Channels:
    """Reads the columns of an array.

    In telemanom's SMAP and MSL data, column 0 is the value, and each other column is 1 at the samples at which one command was sent and 0 at
    all others. Only column 0 is read then, unless columns are named. The commands are returned beside it, but not if one of them is named as
    a channel: it would be explained by itself.
    """
    if time not in (None, NO_TIME):
        raise InputError(
            f"Expected time with a table only. Received: time={time!r} with {path.name}. Leave it out."
        )
    try:
        array = np.load(path, allow_pickle=False)  # unpickling could run code
        if not isinstance(array, np.ndarray) or array.dtype.kind in "SUV":
            raise ValueError("an archive, text or records; save records as a table")
    except READ_ERRORS as error:
        raise InputError(
            f"Expected a NumPy array of numbers. Received: {path.name}, which cannot be read ({short_reason(error)}). Save it again."
        ) from None
    if array.ndim not in (1, 2):
        raise InputError(
            f"Expected an array of shape (samples,) or (samples, columns). Received: {array.shape} in {path.name}. Reshape it."
        )
    array = array.reshape(len(array), -1) if array.size else array.reshape(0, 1)
    if columns is None and array.shape[1] > MAX_COLUMNS:
        raise InputError(
            f"Expected at most {MAX_COLUMNS:,} columns. Received: {array.shape[1]:,} in {path.name}. Name those to be read."
        )
    known, last, found = (
        {str(number): number for number in range(array.shape[1])},
        array.shape[1] - 1,
        {},
    )
    has_layout = array.shape[1] in _NUM_COLUMNS and array.dtype.kind in "fiu" and len(array) > 0
    has_commands = columns in (None, ["0"]) and has_layout and np.isin(array[:, 1:], (0, 1)).all()
    for column in ["0"] if has_commands else columns or known:
        if column not in known:
            raise InputError(
                f"Expected a column of {path.name}, a number from 0 to {last}. Received: {column!r}. Name one of these."
            )
        name = path.stem if last == 0 else f"{path.stem}.{column}"
        found[name] = pd.Series(array[:, known[column]], name=name)
        if has_commands and columns is None:
            text = f"columns 1 to {last} hold only 0 and 1 and were taken as commands, not as channels: {last}"
            found[name].attrs["findings"] = [dataclasses.asdict(Finding("commands", last, text))]
    return Channels(found, commands=array[:, 1:].astype(np.float32) if has_commands else None)
