"""Commands that a file of telemetry holds beside the value: the arrays of telemanom's SMAP and MSL data.

Column 0 of such an array is the value, and each of the 24 or 54 other columns is 1 at the samples at which one command was sent and 0
at all others.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enhsim_tf.common.size_limits import load_npy

NUM_COLUMNS = (25, 55)  # of the published arrays: SMAP, MSL


def has_commands(array: np.ndarray) -> bool:
    """Whether an array has the published layout: 25 or 55 columns, of which all after the first hold only zeros and ones.

    Args:
        array: The array.
    """
    if array.ndim != 2 or array.shape[1] not in NUM_COLUMNS or array.dtype.kind not in "fiu" or not len(array):
        return False
    return bool(np.isin(array[:, 1:], (0, 1)).all())


def read_commands(source: str | os.PathLike, columns: Sequence[str] | None = None) -> np.ndarray | None:
    """Reads the commands of a source of telemetry.

    Args:
        source: A source as for `sources.read_source`.
        columns: Columns that are read as channels. None: all that the source has.

    Returns:
        float32 array of shape `(samples, commands)`, or None if the source is not an array of this layout, or if a column of commands is
        read as a channel: it would be explained by itself.
    """
    path = Path(source)
    if columns is not None and any(str(each) != "0" for each in columns):
        return None
    if path.suffix.lower() != ".npy" or not path.is_file():
        return None
    try:
        array = load_npy(path)
    except ValueError:  # the reader of the channels says what is wrong with the file
        return None
    return array[:, 1:].astype(np.float32) if has_commands(array) else None
