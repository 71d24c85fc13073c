"""What a file says of its own size, compared with the file before memory is taken for it; nothing in a file is executed.

A header of a hundred bytes can declare a thousand gigabytes. Arrays have to be as long as they say; tables and archives
may be compressed, but not beyond what telemetry ever is. A file that cannot be read at all is a `ValueError` in one line.
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

MAX_COLUMNS = 10_000  # of a table or an array; each becomes a channel
_SMALL_TABLE_VALUES = 2_000_000  # that any table may hold, however small its file
_MAX_VALUES_PER_BYTE = 100  # of the file, beyond that
_SMALL_TEXT_BYTES = 2**28  # that any text column may become in memory
READ_ERRORS = (  # what damaged headers and archives raise
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
    """The array of a `.npy` file, without pickle; its file has to be as long as its header says.

    Raises:
        ValueError: If it cannot be read; the message says why.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that a header was written by Python 2
            mapped = np.load(path, mmap_mode="r", allow_pickle=False)  # a map beyond the file's end is refused
    except READ_ERRORS as error:
        raise ValueError(short_reason(error)) from None
    if not isinstance(mapped, np.ndarray):
        mapped.close()
        raise ValueError("an archive")
    if mapped.dtype.itemsize == 0:
        raise ValueError(f"dtype {mapped.dtype}, which holds nothing")
    array = np.array(mapped)
    if array.dtype.kind == "U":
        letters = np.ravel(array).view(np.dtype("u4").newbyteorder(array.dtype.byteorder))
        if (letters > 0x10FFFF).any() or ((letters >= 0xD800) & (letters < 0xE000)).any():
            raise ValueError("text that is no Unicode")
    return array


def load_npz(path: str | os.PathLike, max_bytes: int) -> dict[str, np.ndarray]:
    """The arrays of a `.npz` file, without pickle.

    Args:
        path: The file.
        max_bytes: What all of them may have together.

    Raises:
        ValueError: If it cannot be read, or is larger; the message says why.
    """
    try:
        with zipfile.ZipFile(path) as archive, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            members = archive.infolist()
            if sum(member.file_size for member in members) > max_bytes:
                raise ValueError("larger than such a file is")
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
    """Refuses a Parquet file that would become far larger in memory than any telemetry of its size.

    Raises:
        ValueError: If it would, or cannot be read; the message says why.
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
            # of a list a row has many values, and one of fixed width may be wide
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
    """Refuses columns of text that repeat long words until they fill the memory; the others' size is known from the rows."""
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
    """What a JSON file holds.

    Args:
        path: The file.
        max_bytes: Its largest size.

    Raises:
        ValueError: If it is larger, nested too deeply, or no JSON; the message says why.
        OSError: If it cannot be read.
    """
    if Path(path).exists() and not Path(path).is_file():  # a pipe would be waited for
        raise ValueError("what is no file")
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
    """The first line of an error, or what it is called."""
    return (getattr(error, "strerror", None) or str(error)).splitlines()[0] if str(error).splitlines() else type(error).__name__
