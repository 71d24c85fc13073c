"""Reads files safely: rejects files whose headers declare more data than they contain, and never executes their content.

A header of a hundred bytes can declare a thousand gigabytes, so sizes are checked before memory is allocated. Tables and archives may
be compressed, but only up to a limit that real telemetry stays below. A file that cannot be read raises a `ValueError` of one line.
"""

import json
import os
import struct
import tokenize
import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

MAX_COLUMNS = 10_000  # of a table or an array; each column becomes a channel
_SMALL_TABLE_VALUES = 2_000_000  # a table with fewer values is accepted, however small its file is
_MAX_VALUES_PER_BYTE = 100  # a larger table may hold this many values for each byte of its file
_SMALL_TEXT_BYTES = 2**28  # text that needs less memory is accepted, however small its file is
_DAMAGED = (tokenize.TokenError, zipfile.BadZipFile, zlib.error, struct.error, EOFError, SyntaxError, OverflowError)
READ_ERRORS = (OSError, ValueError, TypeError, LookupError, AttributeError, MemoryError, RuntimeError, *_DAMAGED)
"""Exceptions raised for damaged headers and archives; RuntimeError includes RecursionError and NotImplementedError."""


def load_npy(path: str | os.PathLike) -> np.ndarray:
    """Loads a `.npy` file of numbers, truth values or times, without pickle.

    Raises:
        ValueError: If the file holds something else, or is shorter than its header declares. The message says why.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # NumPy warns of headers written by Python 2
            mapped = np.load(path, mmap_mode="r", allow_pickle=False)  # memory-mapping fails if the file is too short
    except READ_ERRORS as error:
        raise ValueError(short_reason(error)) from None
    if not isinstance(mapped, np.ndarray):
        mapped.close()
        raise ValueError("an archive")
    if mapped.dtype.kind in "SUV":  # text, bytes and records, whose elements may have no size
        raise ValueError(f"dtype {mapped.dtype}, no numbers; save records as a table")
    return np.array(mapped)


def load_npz(path: str | os.PathLike, max_bytes: int) -> dict[str, np.ndarray]:
    """Loads the arrays of a `.npz` file by name, without pickle.

    Raises:
        ValueError: If the file cannot be read, or its uncompressed arrays are larger than `max_bytes`. The message says why.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > max_bytes:
                raise ValueError(f"more than {max_bytes:,} bytes of arrays")
        with warnings.catch_warnings(), np.load(path, allow_pickle=False) as arrays:
            warnings.simplefilter("ignore", UserWarning)
            return dict(arrays)
    except READ_ERRORS as error:
        raise ValueError(short_reason(error)) from None


def check_parquet(path: str | os.PathLike) -> None:
    """Checks that a Parquet file does not become far larger in memory than real telemetry in a file of its size.

    Raises:
        ValueError: If the file is too large in memory or cannot be read. The message says why.
    """
    import pyarrow as pa  # slow, and needed only here
    import pyarrow.parquet as pq

    try:
        size = Path(path).stat().st_size
        with pq.ParquetFile(path) as file:
            about, groups = file.metadata, range(file.metadata.num_row_groups)
            if about.num_columns > MAX_COLUMNS:
                raise ValueError(f"more than {MAX_COLUMNS:,} columns")
            columns = [[about.row_group(group).column(number) for group in groups] for number in range(about.num_columns)]
            # a row of a list column has many values
            values = max(about.num_rows * max(1, about.num_columns), sum(chunk.num_values for chunks in columns for chunk in chunks))
            if values > max(_SMALL_TABLE_VALUES, _MAX_VALUES_PER_BYTE * size):
                raise ValueError(f"{values:,} values in {size:,} bytes, more than a file of telemetry holds; save it as CSV")
            for number, chunks in enumerate(columns):
                column = about.schema.column(number)
                if column.physical_type in ("BYTE_ARRAY", "FIXED_LEN_BYTE_ARRAY"):
                    widest = max(1, column.length or 0, *(chunk.total_uncompressed_size for chunk in chunks))
                    _check_text(file, column.path.split(".")[0], widest, max(_SMALL_TEXT_BYTES, _MAX_VALUES_PER_BYTE * size))
    except (*READ_ERRORS, pa.ArrowException) as error:
        raise ValueError(short_reason(error)) from None


def _check_text(file: Any, name: str, widest: int, max_bytes: int) -> None:
    """Raises a `ValueError` for a text column, of no value longer than `widest`, that expands far beyond the file's size."""
    if widest * file.metadata.num_rows <= max_bytes:
        return
    total = 0
    for batch in file.iter_batches(max(1, _SMALL_TEXT_BYTES // widest), columns=[name]):
        total += batch.nbytes
        if total > max_bytes:
            raise ValueError(f"text that becomes {max_bytes:,} bytes and more; save it as CSV")


def read_json(path: str | os.PathLike, max_bytes: int) -> Any:
    """Loads a JSON file of at most `max_bytes`.

    Raises:
        ValueError: If the file is too large, nested too deeply, or not valid JSON. The message says why.
        OSError: If the file cannot be read.
    """
    if Path(path).exists() and not Path(path).is_file():  # reading a pipe would block
        raise ValueError("something that is not a regular file")
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        if size > max_bytes:
            raise ValueError("a file too large")
        content = file.read(size)
    try:
        return json.loads(content.decode())
    except RecursionError:
        raise ValueError("a file nested too deeply") from None


def short_reason(error: Exception) -> str:
    """The first line of an error's message, or the name of its type if the message is empty."""
    return (getattr(error, "strerror", None) or str(error)).splitlines()[0] if str(error).splitlines() else type(error).__name__
