"""Reads telemetry from tables, arrays, or InfluxDB, as one raw pandas Series per channel.

Values are returned as they are in the source, and times are parsed but neither sorted nor dropped; that is done by `cleaning`.
Findings made while reading are stored in `series.attrs["findings"]` and become part of the cleaning report.
"""

import os
from collections.abc import Sequence

import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.arrays import read_array_channels
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.influx_store import InfluxStore
from enhsim_tf.telemetry.reading.channels import Channels, read_table_channels
from enhsim_tf.telemetry.registry import SOURCES, TABLES, existing

Source = str | os.PathLike | Sequence[str | os.PathLike] | pd.DataFrame | pd.Series


def read_source(source: Source, columns: Sequence[str] | None = None, time: str | None = None, options: Cleaning | None = None) -> Channels:
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
        raise InputError(f"Expected columns of different names. Received: columns={columns}. Name each once.")
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
        return read_array_channels(path, columns, time)
    raise InputError(f"Expected a source of telemetry. Received: {path.name}. Give {SOURCES}.")


def _read_influx(source: str, columns: list[str] | None, time: str | None) -> Channels:
    """Reads the one series at an address, named after its field."""
    if time is not None or columns is not None:
        given = f"time={time!r}" if time is not None else f"columns={columns}"
        raise InputError(f"Expected {given.partition('=')[0]} with a table only. Received: {given} with {source}. Leave it out.")
    store = InfluxStore(source)
    times, values = store.read()
    index = pd.DatetimeIndex(times.astype("datetime64[ns]"), tz="UTC", name="time")
    return Channels({store.location.field: pd.Series(values, index=index, name=store.location.field)})
