"""What readers of a user's files share: the exceptions of damaged files, how they become one line,
and the most columns of a table.
"""

import contextlib
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator

from enhsim_tf.common.errors import InputError

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
"""Exceptions raised for damaged headers and archives; RuntimeError includes RecursionError and
NotImplementedError.
"""


@contextlib.contextmanager
def reading(name: str, *others: type[Exception]) -> Iterator[None]:
    """Turns what a library raises for a damaged file, these exceptions or `others`, into an
    `InputError`. Only calls of libraries stand in its block, so that no defect of ours is said to
    be one of the file.
    """
    try:
        yield
    except InputError:
        raise
    except (*READ_ERRORS, *others) as error:
        raise InputError(
            f"Expected a table. Received: {name}, which cannot be read ({short_reason(error)}). "
            "Correct it or save it again."
        ) from None


def short_reason(error: Exception) -> str:
    """The first line of an error's message, or the name of its type if the message is empty."""
    return next(
        iter((getattr(error, "strerror", None) or str(error)).splitlines()), type(error).__name__
    )
