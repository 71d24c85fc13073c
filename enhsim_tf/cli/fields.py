"""Options that dataclasses declare, on the command line; see `common.options`."""

import argparse
import dataclasses
from typing import Any

from enhsim_tf.common.options import flag_of

Parser = argparse.ArgumentParser | argparse._ArgumentGroup


def spelled(name: str) -> str:
    """A choice as it is written on the command line, for example `residual-windows` for `residual
    windows`.
    """
    return name.casefold().replace(" ", "-")


def add_options(parser: Parser, options: type, *names: str) -> None:
    """Adds fields of a dataclass, given by name, to a parser or a group of it."""
    fields = {field.name: field for field in dataclasses.fields(options)}
    for name in names:
        field = fields[name]
        about = field.metadata
        default = field.default
        text = about["help"]
        given: dict[str, Any] = {"type": about["kind"], "metavar": about["metavar"]}
        if about["kind"] is bool:
            given = {"action": "store_true"}
        elif about["repeated"]:
            given = {"action": "append", "metavar": about["metavar"]}
            text += "; may be repeated"
            default = None
        elif about["choices"]:
            default = default and spelled(default)
            given = {"choices": tuple(map(spelled, about["choices"]))}
        if about["parse"]:
            default = None
        if default is not None and default is not False:
            text += f" (default: {default})"
        parser.add_argument(flag_of(name), dest=name, default=default, help=text, **given)


def options_from(namespace: argparse.Namespace, options: type) -> Any:
    """Makes an object of a dataclass from a parsed command line; raises InputError if a value is
    out of range. Options that are not given keep their defaults.
    """
    given = {}
    for field in dataclasses.fields(options):
        value = getattr(namespace, field.name, None)
        if value is not None:
            if field.metadata.get("parse"):
                value = field.metadata["parse"](value)
            elif field.metadata.get("choices"):
                names = {spelled(name): name for name in field.metadata["choices"]}
                value = names[value]
            given[field.name] = value
    return options(**given)
