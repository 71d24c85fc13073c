"""Reads arrays as channels without times, and the commands that some of them hold.

In telemanom's SMAP and MSL data, column 0 of an array is the value, and each of the 24 or 54 other columns is 1 at the samples at which
one command was sent and 0 at all others.
"""

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS, READ_ERRORS, short_reason
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.reading.channels import Channels
from enhsim_tf.telemetry.reading.clock import NO_TIME

_NUM_COLUMNS = (25, 55)  # of the published arrays with commands: SMAP, MSL


def read_array_channels(path: Path, columns: list[str] | None, time: str | None) -> Channels:
    """Reads the columns of an array; see `sources.read_source`, which calls it.

    Of an array with commands, only column 0 is read, unless columns are named. The commands are returned beside it, but not if one of them
    is named as a channel: it would be explained by itself.
    """
    if time not in (None, NO_TIME):
        raise InputError(f"Expected time with a table only. Received: time={time!r} with {path.name}. Leave it out.")
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
        raise InputError(f"Expected at most {MAX_COLUMNS:,} columns. Received: {array.shape[1]:,} in {path.name}. Name those to be read.")
    known, last, found = {str(number): number for number in range(array.shape[1])}, array.shape[1] - 1, {}
    has_commands = columns in (None, ["0"]) and _has_commands(array)
    for column in ["0"] if has_commands else columns or known:
        if column not in known:
            raise InputError(f"Expected a column of {path.name}, a number from 0 to {last}. Received: {column!r}. Name one of these.")
        name = path.stem if last == 0 else f"{path.stem}.{column}"
        found[name] = pd.Series(array[:, known[column]], name=name)
        if has_commands and columns is None:
            text = f"columns 1 to {last} hold only 0 and 1 and were taken as commands, not as channels: {last}"
            found[name].attrs["findings"] = [dataclasses.asdict(Finding("commands", last, text))]
    return Channels(found, commands=array[:, 1:].astype(np.float32) if has_commands else None)


def _has_commands(array: np.ndarray) -> bool:
    """Whether an array has the published layout: 25 or 55 columns, of which all after the first hold only zeros and ones."""
    has_layout = array.shape[1] in _NUM_COLUMNS and array.dtype.kind in "fiu" and len(array)
    return bool(has_layout) and bool(np.isin(array[:, 1:], (0, 1)).all())
