"""A fuzzing target: a function of bytes, seed inputs, and the mutations to apply."""

import dataclasses
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from enhsim_tf.common.errors import InputError
from tests.fuzzing.mutations import change_bytes, change_json, change_text

MAX_CHARACTERS = 600  # of an error message
CHANGES = {"bytes": change_bytes, "text": change_text, "json": change_json}


class UnusedError(Exception):
    """Raised for bytes that are not an input for a target. They are not counted."""


@dataclasses.dataclass(frozen=True)
class Target:
    """A function under test and how inputs for it are made.

    Args:
        run: Called with an input and an empty folder. Raises `InputError` to refuse the input.
        seeds: Returns valid inputs.
        form: Kind of mutations: "bytes", "text" or "json".
        weight: Number of inputs relative to other targets.
    """

    run: Callable[[bytes, Path], None]
    seeds: Callable[[], list[bytes]]
    form: str = "bytes"
    weight: float = 1.0

    def change(self, data: bytes, rng: random.Random, seeds: list[bytes]) -> bytes:
        """Returns a mutated input. One in ten is mutated as bytes, whatever `form` is."""
        form = "bytes" if rng.random() < 0.1 else self.form
        return CHANGES[form](data, rng, seeds)


def all_of(*calls: Callable[[], None]) -> None:
    """Makes all calls. If all of them raise `InputError`, raises the first one at the end."""
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
    """Whether an error message is one short printable line that says what was expected and received."""
    return line.isprintable() and len(line) <= MAX_CHARACTERS and line.startswith("Expected ") and "Received: " in line


def text_of(data: bytes) -> str:
    """Decodes bytes as the command line does: invalid UTF-8 becomes surrogates."""
    return data.decode("utf-8", "surrogateescape")


def json_of(data: bytes) -> dict[str, Any]:
    """Parses a JSON object; other bytes count as unused."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        raise UnusedError from None
    if not isinstance(content, dict):
        raise UnusedError
    return content
