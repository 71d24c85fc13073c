"""Reads files safely: rejects files whose headers declare more data than they contain, and never executes their content.

A header of a hundred bytes can declare a thousand gigabytes, so sizes are checked before memory is allocated. An array file
must have exactly the size that its header declares. Tables and archives may be compressed, but only up to a limit that real
telemetry stays below. A file that cannot be read raises a `ValueError` with a message of one line.
"""

import json
import math
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
_SMALL_TEXT_BYTES = 2**28  # a text column that needs less memory is accepted, however small its file is
READ_ERRORS = (  # exceptions raised for damaged headers and archives
    OSError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    EOFError,
    MemoryError,
    OverflowError,
    RecursionError,
    SyntaxError,
    NotImplementedError,
    RuntimeError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)


def load_npy(path: str | os.PathLike) -> np.ndarray:
    """Loads a `.npy` file without pickle. The file must be as long as its header declares.

    Args:
        path: The file.

    Returns:
        The array.

    Raises:
        ValueError: If the file cannot be read. The message says why.
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
    if mapped.dtype.itemsize == 0:
        raise ValueError(f"dtype {mapped.dtype}, which has no size")
    array = np.array(mapped)
    if array.dtype.kind == "U":
        letters = np.ravel(array).view(np.dtype("u4").newbyteorder(array.dtype.byteorder))
        if (letters > 0x10FFFF).any() or ((letters >= 0xD800) & (letters < 0xE000)).any():
            raise ValueError("text that is not valid Unicode")
    return array


def load_npz(path: str | os.PathLike, max_bytes: int) -> dict[str, np.ndarray]:
    """Loads the arrays of a `.npz` file without pickle.

    Args:
        path: The file.
        max_bytes: Largest total size of the uncompressed arrays.

    Returns:
        The arrays by name.

    Raises:
        ValueError: If the file cannot be read or is too large. The message says why.
    """
    try:
        with zipfile.ZipFile(path) as archive, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            members = archive.infolist()
            if sum(member.file_size for member in members) > max_bytes:
                raise ValueError(f"more than {max_bytes:,} bytes of arrays")
            return {member.filename.removesuffix(".npy"): _array_of(archive, member) for member in members}
    except READ_ERRORS as error:
        raise ValueError(short_reason(error)) from None


def _array_of(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    with archive.open(member) as file:
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, is_fortran, dtype = read[np.lib.format.read_magic(file)](file)
        if dtype.hasobject or math.prod(shape) * dtype.itemsize != member.file_size - file.tell():
            raise ValueError("arrays of another size than their headers say")
        values = np.frombuffer(bytearray(file.read()), dtype)
    return values.reshape(shape, order="F" if is_fortran else "C")


def check_parquet(path: str | os.PathLike) -> None:
    """Checks that a Parquet file does not become far larger in memory than real telemetry in a file of its size.

    Args:
        path: The file.

    Raises:
        ValueError: If the file is too large in memory or cannot be read. The message says why.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        size, file = Path(path).stat().st_size, pq.ParquetFile(path)
        with file:
            about = file.metadata
            if about.num_columns > MAX_COLUMNS:
                raise ValueError(f"more than {MAX_COLUMNS:,} columns")
            chunks = [
                (about.row_group(group).column(column), about.schema.column(column))
                for group in range(about.num_row_groups)
                for column in range(about.num_columns)
            ]
            # a row of a list column has many values, and a value of fixed width may be wide
            values = max(about.num_rows * max(1, about.num_columns), sum(chunk.num_values for chunk, _ in chunks))
            if values > max(_SMALL_TABLE_VALUES, _MAX_VALUES_PER_BYTE * size):
                raise ValueError(f"{values:,} values in {size:,} bytes, more than a file of telemetry holds; save it as CSV")
            max_bytes = max(_SMALL_TEXT_BYTES, _MAX_VALUES_PER_BYTE * size)
            if sum(chunk.num_values * (column.length or 0) for chunk, column in chunks) > max_bytes:
                raise ValueError(f"values of fixed width that become {max_bytes:,} bytes and more; save it as CSV")
            _check_text(file, max_bytes)
    except (*READ_ERRORS, pa.ArrowException) as error:
        raise ValueError(short_reason(error)) from None


def _check_text(file: Any, max_bytes: int) -> None:
    """Raises a `ValueError` for text columns that expand far beyond the file's size; other columns are checked by their row count."""
    for column in range(file.metadata.num_columns):
        if file.metadata.schema.column(column).physical_type != "BYTE_ARRAY":
            continue
        groups = [file.metadata.row_group(number) for number in range(file.metadata.num_row_groups)]
        longest = max((max(1, group.column(column).total_uncompressed_size) for group in groups), default=1)
        if longest * file.metadata.num_rows <= max_bytes:
            continue
        total, name = 0, file.metadata.schema.column(column).path.split(".")[0]
        for batch in file.iter_batches(max(1, _SMALL_TEXT_BYTES // longest), columns=[name]):
            total += batch.nbytes
            if total > max_bytes:
                raise ValueError(f"text that becomes {max_bytes:,} bytes and more; save it as CSV")


def read_json(path: str | os.PathLike, max_bytes: int) -> Any:
    """Loads a JSON file.

    Args:
        path: The file.
        max_bytes: Largest allowed size of the file.

    Returns:
        The decoded content.

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
