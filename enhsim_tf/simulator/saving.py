"""Saves and loads trained models: `arrays.npz`, `settings.json`, and `manifest.json` with the format and the checksums of both.

Everything with more than a few numbers is an array. No code is saved.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import replace_folder, sha256, write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import READ_ERRORS, load_npz, read_json

MANIFEST, SETTINGS, _ARRAYS = "manifest.json", "settings.json", "arrays.npz"
MOST_SETTINGS = 50_000_000  # maximum bytes of a JSON file; a usual one has about 10,000
_MOST_BYTES = 2**28  # maximum size of all arrays; the weights of the paper's network are 55 MB
_NUMBER = "3"  # of the format
_FAMILY = "enhsim_tf.EnhancedSimulator/"  # every manifest begins with it, whatever its format


def write_saved(folder: str | os.PathLike, arrays: Mapping[str, Mapping[str, np.ndarray]], settings: Mapping[str, Any]) -> None:
    """Writes a model to a folder atomically: if a step fails, the folder is left unchanged.

    Args:
        folder: The folder. A model that was saved there before is replaced.
        arrays: For each part of the model, such as `enhancer`, its arrays by name.
        settings: All other settings, in plain JSON types.

    Raises:
        InputError: If the folder contains something other than a saved model, or if a number is not finite; it is left unchanged.
    """
    folder = Path(folder)
    if is_foreign(folder):
        raise InputError(f"Expected a new folder, an empty one, or a saved simulator. Received: {folder}, which contains something else.")
    bad = [part for part, named in arrays.items() if not all(np.isfinite(each).all() for each in named.values())]
    with replace_folder(folder) as temporary:
        try:
            write_json(temporary / SETTINGS, settings)
        except ValueError:  # JSON has no NaN and no infinity
            bad.append("settings")
        if bad:
            raise InputError(
                f"Expected a simulator whose numbers are finite. Received: {', '.join(bad)} with NaN or infinity. It was not saved. Fit it again."
            )
        np.savez(temporary / _ARRAYS, **{f"{part}/{name}": each for part, named in arrays.items() for name, each in named.items()})
        write_json(
            temporary / MANIFEST, {"format": _FAMILY + _NUMBER, "sha256": {name: sha256(temporary / name) for name in (_ARRAYS, SETTINGS)}}
        )


def is_foreign(folder: Path) -> bool:
    """Whether a path exists and is neither an empty folder nor a saved simulator. A damaged simulator counts as a saved one."""
    manifest = folder / MANIFEST
    is_ours = manifest.is_file() and f'"{_FAMILY}'.encode() in _beginning_of(manifest)  # other programs write files of this name too
    is_empty = folder.is_dir() and not any(folder.iterdir())
    return os.path.lexists(folder) and not (is_ours or is_empty)


def _beginning_of(path: Path) -> bytes:
    with open(path, "rb") as file:
        return file.read(1_000)


def check_saved(folder: str | os.PathLike) -> None:
    """Verifies the checksums of a saved model without loading it.

    Args:
        folder: The folder.

    Raises:
        InputError: If the folder was not written by `write_saved`, or if a file in it has changed since.
    """
    folder = Path(folder)
    manifest = _json_of(folder, MANIFEST)
    found, checksums = str(manifest.get("format")), manifest.get("sha256")
    if found != _FAMILY + _NUMBER:
        number = found.removeprefix(_FAMILY)
        raise InputError(f"Expected a model of format {_NUMBER}. Received: format {number[:80]} in {folder}. Fit it again.")
    if not isinstance(checksums, dict) or set(checksums) != {_ARRAYS, SETTINGS}:
        raise InputError(f"Expected the checksums of {_ARRAYS} and {SETTINGS}. Received: others in {folder / MANIFEST}. Fit it again.")
    for name, expected in checksums.items():
        if not (folder / name).is_file() or sha256(folder / name) != expected:
            raise InputError(
                f"Expected {name} to be unchanged since it was saved. Received: a missing or damaged file in {folder}. Fit it again."
            )


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
    folder: str | os.PathLike,
    make: Callable[[Mapping[str, Mapping[str, np.ndarray]], Mapping[str, Any]], Any],
) -> Any:
    """Loads a saved model.

    Args:
        folder: A folder written by `write_saved`.
        make: Function that creates the model from the arrays of each part and the settings.

    Returns:
        The model, as returned by `make`.

    Raises:
        InputError: If the folder was not written by `write_saved`, or if a file in it has changed since.
    """
    folder = Path(folder)
    check_saved(folder)
    settings, as_checked = settings_of(folder), sha256(folder / MANIFEST)
    try:
        arrays: dict[str, dict[str, np.ndarray]] = {}
        for name, each in load_npz(folder / _ARRAYS, _MOST_BYTES).items():
            part, _, rest = name.partition("/")
            arrays.setdefault(part, {})[rest] = each
        if sha256(folder / MANIFEST) != as_checked:  # another process replaced the model, so the settings may be those of the other
            raise ValueError("the simulator was replaced while it was read; try again")
        return make(arrays, settings)
    except READ_ERRORS as error:
        reason = (str(error).splitlines() or [""])[0]
        raise InputError(f"Expected the arrays and settings of a model. Received: {folder} ({reason}).") from None
