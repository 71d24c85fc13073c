"""The exception for a user's mistake. The commands print it as one line and exit with code 2."""

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

# a longer message loses its middle; its last 150 characters, which say what to do, stay
_MAX_CHARACTERS = 600
_END = 150
_MOST_OPTIONS = 6  # in a message
_LONGEST_OPTION = 300  # characters, so that it is there in whole
MANY = 8
"""Channels, above which a line of a report names only as many, and what is alike is said once."""
# options whose names differ
_WORDS = {"interval_s": "interval", "columns": "column", "start": "coarse_start"}
_SEARCHED = 4_000  # characters at each end that are searched for secrets, before it is shortened
_PASSWORD = re.compile(
    r"(?<=//)[^/@\s]*:(?!\d+/)[^@]{0,200}@|(?<![^\s'\"(=])[^@/:\s'\"(=]+:[^@/\s]+@(?=[^\s@]*:\d)"
)
"""Matches `user:password@` in a URL, either after `//` or, in an address without a scheme, before
`host:port`.
"""
# a shorter token may be an ordinary word of a message, so it is not masked
_TOKEN = "INFLUXDB_V2_TOKEN"
_MIN_TOKEN_CHARACTERS = 8


class InputError(ValueError):
    """Raised when input cannot be used. The message says what was expected, what was received and
    what to do.

    The message is always one line of printable characters and at most 600 characters long, even
    where it quotes hostile input. Passwords in URLs and the InfluxDB token are masked with `***`.

    Args:
        message: Description of the problem.
        options: What may be given instead, each as values of options of reading by their names in
            Python, without those of more than 300 characters. The message ends with them as a
            command takes them.
        otherwise: What else to do, after the options.
    """

    def __init__(
        self, message: str = "", options: Sequence[Mapping[str, Any]] = (), otherwise: str = ""
    ):
        self.message = _one_line(str(message))
        self.otherwise = otherwise
        self.options = tuple(
            dict(option) for option in options if len(option_text(option)) <= _LONGEST_OPTION
        )
        ways = [*map(option_text, self.options[:_MOST_OPTIONS]), *filter(None, [otherwise])]
        line = _one_line(f"{message} Give {', or '.join(ways)}.") if ways else self.message
        if len(line) > _MAX_CHARACTERS:
            line = f"{line[: _MAX_CHARACTERS - _END - 5]} ... {line[-_END:]}"
        super().__init__(line)


def _one_line(text: str) -> str:
    """Returns a text as one printable line without secrets, and without the middle if it is very
    long.
    """
    if len(text) > 2 * _SEARCHED:
        text = f"{text[:_SEARCHED]} ... {text[-_SEARCHED:]}"
    line = printable(" ".join(text.splitlines()))
    token = os.environ.get(_TOKEN, "")
    # plain, and escaped by repr()
    for form in (token, repr(token)[1:-1]) if len(token) >= _MIN_TOKEN_CHARACTERS else ():
        line = line.replace(form, "***")
    return _PASSWORD.sub("***@", line)


def option_text(option: Mapping[str, Any]) -> str:
    """Returns options of reading as a command takes them, such as `--time-format us`."""
    words = []
    for name, given in option.items():
        word = f"--{_WORDS.get(name, name).replace('_', '-')}"
        for value in given if isinstance(given, list | tuple) else [given]:
            text = value if isinstance(value, str) else repr(value)
            joint = "=" if text.startswith("-") else " "
            words.append(word if value is True else f"{word}{joint}{shlex.quote(text)}")
    return " ".join(words)


def printable(text: str) -> str:
    """Replaces every character that cannot be printed, such as a line break, by a question mark."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def spoken(channels: Sequence[str]) -> str:
    """Returns the channels as a line of a report names them: up to three by their names, more by
    their number.
    """
    return printable(", ".join(channels) if len(channels) <= 3 else f"{len(channels)} channels")


def named(channels: Sequence[str]) -> str:
    """Returns the names of the first channels, and how many more there are."""
    more = f" and {len(channels) - MANY:,} more" if len(channels) > MANY else ""
    return printable(", ".join(channels[:MANY])) + more


def counted(number: int, noun: str) -> str:
    """Formats a number with its noun, for example `1 window`, `2,000 windows` or `3 anomalies`."""
    several = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{number:,} {noun if number == 1 else several}"
