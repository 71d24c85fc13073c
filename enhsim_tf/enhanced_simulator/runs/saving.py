"""Saves and loads run models. Code of a user's simulator is not saved; everything else is."""

import dataclasses
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.constant_level import waves_or_level
from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.enhanced_simulator.runs.coverage import Coverage
from enhsim_tf.enhanced_simulator.saving import RUNS_FORMAT, read_saved, write_saved
from enhsim_tf.enhancer.ladder import Rung
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.enhancer.rung_networks import network_from, weights_of
from enhsim_tf.enhancer.scaling import Scaling
from enhsim_tf.noise.states import model_from, state_of
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap
from enhsim_tf.telemetry.quantisation import Levels


def save_run_model(
    folder: str | os.PathLike,
    rung: Rung,
    noise: Any,
    coverage: Coverage,
    nominal: Recording,
    delay_s: float,
    trained: Mapping[str, Any],
    quantisation: Levels | None,
) -> None:
    """Writes a run model to a folder atomically.

    Args:
        folder: The folder. A model that was saved there before is replaced.
        rung: The enhancer.
        noise: The noise model.
        coverage: The range of the training runs.
        nominal: The nominal run of the fit.
        delay_s: How much later the telemetry is than the coarse run, in seconds.
        trained: Record of the training, in plain JSON types.
        quantisation: Levels of the channel, or None.

    Raises:
        InputError: If the folder contains something other than a saved model, if a number is not finite, or if the noise is a GAN,
            which is not saved; the folder is left unchanged.
    """
    state = state_of(noise)
    arrays = {
        "enhancer": weights_of(rung.network),
        "noise": state.arrays,
        "range": coverage.out_of_range.arrays,
        "nominal": {f"part_{number}": part.values for number, part in enumerate(nominal.parts)},
    }
    settings = {
        "rung": rung.name,
        "scaling": rung.scaling.get_config(),
        "noise": dict(state.settings),
        "limit": coverage.limit,
        "window": coverage.window,
        "interval_s": nominal.interval_s,
        "delay_s": delay_s,
        "columns": list(nominal.columns),
        "nominal": {"start": nominal.start, "offsets_s": [part.offset_s for part in nominal.parts]},
        "quantisation": None if quantisation is None else dataclasses.asdict(quantisation),
        "trained": trained,
    }
    write_saved(folder, arrays, settings, RUNS_FORMAT)


def load_run_model(folder: str | os.PathLike) -> dict[str, Any]:
    """Reads what `save_run_model` wrote.

    Args:
        folder: The folder.

    Returns:
        The arguments of `RunModel` by name. Square waves are restored; any other simulator has to be given again.

    Raises:
        InputError: If the folder was not written by `save_run_model`, or if a file in it has changed since.
    """
    return read_saved(folder, _arguments_from, RUNS_FORMAT)


def _arguments_from(arrays: Mapping[str, Mapping[str, np.ndarray]], settings: Mapping[str, Any]) -> dict[str, Any]:
    scaling, window, trained = Scaling.from_config(settings["scaling"]), int(settings["window"]), settings["trained"]
    noise = model_from(settings["noise"], arrays["noise"])
    parts = tuple(Run(arrays["nominal"][f"part_{number}"], float(each)) for number, each in enumerate(settings["nominal"]["offsets_s"]))
    nominal = Recording(parts, tuple(settings["columns"]), float(settings["interval_s"]), settings["nominal"]["start"], "the nominal run")
    coverage = Coverage(OutOfRange.from_arrays(arrays["range"]), settings["limit"], scaling, window)
    kept = trained.get("coarse", {})
    rung = Rung(str(settings["rung"]), network_from(arrays["enhancer"]), scaling)
    columns = len(nominal.columns)
    if isinstance(noise, WindowBootstrap | MatchedWindowBootstrap) and noise.windows.shape[1] != window:
        raise ValueError("noise of another window length than the settings say")
    shapes = rung.network.input_shape[1:], rung.network.output_shape[1:], np.shape(scaling.input_scale)
    if shapes != ((window * columns,), (window,), (columns,)) or not (np.isfinite(coverage.limit) and coverage.limit > 0):
        raise ValueError("an enhancer of another shape than the settings say")
    if not all(np.isfinite(part.values).all() for part in parts) or not nominal.interval_s > 0:
        raise ValueError("a nominal run that no simulator records")
    return {
        "rung": rung,
        "noise": noise,
        "coverage": coverage,
        "nominal": nominal,
        "window": window,
        "delay_s": settings["delay_s"],
        "coarse": waves_or_level(kept["config"]) if kept.get("kind") == "square waves" else None,
        "trained": trained,
        "quantisation": None if settings["quantisation"] is None else Levels(**settings["quantisation"]),
    }
