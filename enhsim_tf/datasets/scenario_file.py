"""Reads a scenario file: YAML with the shares of scenarios and models in a large data set, see docs/large_data_sets.md."""

import collections
import math
import os
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal, Self

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, WrapValidator, model_validator

from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.mix import LATEST_ONSET, MOST_MODELS, MOST_SCENARIOS, MOST_WINDOWS, Mix, ModelShare, ScenarioShare

_MAX_BYTES = 300_000  # a thousand scenarios with everything written out need 100,000
_MAX_EVENTS, _MAX_DEPTH = 20_000, 10  # of the parser; such a file has 15,000
_TOLERANCE = 1e-6  # of a sum of shares


def _number(high: float) -> Any:
    return Annotated[float, Field(ge=0, le=high)]


def _range(high: float) -> Any:
    return Annotated[tuple[_number(high), _number(high)], WrapValidator(_pair)]


def _pair(found: Any, check: Callable[[Any], tuple[float, float]]) -> tuple[float, float]:
    pair = check(tuple(found) if isinstance(found, list) else (found, found))
    if pair[0] > pair[1]:
        raise ValueError("a range has the lower number first")
    return pair


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("a text has printable characters only")
    return text


def _inside(folder: str) -> str:
    parts = PurePosixPath(folder).parts
    if folder.startswith("/") or ".." in parts or "\\" in folder or not parts:
        raise ValueError("a folder is inside MODEL_DIR, such as vehicle-1/volts")
    return "/".join(parts)


_Text = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_printable)]


class _Part(BaseModel):
    """Keys and values; nothing is converted, no other key is let pass, and an empty value is as good as none."""

    model_config = ConfigDict(strict=True, extra="forbid")

    @model_validator(mode="before")
    @classmethod
    def _without_empty_values(cls, content: Any) -> Any:
        return {key: value for key, value in content.items() if value is not None} if isinstance(content, dict) else content


class _Scenario(_Part):
    mode: Literal[tuple(MODES)]
    share: _number(1)
    severity: _range(1.0)
    onset: _range(LATEST_ONSET) = (0.25, 0.25)


class _Model(_Part):
    folder: Annotated[_Text, AfterValidator(_inside)]
    name: _Text | None = None
    share: _number(1) | None = None


class _File(_Part):
    windows: Annotated[int, Field(ge=1, le=MOST_WINDOWS)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**31)] | None = None
    shard: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    nominal: _number(1) | None = None
    scenarios: list[_Scenario] = Field([], max_length=MOST_SCENARIOS)
    models: list[_Model] = Field([], max_length=MOST_MODELS)

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        shared = math.fsum(scenario.share for scenario in self.scenarios)
        self.nominal = max(0.0, 1 - shared) if self.nominal is None else self.nominal
        for model in self.models:
            model.name, model.share = model.name or model.folder, 1 / len(self.models) if model.share is None else model.share
        if len({model.name for model in self.models}) < len(self.models):
            raise ValueError("no two models have the same name")
        totals = [self.nominal + shared, *([math.fsum(model.share for model in self.models)] if self.models else [])]
        if any(abs(total - 1) > _TOLERANCE for total in totals):
            raise ValueError(f"nominal and the shares of the scenarios, and the shares of the models, add up to 1, not to {totals}")
        return self


def read_mix(path: str | os.PathLike) -> Mix:
    """Reads and validates a scenario file.

    Args:
        path: Path of the file.

    Raises:
        InputError: If the file cannot be read or has invalid content. The message names the place, with list entries counted from 1.
    """
    path = Path(path)
    content = _load(path)
    try:
        file = _File.model_validate(content)
    except ValidationError as found:
        error = found.errors(include_url=False)[0]
        place = "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
        reason = error["msg"].removeprefix("Value error, ")
        raise InputError(
            f"Expected {place or 'keys and values'} as in docs/large_data_sets.md: {reason}. Received: {_shown(error['input'])} in {path.name!r}."
        ) from None
    scenarios = tuple(ScenarioShare(**dict(each)) for each in file.scenarios)
    models = tuple(ModelShare(**dict(each)) for each in file.models)
    return Mix(file.nominal, scenarios, models, file.windows, file.seed, file.shard)


def _shown(received: Any) -> str:
    try:
        return repr(received)[:80]
    except ValueError:  # Python does not format integers of more than 4,300 digits
        return "a number with thousands of digits"


class _Loader(yaml.SafeLoader):
    """The safe loader, without repeated keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        counts = collections.Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        twice = [key for key, count in counts.items() if count > 1]
        if twice:
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
        text, depth = raw.decode("utf-8-sig"), 0
        for number, event in enumerate(yaml.parse(text, _Loader)):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or number > _MAX_EVENTS or depth > _MAX_DEPTH:  # aliases multiply what is written
                problem = "an alias" if isinstance(event, yaml.AliasEvent) else "too many or too deeply nested entries"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        return yaml.load(text, _Loader)
    except yaml.MarkedYAMLError as error:
        where = "" if error.problem_mark is None else f" in line {error.problem_mark.line + 1}"
        reason = f"{' '.join(str(error.problem or error.context).split())[:120]}{where}"
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # an invalid date or number, or bytes that are not UTF-8
        reason = " ".join(str(error).split())[:120]
    raise InputError(f"Expected plain YAML, as in docs/large_data_sets.md. Received: {path.name!r}, {reason}.")
