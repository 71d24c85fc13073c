"""What is saved of a simulator: each part is its kind and its arguments, in JSON, and each array
has a name in `arrays.npz`.
"""

import inspect
from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.coarse.runs import Runs
from enhsim_tf.coarse.square_waves import ConstantLevel, SquareWave, SquareWaveSimulator
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.noise.registry import NOISES, noise_model
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Clock, Part, Telemetry

_KINDS = (Waves, SquareWaveSimulator, SquareWave, ConstantLevel, Runs, Clock, Enhancer, Levels)
"""The kinds that are saved with all arguments, each of which is an attribute, too, and made again
on loading.
"""
_SOME = {Telemetry: ("parts", "columns", "clock", "name"), Part: ("values", "offset_s")}
"""Those that are saved with these arguments, beside noise models, which say theirs."""


def _kinds() -> dict[type, tuple[str, ...]]:
    whole = {kind: tuple(inspect.signature(kind).parameters) for kind in _KINDS}
    return whole | _SOME | {model: model.saved for model in map(noise_model, NOISES)}


def packed(value: Any, arrays: dict[str, np.ndarray], name: str) -> Any:
    """Returns a part of a simulator in plain JSON types, and adds the arrays in it to `arrays`;
    their names begin with `name`.

    Raises InputError for an object that is not saved, such as a noise model of the user's own.
    """
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {"array": name}
    if isinstance(value, tuple | list):
        return [packed(item, arrays, f"{name}/{number}") for number, item in enumerate(value)]
    if type(value) in _kinds():
        arguments = {
            argument: packed(getattr(value, argument), arrays, f"{name}/{argument}")
            for argument in _kinds()[type(value)]
        }
        return {"class": type(value).__name__} | arguments
    if value is None or isinstance(value, str | int | float):
        return value
    raise InputError(
        f"Expected a simulator of parts that can be saved. Received: {type(value).__name__} as "
        f"{name}, which is not saved. "
        "Fit the simulator again, or give a part of another kind."
    )


def unpacked(state: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Makes a part again from what `packed` returned and the arrays that it named. No other kinds
    are made.
    """
    if isinstance(state, list):
        return tuple(unpacked(item, arrays) for item in state)
    if isinstance(state, dict) and "class" in state:
        known = {kind.__name__: kind for kind in _kinds()}
        if state["class"] not in known:
            raise InputError(
                f"Expected the parts of a simulator. Received: {state['class']!r}, which is none. "
                "Fit it again."
            )
        arguments = {
            name: unpacked(part, arrays) for name, part in state.items() if name != "class"
        }
        return known[state["class"]](**arguments)
    return arrays[state["array"]] if isinstance(state, dict) else state
