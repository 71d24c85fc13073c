"""What a target is: a function of bytes, seeds to begin with, and a way to change them."""

import dataclasses
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from enhsim_tf.common.errors import InputError
from tests.fuzzing.mutations import change_bytes, change_json, change_text

MOST_LETTERS = 600  # of a refusal
CHANGES = {"bytes": change_bytes, "text": change_text, "json": change_json}


class UnusedError(Exception):
    """Bytes that are no input for a target; they are not counted."""


@dataclasses.dataclass(frozen=True)
class Target:
    """A loader and how inputs for it are made.

    Args:
        run: Takes an input and an empty folder; `InputError` refuses the input.
        seeds: Makes valid inputs.
        form: bytes, text or json: how inputs are changed.
        weight: Its share of the inputs, against the others'.
    """

    run: Callable[[bytes, Path], None]
    seeds: Callable[[], list[bytes]]
    form: str = "bytes"
    weight: float = 1.0

    def change(self, data: bytes, rng: random.Random, seeds: list[bytes]) -> bytes:
        """A changed input; now and then by its bytes, whatever its form is."""
        form = "bytes" if rng.random() < 0.1 else self.form
        return CHANGES[form](data, rng, seeds)


def all_of(*calls: Callable[[], None]) -> None:
    """Makes all calls; if each refuses, a refusal is raised at the end."""
    refusals = []
    for call in calls:
        try:
            call()
        except InputError as error:
            refusals.append(error)
    assert all(is_good(str(refusal)) for refusal in refusals), refusals
    if len(refusals) == len(calls):
        raise refusals[0]


def is_good(line: str) -> bool:
    """Whether a refusal is one printable line, not too long, that says what was expected and received."""
    return line.isprintable() and len(line) <= MOST_LETTERS and line.startswith("Expected ") and "Received: " in line


def text_of(data: bytes) -> str:
    """Text as the command line gives it: what is not UTF-8 becomes surrogates."""
    return data.decode("utf-8", "surrogateescape")


def json_of(data: bytes) -> dict[str, Any]:
    """A JSON object that a target makes a file of; other bytes are unused."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        raise UnusedError from None
    if not isinstance(content, dict):
        raise UnusedError
    return content
