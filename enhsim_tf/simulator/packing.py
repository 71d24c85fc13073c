"""What is saved of a simulator: each part is its kind and its arguments, in JSON, and each array has a name in `arrays.npz`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import ConstantLevel, SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.alignment import Runs, Waves
from enhsim_tf.telemetry.quantisation import Levels

_ARGUMENTS = {
    Waves: ("simulators", "channels", "interval_s", "window", "waveforms"),
    SquareWaveSimulator: ("waves",),
    SquareWave: ("period_s", "phase", "duty", "low", "high"),
    ConstantLevel: ("level", "spread", "period_s"),
    Runs: ("nominal", "window", "delay_s", "name", "commands"),
    CommandTraces: ("chosen",),
    Recording: ("parts", "columns", "interval_s", "start", "name"),
    Run: ("values", "offset_s"),
    Enhancer: (
        "name",
        "window",
        "columns",
        "channels",
        "centre",
        "bias",
        "factors",
        "layers",
        "main",
    ),
    WindowBootstrap: ("windows", "signals"),
    Levels: ("step", "origin", "count"),
}
"""The kinds that are saved, and made again on loading, with the arguments that are saved; each has an attribute of the same name."""

_KINDS = {kind.__name__: kind for kind in _ARGUMENTS}


def packed(value: Any, arrays: dict[str, np.ndarray], name: str) -> Any:
    """Returns a part of a simulator in plain JSON types, and adds the arrays in it to `arrays`; their names begin with `name`.

    Raises InputError for an object that is not saved, such as a noise model of the user's own.
    """
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {"array": name}
    if isinstance(value, tuple | list):
        return [packed(each, arrays, f"{name}/{number}") for number, each in enumerate(value)]
    if type(value) in _ARGUMENTS:
        arguments = {
            each: packed(getattr(value, each), arrays, f"{name}/{each}")
            for each in _ARGUMENTS[type(value)]
        }
        return {"kind": type(value).__name__} | arguments
    if value is None or isinstance(value, str | int | float):
        return value
    raise InputError(
        f"Expected a simulator of parts that can be saved. Received: {type(value).__name__} as {name}, which is not saved. "
        "Fit the simulator again, or give a part of another kind."
    )


def unpacked(state: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Makes a part again from what `packed` returned and the arrays that it named. No other kinds are made."""
    if isinstance(state, list):
        return tuple(unpacked(each, arrays) for each in state)
    if isinstance(state, dict) and "kind" in state:
        return _KINDS[state["kind"]](
            **{name: unpacked(each, arrays) for name, each in state.items() if name != "kind"}
        )
    return arrays[state["array"]] if isinstance(state, dict) else state
