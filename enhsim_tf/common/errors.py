"""The one error that stands for a user's mistake; the commands turn it into one line and exit code 2."""

import os
import re

_MAX_CHARACTERS, _END = 600, 150  # of a message, and of these at its end, where it says what to do
_PASSWORD = re.compile(r"(?<=//)[^/@\s]*:(?!\d+/)[^@]{0,200}@|(?<![^\s'\"(=])[^@/:\s'\"(=]+:[^@/\s]+@(?=[^\s@]*:\d)")
"""The name and the password of an address: behind its //, up to the @; or, of one without, before `@host:port`."""
_TOKEN, _MIN_TOKEN_CHARACTERS = "INFLUXDB_V2_TOKEN", 8  # what is shorter is a word that a message may need


class InputError(ValueError):
    """Input that cannot be used. The message says what was expected, what was received and what to do.

    It is one line of printable characters, however long or hostile what it quotes of the input, and holds neither the
    password of an address nor the token of the database.

    Args:
        message: What is wrong.
    """

    def __init__(self, message: str = ""):
        line = printable(" ".join(str(message).splitlines()))
        token = os.environ.get(_TOKEN, "")
        for form in (token, repr(token)[1:-1]) if len(token) >= _MIN_TOKEN_CHARACTERS else ():  # as it is, and as a message quotes it
            line = line.replace(form, "***")
        line = _PASSWORD.sub("***@", line)
        if len(line) > _MAX_CHARACTERS:
            line = f"{line[: _MAX_CHARACTERS - _END - 5]} ... {line[-_END:]}"
        super().__init__(line)


def printable(text: str) -> str:
    """Text for one line of a terminal: what cannot be printed, such as a line's end, becomes a question mark."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
