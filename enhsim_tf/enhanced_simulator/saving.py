"""Saves and loads trained models: `.keras` files, arrays, `settings.json`, and `manifest.json` with their checksums.

There are two formats. A simulator of square waves consists of its enhancer and its noise. A run model (`runs`) also has the nominal
run and the range of the training runs. The noise is two networks, or arrays (`noise.states`).
"""

import os
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.atomic_files import replace_folder, sha256, write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import READ_ERRORS, load_npz, read_json
from enhsim_tf.enhanced_simulator.safe_loading import check_network

if TYPE_CHECKING:
    from enhsim_tf.keras_tools.backend import keras
    from enhsim_tf.noise.states import NoiseState

MANIFEST, SETTINGS = "manifest.json", "settings.json"
MOST_SETTINGS = 50_000_000  # maximum bytes of a JSON file; a usual one has about 10,000
_OURS = b'"enhsim_tf.EnhancedSimulator/'  # near the beginning of every manifest, in all versions of the format
_FORMAT = "enhsim_tf.EnhancedSimulator/1"
RUNS_FORMAT = "enhsim_tf.EnhancedSimulator/runs-1"
_NETWORKS = ("enhancer.keras", "generator.keras", "discriminator.keras")
_NOISE = "noise.npz"
_RUN_FILES = ("range.npz", "nominal.npz")
_FILES = {  # the possible files of each format, beside the settings
    _FORMAT: (set(_NETWORKS), {"enhancer.keras", _NOISE}),
    RUNS_FORMAT: ({*_NETWORKS, *_RUN_FILES}, {"enhancer.keras", _NOISE, *_RUN_FILES}),
}
_MOST_BYTES = 2**28  # maximum size of arrays


def write_saved(
    folder: str | os.PathLike,
    networks: Mapping[str, "keras.Model"],
    settings: Mapping[str, Any],
    others: Mapping[str, Callable[[Path], None]] | None = None,
    form: str = _FORMAT,
) -> None:
    """Writes a model to a folder atomically: if a step fails, the folder is left unchanged.

    Args:
        folder: The folder. A model that was saved there before is replaced.
        networks: The networks by name: `enhancer`, `generator` and `discriminator`.
        settings: All other settings, in plain JSON types.
        others: Further files by name, each with the function that writes it.
        form: The format.

    Raises:
        InputError: If the folder contains something other than a saved simulator; it is left unchanged.
    """
    folder = Path(folder)
    if is_foreign(folder):
        raise InputError(f"Expected a new folder, an empty one, or a saved simulator. Received: {folder}, which contains something else.")
    with replace_folder(folder) as temporary:
        for name, network in networks.items():
            network.save(temporary / f"{name}.keras", include_optimizer=False)
        for name, write in (others or {}).items():
            write(temporary / name)
        write_json(temporary / SETTINGS, settings)
        checksums = {file.name: sha256(file) for file in sorted(temporary.iterdir())}
        write_json(temporary / MANIFEST, {"format": form, "sha256": checksums})


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Writes arrays to a compressed `.npz` file.

    Args:
        path: Path of the file.
        arrays: The arrays by name.
    """
    with open(path, "wb") as file:
        np.savez_compressed(file, **arrays)


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Reads the arrays that `write_arrays` wrote. Files that are too large are refused."""
    return load_npz(path, _MOST_BYTES)


def noise_file(noise: "NoiseState") -> dict[str, Callable[[Path], None]]:
    """Returns the file of a noise model that consists of arrays, for `write_saved`; empty if it consists of networks."""
    return {_NOISE: lambda path: write_arrays(path, noise.arrays)} if noise.arrays else {}


def read_noise(folder: Path, settings: Mapping[str, Any], networks: "Mapping[str, keras.Model]") -> Any:
    """Restores the noise model of a saved model.

    Args:
        folder: The folder.
        settings: Settings of the noise.
        networks: The networks that were loaded.
    """
    from enhsim_tf.noise.states import model_from

    path = folder / _NOISE
    return model_from(settings, networks, read_arrays(path) if path.is_file() else {})


def is_foreign(folder: Path) -> bool:
    """Whether a path exists and is neither an empty folder nor a saved simulator. A damaged simulator counts as a saved one."""
    manifest = folder / MANIFEST
    is_ours = manifest.is_file() and _OURS in _beginning_of(manifest)  # other programs write files of this name too
    is_empty = folder.is_dir() and not any(folder.iterdir())
    return os.path.lexists(folder) and not (is_ours or is_empty)


def _beginning_of(path: Path) -> bytes:
    with open(path, "rb") as file:
        return file.read(1_000)


def is_run_model(folder: str | os.PathLike) -> bool:
    """Whether a folder holds a run model, by the format in its manifest."""
    return _json_of(Path(folder), MANIFEST).get("format") == RUNS_FORMAT


def check_saved(folder: str | os.PathLike, form: str = _FORMAT) -> None:
    """Verifies the checksums of a saved model without loading its networks.

    Args:
        folder: The folder.
        form: The expected format.

    Raises:
        InputError: If the folder was not written by `write_saved`, or if a file in it has changed since.
    """
    folder = Path(folder)
    manifest = _json_of(folder, MANIFEST)
    if manifest.get("format") in _FILES and manifest["format"] != form:
        kinds = {
            _FORMAT: "a simulator of square waves, for --windows or --continuous",
            RUNS_FORMAT: "a model of recorded runs, for --coarse",
        }
        raise InputError(f"Expected {kinds[form]}. Received: {folder}, which is {kinds[manifest['format']]}. Give the other kind of model.")
    if manifest.get("format") != form or set(manifest) != {"format", "sha256"} or not _is_complete(manifest["sha256"], form):
        raise InputError(
            f"Expected the format {form}. Received: {str(manifest.get('format'))[:80]!r} in {folder}. Save the simulator with this version."
        )
    for name, expected in manifest["sha256"].items():
        if not (folder / name).is_file() or sha256(folder / name) != expected:
            raise InputError(
                f"Expected {name} to be unchanged since it was saved. Received: a missing or damaged file in {folder}. Save the simulator again."
            )


def _is_complete(checksums: Any, form: str) -> bool:
    return isinstance(checksums, dict) and any(set(checksums) == {SETTINGS, *files} for files in _FILES[form])


def settings_of(folder: str | os.PathLike) -> dict[str, Any]:
    """Reads the settings of a saved simulator.

    Args:
        folder: The folder.

    Raises:
        InputError: If the settings cannot be read.
    """
    return _json_of(Path(folder), SETTINGS)


def _json_of(folder: Path, name: str) -> dict[str, Any]:
    try:
        content = read_json(folder / name, MOST_SETTINGS)
        if not isinstance(content, dict):
            raise ValueError("not a JSON object")
    except (OSError, ValueError) as error:
        raise InputError(
            f"Expected a folder written by EnhancedSimulator.save. Received: {folder} ({type(error).__name__} in {name})."
        ) from None
    return content


def read_saved(
    folder: str | os.PathLike, make: Callable[[Mapping[str, "keras.Model"], Mapping[str, Any]], Any], form: str = _FORMAT
) -> Any:
    """Loads a saved model, in Keras' safe mode.

    Args:
        folder: A folder written by `write_saved`.
        make: Function that creates the model from the networks and the settings.
        form: The expected format.

    Returns:
        The simulator, as returned by `make`.

    Raises:
        InputError: If the folder was not written by `write_saved`, or if a file in it has changed since.
    """
    from enhsim_tf.keras_tools.backend import keras, tf  # imported here, because checking a folder does not need TensorFlow

    folder = Path(folder)
    check_saved(folder, form)
    settings, as_checked = settings_of(folder), sha256(folder / MANIFEST)
    try:
        saved = [folder / name for name in _NETWORKS if (folder / name).is_file()]
        for path in saved:
            check_network(path)
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # Keras only warns about layers without weights in the file
            networks = {path.stem: keras.saving.load_model(path, compile=False, safe_mode=True) for path in saved}
        if sha256(folder / MANIFEST) != as_checked:  # another process replaced the simulator, so the networks may be mixed
            raise ValueError("the simulator was replaced while it was read; try again")
        return make(networks, settings)
    except (*READ_ERRORS, UserWarning, tf.errors.OpError) as error:
        reason = (str(error).splitlines() or [""])[0]
        raise InputError(f"Expected networks and settings that load in safe mode. Received: {folder} ({reason}).") from None
