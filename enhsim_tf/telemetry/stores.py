"""Reads stored series as channels."""

from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.pandas_series import to_series
from enhsim_tf.telemetry.parquet_store import ParquetStore
from enhsim_tf.telemetry.reading.channels import read_table_channels
from enhsim_tf.telemetry.reading.files import files_of
from enhsim_tf.telemetry.registry import SOURCES


def read_influx_channels(source: str, columns: list[str] | None, time: str | None, options: Cleaning) -> dict[str, pd.Series]:
    """Reads the series written by an `InfluxStore`, or otherwise the one series at the address, named after its field.

    `sources.read_source` calls it. `options` has no effect, since the times are stored as such.
    """
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


def read_folder_channels(folder: Path, columns: list[str] | None, time: str | None, options: Cleaning) -> dict[str, pd.Series]:
    """Reads the series of a `ParquetStore`, or the tables in a folder; see `sources.read_source`, which calls it."""
    if (folder / "labeled_anomalies.csv").is_file():
        raise InputError(
            f"Expected a store's folder. Received: {folder}, which holds labelled channels. "
            "Name one array, such as train/T-1.npy with column 0."
        )
    if files_of(folder):  # a store has only folders inside
        return read_table_channels(folder, columns, time, options)
    if time is not None:
        raise InputError(f"Expected time with a table only. Received: time={time!r} with the store {folder}. Leave it out.")
    store = ParquetStore(folder)
    names = store.names() if columns is None else columns
    if not names:
        raise InputError(f"Expected a store with at least one series. Received: the folder {folder} without any. Give {SOURCES}.")
    return {name: to_series(store.read(name)) for name in names}
