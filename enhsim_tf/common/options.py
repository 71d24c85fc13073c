"""Options that are declared once: a field of a dataclass has its help, default and limits, which
hold in Python and on the command line (`cli.fields`).
"""

import dataclasses
import math
from collections.abc import Callable, Collection
from typing import Any

from enhsim_tf.common.errors import InputError


def option(
    default: Any,
    help_text: str,
    kind: type = int,
    least: float | None = None,
    most: float | None = None,
    choices: Collection[str] = (),
    metavar: str = "N",
    repeated: bool = False,
    parse: Callable[[str], Any] | None = None,
) -> Any:
    """Declares a field.

    Args:
        default: Default. If it is None, None is valid too.
        help_text: What the option is, as `--help` says it, which adds a default that is not None.
        kind: `int`, `float`, `str`, or `bool` for an option without a value.
        least: Smallest number.
        most: Largest number.
        choices: Valid texts. On the command line, blanks in them are hyphens.
        metavar: What stands for the value in `--help`.
        repeated: Whether the command takes the option several times.
        parse: Makes the value of the text on the command line. None: `kind` does.
    """
    metadata = {
        "help": help_text,
        "kind": kind,
        "least": least,
        "most": most,
        "choices": choices,
        "metavar": metavar,
        "repeated": repeated,
        "parse": parse,
    }
    return dataclasses.field(default=default, metadata=metadata)


def flag_of(name: str) -> str:
    """The option of the commands for a field, for example `--held-out` for `held_out`."""
    return "--" + name.removesuffix("_s").replace("_", "-")


def check_options(options: Any) -> None:
    """Raises InputError if a declared field of a dataclass is out of range."""
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if field.metadata and not (value is None and field.default is None):
            _check(field, value)


def _check(field: dataclasses.Field, value: Any) -> None:
    limits = field.metadata
    if limits["choices"]:
        if value not in limits["choices"]:
            raise InputError(
                f"Expected {field.name}, one of: {', '.join(limits['choices'])}. Received: "
                f"{field.name}={value!r}."
            )
    elif limits["kind"] in (int, float):
        low = limits["least"]
        high = limits["most"]
        numbers = int if limits["kind"] is int else (int, float)
        is_number = isinstance(value, numbers) and not isinstance(value, bool)
        is_number = is_number and abs(value) < math.inf
        is_within = is_number and (low is None or value >= low) and (high is None or value <= high)
        if not is_within:
            what = "a whole number" if limits["kind"] is int else "a number"
            span = "" if low is None else f" of at least {low:,}"
            if high is not None:
                span = f" from {low:,} to {high:,}"
            raise InputError(
                f"Expected {field.name} ({flag_of(field.name)}) to be {what}{span}. Received: "
                f"{field.name}={value!r}. Choose another."
            )
