"""A robot that follows the advice of refusals: it gives each option that an error carries, in the
form that a command takes, until the source is read or no option is left.
"""

import dataclasses
import os
import shlex
from pathlib import Path

from enhsim_tf.cli.arguments import parse
from enhsim_tf.cli.checks import cleaning_options
from enhsim_tf.common.errors import InputError, option_text
from enhsim_tf.telemetry.cleaning.clean import clean_all
from enhsim_tf.telemetry.sources import read_source

STEPS = 3


@dataclasses.dataclass(frozen=True)
class Ending:
    """How following some advice ends: with cleaned channels by their names, or with a message."""

    options: tuple[str, ...]
    channels: dict | None = None
    message: str = ""


def read(words: list[str]) -> dict:
    """Reads and cleans all channels of a source, given with options as `inject` takes them."""
    options = parse(["inject", *words, "--kinds", "spike", "--out", "out"])
    cleaning = cleaning_options(options, 3)
    channels = read_source(options.source, options.column, options.time, cleaning)
    return clean_all(channels, cleaning)


def follow(words: list[str], given: tuple[str, ...] = ()) -> list[Ending]:
    """Returns all endings of following the advice for at most `STEPS` steps.

    Raises an AssertionError for an option that changes nothing, and for advice that goes on.
    """
    try:
        return [
            Ending(given, read([*words, *(word for text in given for word in shlex.split(text))]))
        ]
    except InputError as error:
        endings, message = [], str(error)
        for option in map(option_text, error.options):
            assert option in message or len(error.options) > 6, (option, message)
            assert option not in given, f"in a circle: {given} and {option}: {message}"
            endings += follow(words, (*given, option)) if len(given) < STEPS else []
            same = [
                end for end in endings if end.options[-1:] == (option,) and end.message == message
            ]
            assert not same, f"without effect: {option}: {message}"
        assert endings or len(given) <= STEPS
        return endings or [Ending(given, None, message)]


def in_folder(folder: Path, line: str) -> list[Ending]:
    """Follows the advice for the source of a line of a command in a folder."""
    words = shlex.split(line)
    words = words[words.index("enhsim_tf") + 2 :]
    options = parse([words and "inject", *_reading(words), "--kinds", "spike", "--out", "out"])
    assert options.source
    before = os.getcwd()
    os.chdir(folder)
    try:
        return follow(_reading(words))
    finally:
        os.chdir(before)


def _reading(words: list[str]) -> list[str]:
    """Keeps of the words of a command those that say what is read, and how."""
    kept, of_reading = (
        [],
        "--column --time --interval --label-column --series-column --decimal".split(),
    )
    of_reading += "--time-format --missing-values --timezone --max-fill --fill --table".split()
    alone = ["--no-header", "--drop-bad", "--states"]
    place = 0
    while place < len(words):
        word = words[place]
        has_value = word.startswith("--") and "=" not in word and word not in alone
        if not word.startswith("--") or word.partition("=")[0] in (*of_reading, *alone):
            kept += words[place : place + 1 + has_value]
        place += 1 + has_value
    return kept
