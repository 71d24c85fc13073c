"""Settings in a YAML file: read with limits on size and depth, without aliases, tags or repeated keys, and checked by pydantic.

The size and depth of the file are limited, and aliases, tags and repeated keys are not allowed. Each error message is one line
and names the position in the file, such as `scenarios[2].severity`. List entries are counted from 1.
"""

import collections
import os
from pathlib import Path
from typing import Any, TypeVar

import pydantic
import yaml
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from enhsim_tf.common.errors import InputError

_MAX_BYTES = 1_000_000
_MAX_EVENTS = 20_000  # of the parser; a thousand scenarios with everything written out need 15,000
_MAX_DEPTH = 10


def refusal(expected: str, **about: Any) -> PydanticCustomError:
    """What a validator raises.

    Args:
        expected: What was expected, in the words of an `InputError`.
        **about: `at`, the place below the one that is validated; `received`, where that is not what stands there.
    """
    if "received" in about:
        about["received"] = _shown(about["received"])  # pydantic stumbles over text that no file can hold, such as half a character
    return PydanticCustomError("expected", expected, about)


class Expected:
    """Annotates a field's type with the words for what is expected there, whatever it is that pydantic finds wrong.

    Args:
        what: The words.
    """

    def __init__(self, what: str):
        self.what = what

    def __get_pydantic_core_schema__(self, source: Any, handler: pydantic.GetCoreSchemaHandler) -> CoreSchema:
        """The type's schema, with an error of its own."""
        return core_schema.custom_error_schema(handler(source), "expected", custom_error_message=self.what)


class Form(pydantic.BaseModel):
    """Keys and values; nothing is converted, no other key is let pass, and an empty value is as good as none."""

    model_config = pydantic.ConfigDict(strict=True, extra="forbid")

    @pydantic.model_validator(mode="before")
    @classmethod
    def _keys(cls, content: Any) -> dict[str, Any]:
        if not isinstance(content, dict):
            raise refusal("keys and values, such as windows: 1000")
        for key in content:
            if key not in cls.model_fields:
                raise refusal(f"one of the keys {', '.join(cls.model_fields)}", received=key)
        return {name: content.get(name) for name, field in cls.model_fields.items() if field.is_required() or content.get(name) is not None}


_FormT = TypeVar("_FormT", bound=Form)


def load_settings(path: str | os.PathLike, form: type[_FormT]) -> _FormT:
    """Reads a YAML file of keys and values.

    Args:
        path: The file.
        form: What its keys and values are.

    Raises:
        InputError: If it cannot be read, is no plain YAML, is larger or deeper than settings are, or is not of the form.
    """
    path = Path(path)
    content = _load(path)
    try:
        return form.model_validate(content)
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
    about = first.get("ctx", {})
    place, received = _at(content, (*first["loc"], *about.get("at", ())))
    expected = first["msg"]
    if first["type"] == "list_type":
        expected = "a list, each entry after a dash"
    if first["type"] == "too_long":
        expected, received = f"at most {about['max_length']:,} entries", len(received)
    raise InputError(f"Expected {expected} at {place} in {path.name!r}. Received: {about.get('received') or _shown(received)}.")


def _at(content: Any, place: tuple[str | int, ...]) -> tuple[str, Any]:
    """The name of a place, and what stands there; a number may stand where there could be a list of them."""
    names = ""
    for part in place:
        if isinstance(content, list):
            names, content = f"{names}[{part + 1}]", content[part]
        elif isinstance(content, dict) and isinstance(part, str):
            names, content = f"{names}.{part}", content.get(part)
    return names.removeprefix(".") or "the top", content


def _shown(received: Any) -> str:
    if received is None:
        return "nothing"
    try:
        text = repr(received)
    except ValueError:  # Python does not format integers of more than 4,300 digits
        return "a number with thousands of digits"
    return text if len(text) <= 80 else f"{text[:80]}..."


class _Loader(yaml.SafeLoader):
    """The safe loader, without repeated keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        twice = [key for key, count in collections.Counter(keys).items() if count > 1]
        if twice:
            raise yaml.constructor.ConstructorError(problem=f"the key {twice[0][:40]!r} stands there twice", problem_mark=node.start_mark)
        return super().construct_mapping(node, deep)


def _load(path: Path) -> Any:
    """What a YAML file holds."""
    try:
        with open(path, "rb") as file:
            raw = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # a path with a zero byte raises ValueError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"Expected a settings file that can be read. Received: {str(path)!r} ({reason}).") from None
    if len(raw) > _MAX_BYTES:
        raise InputError(f"Expected a settings file of at most {_MAX_BYTES:,} bytes. Received: a longer one, {path.name!r}.")
    try:
        text = raw.decode("utf-8-sig")
        depth = 0
        for number, event in enumerate(yaml.parse(text, _Loader)):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            bad = isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) or getattr(event, "tag", None)
            if bad or depth > _MAX_DEPTH or number > _MAX_EVENTS:
                problem = "an alias, anchor or tag" if bad else "too many or too deeply nested entries"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        return yaml.load(text, _Loader)
    except yaml.MarkedYAMLError as error:
        where = "" if error.problem_mark is None else f" in line {error.problem_mark.line + 1}"
        reason = f"{' '.join(str(error.problem or error.context).split())[:120]}{where}"
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # an invalid date or number, or bytes that are not UTF-8
        reason = " ".join(str(error).split())[:120]
    raise InputError(f"Expected settings in plain YAML, as in docs/large_data_sets.md. Received: {path.name!r}, {reason}.")
