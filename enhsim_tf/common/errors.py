"""The exception for a user's mistake. The commands print it as one line and exit with code 2."""

import os
import re
from collections.abc import Sequence

_MAX_CHARACTERS, _END = (
    600,
    150,
)  # a longer message loses its middle; its last 150 characters, which say what to do, stay
_PASSWORD = re.compile(
    r"(?<=//)[^/@\s]*:(?!\d+/)[^@]{0,200}@|(?<![^\s'\"(=])[^@/:\s'\"(=]+:[^@/\s]+@(?=[^\s@]*:\d)"
)
"""Matches `user:password@` in a URL, either after `//` or, in an address without a scheme, before `host:port`."""
_TOKEN, _MIN_TOKEN_CHARACTERS = (
    "INFLUXDB_V2_TOKEN",
    8,
)  # a shorter token may be an ordinary word of a message, so it is not masked


class InputError(ValueError):
    """Raised when input cannot be used. The message says what was expected, what was received and what to do.

    The message is always one line of printable characters and at most 600 characters long, even where it quotes hostile
    input. Passwords in URLs and the InfluxDB token are masked with `***`.

    Args:
        message: Description of the problem.
    """

    def __init__(self, message: str = ""):
        line = printable(" ".join(str(message).splitlines()))
        token = os.environ.get(_TOKEN, "")
        for form in (
            (token, repr(token)[1:-1]) if len(token) >= _MIN_TOKEN_CHARACTERS else ()
        ):  # plain, and escaped by repr()
            line = line.replace(form, "***")
        line = _PASSWORD.sub("***@", line)
        if len(line) > _MAX_CHARACTERS:
            line = f"{line[: _MAX_CHARACTERS - _END - 5]} ... {line[-_END:]}"
        super().__init__(line)


def printable(text: str) -> str:
    """Replaces every character that cannot be printed, such as a line break, by a question mark."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def spoken(channels: Sequence[str]) -> str:
    """Returns the channels as a line of a report names them: up to three by their names, more by their number."""
    return printable(", ".join(channels) if len(channels) <= 3 else f"{len(channels)} channels")


def counted(number: int, noun: str) -> str:
    """Formats a number with its noun, for example `1 window`, `2,000 windows` or `3 anomalies`."""
    several = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{number:,} {noun if number == 1 else several}"
