"""The coarse run of a model of commands: the traces of the commands that a file of telemetry holds."""

import os
from typing import TYPE_CHECKING

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.commands import NUM_COLUMNS, read_commands

if TYPE_CHECKING:
    from enhsim_tf.coarse_simulator.recording import Recording
    from enhsim_tf.enhanced_simulator.runs.model import RunModel


def is_of_commands(model: object) -> bool:
    """Whether a model was fitted to commands, which `score` and `generate` then read from the file of telemetry.

    Args:
        model: A simulator or a run model.
    """
    kept = getattr(model, "trained", {}).get("coarse", {})
    return isinstance(kept, dict) and kept.get("kind") == "commands"


def recording_of(model: "RunModel", source: str | os.PathLike) -> "Recording":
    """Returns the coarse run for a model of commands.

    Args:
        model: The model.
        source: The file of telemetry, in the layout of `telemetry.commands`.

    Raises:
        InputError: If the file has no commands.
    """
    commands = read_commands(source)
    if commands is None:
        raise InputError(
            f"Expected an array of {NUM_COLUMNS[0]} or {NUM_COLUMNS[1]} columns, of which all after the first are commands, as in the fit. "
            f"Received: {source}. Give such an array."
        )
    return CommandTraces.from_config(model.trained["coarse"]["config"]).recording(commands)
