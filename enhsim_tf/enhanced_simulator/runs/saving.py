"""Saves and loads run models. Code of a user's simulator is not saved; everything else is."""

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.enhanced_simulator.checks import check_saved_numbers, is_finite
from enhsim_tf.enhanced_simulator.runs.coverage import Coverage
from enhsim_tf.enhanced_simulator.saving import RUNS_FORMAT, noise_file, read_arrays, read_noise, read_saved, write_arrays, write_saved
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.enhancer.scaling import Scaling
from enhsim_tf.noise.states import state_of
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap
from enhsim_tf.telemetry.quantisation import Levels

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.runs.model import RunModel


def save_run_model(model: "RunModel", folder: str | os.PathLike) -> None:
    """Writes a run model to a folder atomically.

    Args:
        model: The model.
        folder: The folder. A model that was saved there before is replaced.

    Raises:
        InputError: If the folder contains something other than a saved model, or if a number of the model is not finite; the folder is left
            unchanged.
    """
    networks = {"enhancer": model.rung.network}
    others = {
        "range.npz": model.coverage.out_of_range.save,
        "nominal.npz": lambda path: write_arrays(path, {f"part_{number}": part.values for number, part in enumerate(model.nominal.parts)}),
    }
    noise = state_of(model.noise)
    networks |= noise.networks
    check_saved_numbers(
        {name: is_finite(network.get_weights()) for name, network in networks.items()} | {"noise": bool(noise.networks) or noise.is_finite}
    )
    others |= noise_file(noise)
    settings = {
        "rung": model.rung.name,
        "scaling": model.rung.scaling.get_config(),
        "noise": dict(noise.settings),
        "limit": model.coverage.limit,
        "window": model.window,
        "interval_s": model.interval_s,
        "delay_s": model.delay_s,
        "columns": list(model.columns),
        "nominal": {"start": model.nominal.start, "offsets_s": [part.offset_s for part in model.nominal.parts]},
        "quantisation": None if model.quantisation is None else dataclasses.asdict(model.quantisation),
        "trained": model.trained,
    }
    write_saved(folder, networks, settings, others, RUNS_FORMAT)


def load_run_model(folder: str | os.PathLike) -> "RunModel":
    """Loads a saved run model, in Keras' safe mode.

    Args:
        folder: A folder written by `save_run_model`.

    Returns:
        The model. Square waves are restored; any other simulator has to be given again.

    Raises:
        InputError: If the folder was not written by `save_run_model`, or if a file in it has changed since.
    """
    folder = Path(folder)
    return read_saved(folder, lambda networks, settings: _model_from(folder, networks, settings), RUNS_FORMAT)


def _model_from(folder: Path, networks: Mapping[str, Any], settings: Mapping[str, Any]) -> "RunModel":
    from enhsim_tf.enhanced_simulator.runs.model import RunModel
    from enhsim_tf.enhancer.ladder import Rung

    scaling, window = Scaling.from_config(settings["scaling"]), int(settings["window"])
    noise = read_noise(folder, settings["noise"], networks)
    arrays, offsets = read_arrays(folder / "nominal.npz"), settings["nominal"]["offsets_s"]
    parts = tuple(Run(arrays[f"part_{number}"], float(offset_s)) for number, offset_s in enumerate(offsets))
    nominal = Recording(parts, tuple(settings["columns"]), float(settings["interval_s"]), settings["nominal"]["start"], "the nominal run")
    coverage = Coverage(OutOfRange.load(folder / "range.npz"), settings["limit"], scaling, window)
    kept = settings["trained"].get("coarse", {})
    coarse = SquareWaveSimulator.from_config(kept["config"]) if kept.get("kind") == "square waves" else None
    rung = Rung(str(settings["rung"]), networks["enhancer"], scaling)
    columns = len(nominal.columns)
    if isinstance(noise, WindowBootstrap | MatchedWindowBootstrap) and noise.windows.shape[1] != window:
        raise ValueError("noise of another window length than the settings say")
    shapes = rung.network.input_shape[1:], rung.network.output_shape[1:], np.shape(scaling.input_scale)
    if shapes != ((window * columns,), (window,), (columns,)) or not (np.isfinite(coverage.limit) and coverage.limit > 0):
        raise ValueError("an enhancer of another shape than the settings say")
    if not all(np.isfinite(part.values).all() for part in parts) or not nominal.interval_s > 0:
        raise ValueError("a nominal run that no simulator records")
    quantisation = None if settings.get("quantisation") is None else Levels(**settings["quantisation"])
    return RunModel(rung, noise, coverage, nominal, window, settings["delay_s"], coarse, settings["trained"], quantisation)
