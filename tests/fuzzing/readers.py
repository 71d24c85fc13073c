"""What the files of this folder share: changed inputs, and the judgement of what a reader does with
one.

Every input is accepted, or refused with an `InputError` of one printable line. The slow tests try a
few inputs of each reader, the same each time; `ENHSIM_TF_FUZZ=10000 python -m pytest --slow
tests/fuzzing` tries as many others.
"""

import os
import tempfile
import warnings
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from enhsim_tf.common.errors import InputError

_LONG = int(os.environ.get("ENHSIM_TF_FUZZ", 0))
_MAX_CHARACTERS = 600

NASTY = (
    "", " ", ".", "..", "../../x", "/etc/passwd", "a\\b", "CON", "x" * 300, "\x00", "\n", "\r\n", "\x1b[31m", "\u202e", "é", "'\";--", "{}", "[]", "null",
    "nan", "-inf", "1e999", "-0", "1" * 400, "0x10", "1_000", "٣", "1.500,0", "9999-12-31T23:59:60Z", "0001-01-01", "2024-10-27 02:30:00", "=", ":", "%",
    "%ff", "&", "?", "#", "1:2:3", "1e-400", "*a", "&a", "!!python/object:os.system", "- ", "\t", '"', ",,,,", ";", "P1D", "-9223372036854775808",
)  # fmt: skip
# long cells and names, which no pattern may take more than linear time for
LONG = [text * (30_000 // len(text)) for text in ("7", "x", "1.", "a:", "='", "1 ", "[", '"')]
LONG += ["7" * 20_000 + " V", "1," * 30_000]
_PIECES = st.sampled_from([text.encode() for text in (*NASTY, *LONG)]) | st.binary(max_size=8)


@st.composite
def changed(draw, seeds):
    """Valid bytes in which up to four pieces are replaced, dropped, repeated, or taken from another
    valid input.
    """
    data = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(0, 4))):
        begin = draw(st.integers(0, len(data)))
        end = min(len(data), begin + draw(st.sampled_from([0, 1, 2, 8, 64, len(data)])))
        other = draw(st.sampled_from(seeds))
        data = (
            data[:begin]
            + draw(_PIECES | st.just(data[begin:end] * 2) | st.just(other[begin:end]))
            + data[end:]
        )
    return data


def tried(examples):
    """Settings of a slow test that tries that many inputs in an ordinary run."""
    number, checks = _LONG or examples, list(HealthCheck)
    chosen = settings(
        derandomize=not _LONG,
        max_examples=number,
        deadline=None,
        database=None,
        suppress_health_check=checks,
    )
    return lambda test: pytest.mark.slow(chosen(test))


def judge(read, *arguments):
    """Calls a reader with the arguments and an empty folder; any outcome but acceptance, True, and
    a good refusal, False, raises.
    """
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", UserWarning)  # as in all tests
        os.chdir(folder)
        try:
            read(*arguments, Path(folder))
        except InputError as error:
            assert is_good(str(error)), repr(error)
            return False
        finally:
            os.chdir(before)
    return True


def is_good(line):
    """Whether an error message is one short printable line that says what was expected and
    received.
    """
    return (
        line.isprintable()
        and len(line) <= _MAX_CHARACTERS
        and line.startswith("Expected ")
        and "Received: " in line
    )


def all_of(*calls):
    """Makes all calls. If all of them refuse, raises the first refusal at the end."""
    refusals = []
    for call in calls:
        try:
            call()
        except InputError as error:
            assert is_good(str(error)), repr(error)
            refusals.append(error)
    if len(refusals) == len(calls):
        raise refusals[0]
