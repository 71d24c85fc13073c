"""Reads arrays as channels without times."""

from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import MAX_COLUMNS, load_npy
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.commands import has_commands
from enhsim_tf.telemetry.reading.clock import NO_TIME


def _load(path: Path) -> np.ndarray:
    """Reads a `.npy` file of one or two dimensions, without pickle, so that its content cannot run code."""
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


def read_array_channels(path: Path, columns: list[str] | None, time: str | None, options: Cleaning) -> dict[str, pd.Series]:
    """Reads the columns of an array; see `sources.read_source`, which calls it. `options` has no effect, since there are no times.

    Of an array in the layout of `commands`, only column 0 is read, unless columns are named.
    """
    if time not in (None, NO_TIME):
        raise InputError(f"Expected time with a table only. Received: time={time!r} with {path.name}. Leave it out.")
    array = _load(path)
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
    if columns is None and has_commands(array):
        series = pd.Series(array[:, 0], name=names["0"])
        text = f"columns 1 to {len(known) - 1} hold only 0 and 1 and were taken as commands, not as channels: {len(known) - 1}"
        series.attrs["findings"] = [Finding("commands", len(known) - 1, text).to_dict()]
        return {names["0"]: series}
    return {names[column]: pd.Series(array[:, int(column)], name=names[column]) for column in columns or known}
