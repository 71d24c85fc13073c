"""The mix of a large data set, from the options or from a scenario file (docs/large_data_sets.md): scenarios and their shares."""

import collections
import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import yaml
from pydantic import ConfigDict, Field, Strict, TypeAdapter, ValidationError, WrapValidator, model_validator
from pydantic.dataclasses import dataclass

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.errors import InputError

MOST_WINDOWS = 10**10
_LATEST_ONSET = 0.999
_MAX_BYTES = 300_000  # a thousand scenarios with everything written out need 100,000
_TOLERANCE = 1e-6  # of a sum of shares


def _number(high: float) -> Any:
    return Annotated[float, Strict(), Field(ge=0, le=high)]


def _whole(least: int, most: int) -> Any:
    return Annotated[int, Strict(), Field(ge=least, le=most)]


def _range(high: float) -> Any:
    return Annotated[tuple[_number(high), _number(high)], WrapValidator(_pair)]


def _pair(found: Any, check: Callable[[Any], tuple[float, float]]) -> tuple[float, float]:
    low, high = check(tuple(found) if isinstance(found, list | tuple) else (found, found))
    if low > high:
        raise ValueError("a range has the lower number first")
    return low, high


_Text = Annotated[str, Strict(), Field(min_length=1, max_length=200)]
_KEYS = ConfigDict(extra="forbid")


@dataclass(config=_KEYS)
class ScenarioShare:
    """A degraded mode and its share of all windows. Severity and onset of each window are drawn between two limits."""

    mode: Literal[tuple(MODES)]
    share: _number(1)
    severity: _range(1)
    onset: _range(_LATEST_ONSET) = (0.25, 0.25)  # as a share of the window
    channel: _Text | None = None  # the only one that is degraded


@dataclass(config=_KEYS)
class Mix:
    """The composition of a data set. All shares of windows add up to one."""

    nominal: _number(1) | None = None  # share of nominal windows: what the scenarios leave, if none is given
    scenarios: Annotated[tuple[ScenarioShare, ...], Field(max_length=1_000)] = ()
    windows: _whole(1, MOST_WINDOWS) | None = None
    seed: _whole(0, 2**31 - 1) | None = None
    shard: _whole(1, 10_000_000) | None = None  # windows per file

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        shared = math.fsum(scenario.share for scenario in self.scenarios)
        self.nominal = max(0.0, 1 - shared) if self.nominal is None else self.nominal
        if abs(self.nominal + shared - 1) > _TOLERANCE:
            raise ValueError(f"nominal and the shares of the scenarios add up to 1, not to {self.nominal + shared:g}")
        return self


def make_mix(scenarios: Sequence[Degraded], nominal_share: float) -> Mix:
    """Makes the mix of the options `--scenario` and `--nominal-share`. All scenarios get equal shares; without any, all is nominal."""
    if not scenarios:
        return Mix()
    share = (1 - nominal_share) / len(scenarios)
    parts = [dataclasses.asdict(each) | {"share": share} for each in scenarios]
    return _mix_of({"nominal": nominal_share, "scenarios": parts}, "the options")


def read_mix(path: str | os.PathLike) -> Mix:
    """Reads and validates a scenario file.

    Raises:
        InputError: If the file cannot be read or has invalid content. The message names the place, with list entries counted from 1.
    """
    path = Path(path)
    return _mix_of(_load(path), repr(path.name))


def _mix_of(content: Any, source: str) -> Mix:
    try:
        return TypeAdapter(Mix).validate_python(content)
    except ValidationError as found:
        error = found.errors(include_url=False)[0]
        place = "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
        reason = "no such key" if error["type"] == "unexpected_keyword_argument" else error["msg"].removeprefix("Value error, ")
        raise InputError(
            f"Expected {place or 'keys and values'} as in docs/large_data_sets.md: {reason}. Received: {_shown(error['input'])} in {source}."
        ) from None


def _shown(received: Any) -> str:
    try:
        return repr(received)[:80]
    except ValueError:  # Python does not format integers of more than 4,300 digits
        return "a number with thousands of digits"


class _Loader(yaml.SafeLoader):
    """The safe loader without aliases, which multiply what is written, and without repeated keys, of which one would be lost."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node:
        if self.check_event(yaml.AliasEvent):
            raise yaml.MarkedYAMLError(problem="an alias", problem_mark=self.peek_event().start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        counts = collections.Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        if twice := [key for key, count in counts.items() if count > 1]:
            raise yaml.MarkedYAMLError(problem=f"the key {twice[0][:40]!r} stands there twice", problem_mark=node.start_mark)
        return super().construct_mapping(node, deep)


def _load(path: Path) -> Any:
    """What a YAML file holds."""
    try:
        with open(path, "rb") as file:
            raw = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # a path with a zero byte raises ValueError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"Expected a scenario file that can be read. Received: {str(path)!r} ({reason}).") from None
    if len(raw) > _MAX_BYTES:
        raise InputError(f"Expected a scenario file of at most {_MAX_BYTES:,} bytes. Received: a longer one, {path.name!r}.")
    try:
        return yaml.load(raw.decode("utf-8-sig"), _Loader)
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:  # also a date or a number that is none, and deep nesting
        reason = " ".join(str(error).split())[:200]
    raise InputError(f"Expected plain YAML, as in docs/large_data_sets.md. Received: {path.name!r}, {reason}.")
