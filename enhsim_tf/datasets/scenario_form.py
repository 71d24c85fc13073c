"""The schema of a scenario file. It is a separate module, so that only reading such a file imports pydantic."""

import math
from collections.abc import Callable
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, WrapValidator, model_validator

from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.common.yaml_file import Expected, Form, refusal
from enhsim_tf.datasets.scenario_file import LATEST_ONSET, MOST_MODELS, MOST_SCENARIOS, MOST_WINDOWS

_TOLERANCE = 1e-6  # of a sum of shares


def _number(high: float, other: str = "") -> Any:
    return Annotated[float, Field(ge=0, le=high), Expected(f"a number from 0 to {high}{other}")]


def _range(high: float) -> Any:
    number = _number(high, " or [low, high]")
    return Annotated[tuple[number, number], WrapValidator(_pair)]


def _pair(found: Any, check: Callable[[tuple[Any, Any]], tuple[float, float]]) -> tuple[float, float]:
    pair = tuple(found) if isinstance(found, list) else (found, found)
    if len(pair) != 2 or (checked := check(pair))[0] > checked[1]:
        raise refusal("a number or [low, high], the lower first")
    return checked


def _whole(low: int, high: int) -> Any:
    return Annotated[int, Field(ge=low, le=high), Expected(f"a whole number from {low:,} to {high:,}")]


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError
    return text


def _inside(folder: str) -> str:
    parts = PurePosixPath(folder).parts
    if folder.startswith("/") or ".." in parts or "\\" in folder or not parts:
        raise refusal("a folder inside MODEL_DIR, such as vehicle-1/volts")
    return "/".join(parts)


_Text = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_printable), Expected("a text of 1 to 200 printable characters")]


class _Scenario(Form):
    mode: Annotated[Literal[tuple(MODES)], Expected(f"a mode, one of {', '.join(MODES)}")]
    share: _number(1)
    severity: _range(1.0)
    onset: _range(LATEST_ONSET) = (0.25, 0.25)


class _Model(Form):
    folder: Annotated[_Text, AfterValidator(_inside)]
    name: _Text | None = None
    share: _number(1) | None = None


class ScenarioFile(Form):
    """A whole scenario file; what it leaves out and its other entries tell is filled in."""

    windows: _whole(1, MOST_WINDOWS) | None = None
    seed: _whole(0, 2**31 - 1) | None = None
    shard: _whole(1, 10_000_000) | None = None
    nominal: _number(1) | None = None
    scenarios: list[_Scenario] = Field([], max_length=MOST_SCENARIOS)
    models: list[_Model] = Field([], max_length=MOST_MODELS)

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        shared = math.fsum(scenario.share for scenario in self.scenarios)
        if self.nominal is None:
            self.nominal = max(0.0, 1 - shared)
        names = []
        for number, model in enumerate(self.models):
            model.name, model.share = model.name or model.folder, 1 / len(self.models) if model.share is None else model.share
            if model.name in names:
                raise refusal("a name that no other model has", at=("models", number, "name"), received=model.name)
            names.append(model.name)
        sums = {"nominal and the shares of the scenarios": self.nominal + shared}
        if self.models:
            sums["the shares of the models"] = math.fsum(model.share for model in self.models)
        for what, total in sums.items():
            if abs(total - 1) > _TOLERANCE:
                raise refusal(f"{what} to add up to 1", received=round(total, 9))
        return self
