"""Reads telemetry from tables, arrays, or InfluxDB, as one raw channel per column.

Values are returned as they are in the source, and times are parsed but neither sorted nor dropped;
that is done by `cleaning`. Findings made while reading become part of the cleaning report.
"""

import io
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS, reading
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean_all
from enhsim_tf.telemetry.cleaning.raw import RawChannel
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.influx_store import InfluxStore
from enhsim_tf.telemetry.joining import join_channels
from enhsim_tf.telemetry.reading.channels import Channels, read_table_channels
from enhsim_tf.telemetry.reading.clock import NO_TIME
from enhsim_tf.telemetry.reading.clock_values import is_regular
from enhsim_tf.telemetry.reading.files import suffix_of, unpack
from enhsim_tf.telemetry.reading.formats import refuse_channels_first
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.source_kinds import PACKED, existing

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
        source: A table (text, or a file of a kind in `reading.formats.READERS`, also inside `.gz`
            or `.zip`), several tables with the same columns, a folder of tables, a `.npy` file,
            `influxdb://bucket/measurement/field?tag=value`, or a pandas DataFrame or Series.
        columns: Names of the channels: columns of a table, or column numbers of an array. None: all
            channels that hold numbers.
        time: Name of a table's time column. None: the column is detected, if there is one.
            `NO_TIME` ("none"): the samples are counted.
        options: How times, labels, series and numbers are read; see `Cleaning`.

    Returns:
        Raw channels by name, in the order of the source, see `RawChannel`; `series` of each is the
        channel as a pandas Series. The dictionary also has the whole `table`, see `Channels`.

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
    if not isinstance(source, pd.DataFrame | pd.Series):
        source = existing(source)
    if isinstance(source, str):
        return _read_influx(source, columns, time, options)
    if isinstance(source, Path) and suffix_of(source) == ".npy" and not source.is_dir():
        return _read_array(source, columns, time, options)
    return read_table_channels(source, columns, time, options)


def read_telemetry(
    source: Source,
    cleaning: Cleaning | None = None,
    columns: Sequence[str] | None = None,
    time: str | None = None,
) -> list[Telemetry]:
    """Reads and cleans telemetry, and brings its channels onto one clock.

    Args:
        source: As in `read_source`.
        cleaning: How it is read and cleaned. None: the defaults of `Cleaning`.
        columns: As in `read_source`.
        time: As in `read_source`.

    Returns:
        Telemetry of all channels of one sampling interval that share their time; further ones for
        channels of others.

    Raises:
        InputError: If the source cannot be read, or one of its channels cannot be cleaned.
    """
    cleaning = cleaning or Cleaning()
    channels = read_source(source, columns, time, cleaning)
    cleaned = clean_all(channels, cleaning, describe=False)
    return join_channels({name: each.telemetry for name, each in cleaned.items()})


def _read_influx(
    source: str, columns: list[str] | None, time: str | None, options: Cleaning
) -> Channels:
    """Reads the one series at an address, named after its field."""
    if time is not None or columns is not None:
        given = f"time={time!r}" if time is not None else f"columns={columns}"
        raise InputError(
            f"Expected {given.partition('=')[0]} with a table only. Received: {given} with "
            f"{source}. Leave it out."
        )
    store = InfluxStore(source)
    times, values = store.read()
    index = pd.DatetimeIndex(times.astype("datetime64[ns]"), tz="UTC", name="time")
    series = pd.Series(values, index=index, name=store.location.field)
    return Channels({store.location.field: RawChannel.of(series, options)})


def _read_array(
    path: Path, columns: list[str] | None, time: str | None, options: Cleaning
) -> Channels:
    """Reads the columns of an array.

    In telemanom's SMAP and MSL data, column 0 is the value, and each other column is 1 at the
    samples at which one command was sent and 0 at all others. Only column 0 is read then, unless
    columns are named.
    """
    if time not in (None, NO_TIME):
        raise InputError(
            f"Expected time with a table only. Received: time={time!r} with {path.name}. Leave it "
            "out."
        )
    with reading(path.name):
        is_packed = path.suffix.lower() in PACKED
        file = io.BytesIO(unpack(path)[0]) if is_packed else path
        array = np.load(file, allow_pickle=False)  # unpickling could run code
    if not isinstance(array, np.ndarray) or array.dtype.kind in "SUV":
        raise InputError(
            f"Expected a NumPy array of numbers. Received: an archive, text or records in "
            f"{path.name}. Save records as a table."
        )
    if array.ndim not in (1, 2):
        raise InputError(
            f"Expected an array of shape (samples,) or (samples, columns). Received: {array.shape} "
            f"in {path.name}. Reshape it."
        )
    if columns is None and array.ndim == 2:
        refuse_channels_first(array.shape, path.name)
    array = array.reshape(len(array), -1) if array.size else array.reshape(0, 1)
    if array.dtype == bool and options.states:
        array = array.astype(np.float64)
    stem = re.sub(r"\.npy(?:\.\w+)?$", "", path.name, flags=re.IGNORECASE)
    known = {str(number): number for number in range(array.shape[1])}
    last = len(known) - 1
    findings = ()
    if columns is None:
        columns = list(known)
        is_plain = array.dtype.kind in "fiu" and len(array) > 0
        if len(known) > MAX_COLUMNS:
            raise InputError(
                f"Expected at most {MAX_COLUMNS:,} columns. Received: {len(known):,} in "
                f"{path.name}. Name those to be read."
            )
        if is_plain and len(known) in _NUM_COLUMNS and np.isin(array[:, 1:], (0, 1)).all():
            columns = ["0"]
            text = (
                f"columns 1 to {last} hold only 0 and 1 and were taken as commands, not as "
                f"channels: {last}"
            )
            findings = (Finding("commands", last, text),)
        elif is_plain and last > 0 and time is None and is_regular(array[:, 0]):
            raise InputError(
                f"Expected channels without a clock. Received: column 0 of {path.name}, which "
                "increases in equal steps, as a clock does.",
                [{"columns": columns[1:]}, {"time": NO_TIME}],
                "a table with names",
            )
    found = {}
    for column in columns:
        number = column.removeprefix(f"{stem}.")
        if number not in known:
            raise InputError(
                f"Expected a column of {path.name}, a number from 0 to {last}. Received: "
                f"{number!r}. Name one of these."
            )
        name = stem if last == 0 else f"{stem}.{number}"
        found[name] = RawChannel(name, pd.Series(array[:, known[number]]), findings=findings)
    return Channels(found)
