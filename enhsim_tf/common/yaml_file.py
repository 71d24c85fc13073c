"""Settings in a YAML file: read with limits on size and depth, without aliases, tags or repeated keys, and checked key by key.

Every mistake is one line that names its place in the file, such as `scenarios[2].severity`; entries count from 1.
"""

import collections
import os
from pathlib import Path
from typing import Any

from enhsim_tf.common.errors import InputError

_MOST_BYTES = 1_000_000
_MOST_EVENTS = 20_000  # of the parser; a thousand scenarios with everything written out need 15,000
_MOST_DEPTH = 10
_TOLERANCE = 1e-6  # of a sum of shares
_REQUIRED = object()


class Place:
    """A mapping of the file and where in it it stands.

    Args:
        content: The mapping; anything else is refused.
        file: Name of the file.
        place: Where in it the mapping stands.
    """

    def __init__(self, content: Any, file: str, place: str = ""):
        self.content, self.file, self.place = content, file, place
        if not isinstance(content, dict):
            raise self.refuse("keys and values, such as windows: 1000", content)

    def refuse(self, expected: str, received: Any, key: str = "") -> InputError:
        """The error for what stands at a key.

        Args:
            expected: What was expected there.
            received: What stands there instead.
            key: The key; none is the mapping itself.
        """
        where = ".".join(part for part in (self.place, key) if part)
        return InputError(f"Expected {expected}{f' at {where}' if where else ''} in {self.file!r}. Received: {_shown(received)}.")

    def allow(self, *keys: str) -> None:
        """Refuses any other key."""
        for key in self.content:
            if key not in keys:
                raise self.refuse(f"one of the keys {', '.join(keys)}{'' if self.place else ' at the top'}", key)

    def get(self, key: str, default: Any = None) -> Any:
        """What stands at a key; an empty one is as good as none."""
        found = self.content.get(key)
        return default if found is None else found

    def number(self, key: str, low: float, high: float, default: Any = _REQUIRED) -> float:
        """A number from `low` to `high`.

        Args:
            key: The key.
            low: The lowest number allowed.
            high: The highest.
            default: Taken where there is none; without it, a number has to be there.
        """
        return self._check(self.get(key, None if default is _REQUIRED else default), key, low, high)

    def range(self, key: str, high: float, default: Any = _REQUIRED) -> tuple[float, float]:
        """A number from 0 to `high`, or two, the lower first.

        Args:
            key: The key.
            high: The highest number allowed.
            default: Taken where there is none; without it, something has to be there.
        """
        found = self.get(key, None if default is _REQUIRED else default)
        if not isinstance(found, list | tuple):
            return (self._check(found, key, 0, high, " or [low, high]"),) * 2
        if len(found) != 2:
            raise self.refuse("a number or [low, high]", found, key)
        lowest, highest = (self._check(each, f"{key}[{number}]", 0, high) for number, each in enumerate(found))
        if lowest > highest:
            raise self.refuse("[low, high], the lower first", found, key)
        return lowest, highest

    def whole(self, key: str, low: int, high: int) -> int | None:
        """A whole number from `low` to `high`, or None where there is none.

        Args:
            key: The key.
            low: The lowest number allowed.
            high: The highest.
        """
        found = self.get(key)
        if found is not None and (type(found) is not int or not low <= found <= high):
            raise self.refuse(f"a whole number from {low:,} to {high:,}", found, key)
        return found

    def text(self, key: str, default: str | None = None) -> str:
        """A text of 1 to 200 printable characters."""
        found = self.get(key, default)
        if not isinstance(found, str) or not 1 <= len(found) <= 200 or not found.isprintable():
            raise self.refuse("a text of 1 to 200 printable characters", found, key)
        return found

    def children(self, key: str, most: int) -> list["Place"]:
        """The mappings of a list; none where there is none."""
        found = self.get(key, [])
        if not isinstance(found, list):
            raise self.refuse("a list, each entry after a dash", found, key)
        if len(found) > most:
            raise self.refuse(f"at most {most:,} entries", len(found), key)
        return [Place(each, self.file, f"{key}[{number}]") for number, each in enumerate(found, 1)]

    def add_up(self, what: str, total: float) -> None:
        """Refuses shares that do not add up to one."""
        if abs(total - 1) > _TOLERANCE:
            raise self.refuse(f"{what} to add up to 1", round(total, 9))

    def _check(self, found: Any, key: str, low: float, high: float, other: str = "") -> float:
        if type(found) not in (int, float) or not low <= found <= high:
            raise self.refuse(f"a number from {low} to {high}{other}", found, key)
        return float(found)


def _shown(received: Any) -> str:
    if received is None:
        return "nothing"
    try:
        text = repr(received)
    except ValueError:  # Python writes no number of more than some thousand digits
        return "a number that long"
    return text if len(text) <= 80 else f"{text[:80]}..."


def load_settings(path: str | os.PathLike) -> "Place":
    """Reads a YAML file of keys and values.

    Raises:
        InputError: If it cannot be read, is no plain YAML, or is larger or deeper than settings are.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """The safe loader, without repeated keys."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
            keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
            twice = [key for key, count in collections.Counter(keys).items() if count > 1]
            if twice:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key {twice[0][:40]!r} stands there twice", problem_mark=node.start_mark
                )
            return super().construct_mapping(node, deep)

    path = Path(path)
    try:
        with open(path, "rb") as file:
            raw = file.read(_MOST_BYTES + 1)
    except (OSError, ValueError) as error:  # a name with a zero byte is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"Expected a settings file that can be read. Received: {str(path)!r} ({reason}).") from None
    if len(raw) > _MOST_BYTES:
        raise InputError(f"Expected a settings file of at most {_MOST_BYTES:,} bytes. Received: a longer one, {path.name!r}.")
    try:
        text = raw.decode("utf-8-sig")
        depth = 0
        for number, event in enumerate(yaml.parse(text, Loader)):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            bad = isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) or getattr(event, "tag", None)
            if bad or depth > _MOST_DEPTH or number > _MOST_EVENTS:
                problem = "an alias, anchor or tag" if bad else "more or deeper than settings are"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        content = yaml.load(text, Loader)
    except yaml.MarkedYAMLError as error:
        where = "" if error.problem_mark is None else f" in line {error.problem_mark.line + 1}"
        reason = f"{' '.join(str(error.problem or error.context).split())[:120]}{where}"
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # a date or a number that is none, bytes that are no text
        reason = " ".join(str(error).split())[:120]
    else:
        return Place(content, path.name)
    raise InputError(f"Expected settings in plain YAML, as in docs/scenarios.md. Received: {path.name!r}, {reason}.")
