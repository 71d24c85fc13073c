"""What readers of a user's files share: the exceptions of damaged files, how they become one line, and the most columns of a table."""

import struct
import tokenize
import zipfile
import zlib

MAX_COLUMNS = 10_000  # of a table or an array; each column becomes a channel
_DAMAGED = (
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    SyntaxError,
    OverflowError,
)
READ_ERRORS = (
    OSError,
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    MemoryError,
    RuntimeError,
    *_DAMAGED,
)
"""Exceptions raised for damaged headers and archives; RuntimeError includes RecursionError and NotImplementedError."""


def short_reason(error: Exception) -> str:
    """The first line of an error's message, or the name of its type if the message is empty."""
    return next(
        iter((getattr(error, "strerror", None) or str(error)).splitlines()), type(error).__name__
    )
