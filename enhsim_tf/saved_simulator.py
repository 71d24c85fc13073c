"""A trained simulator at rest: a folder of three `.keras` files, `settings.json`, and `manifest.json` with their checksums.

It knows files and checksums, and that Keras opens them in safe mode; not what the networks are for.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import keras
import tensorflow as tf

from enhsim_tf.declared_sizes import DAMAGES, read_json
from enhsim_tf.errors import InputError
from enhsim_tf.files import replace_folder, sha256, write_json
from enhsim_tf.saved_network import check_network

_FORMAT = "enhsim_tf.EnhancedSimulator/1"
_NETWORKS = ("enhancer", "generator", "discriminator")
_MOST_BYTES = 50_000_000  # of a JSON file


def write_saved(folder: str | os.PathLike, networks: Mapping[str, keras.Model], settings: Mapping[str, Any]) -> None:
    """Writes the folder, whole or not at all.

    Args:
        folder: Where to; a saved simulator that stands there is replaced.
        networks: `enhancer`, `generator` and `discriminator`.
        settings: Everything else, in plain JSON types.

    Raises:
        InputError: If something else than a saved simulator stands there, which is left as it is.
    """
    folder = Path(folder)
    if folder.exists() and not _is_saved(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise InputError(f"Expected a new folder, an empty one, or a saved simulator. Received: {folder}, which holds something else.")
    with replace_folder(folder) as temporary:
        for name in _NETWORKS:
            networks[name].save(temporary / f"{name}.keras", include_optimizer=False)
        write_json(temporary / "settings.json", settings)
        checksums = {file.name: sha256(file) for file in sorted(temporary.iterdir())}
        write_json(temporary / "manifest.json", {"format": _FORMAT, "sha256": checksums})


def _is_saved(folder: Path) -> bool:
    """Whether a folder holds a saved simulator, by the format that its manifest names; damaged files do not matter."""
    try:
        return read_json(folder / "manifest.json", _MOST_BYTES)["format"] == _FORMAT
    except (OSError, ValueError, KeyError, TypeError):
        return False


def read_saved(folder: str | os.PathLike, make: Callable[[Mapping[str, keras.Model], Mapping[str, Any]], Any]) -> Any:
    """Reads what `write_saved` wrote, in Keras' safe mode.

    Args:
        folder: The folder.
        make: Makes the simulator from the networks and the settings.

    Returns:
        What `make` made.

    Raises:
        InputError: If the folder is not one that `write_saved` wrote, or if a file in it was changed.
    """
    folder = Path(folder)
    try:
        manifest = read_json(folder / "manifest.json", _MOST_BYTES)
        known, checksums = manifest["format"] == _FORMAT, manifest["sha256"]
        complete = set(checksums) == {"settings.json", *(f"{name}.keras" for name in _NETWORKS)} and len(manifest) == 2
        checksums = dict(checksums)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"Expected a folder written by EnhancedSimulator.save. Received: {folder} ({type(error).__name__}).") from None
    if not (known and complete):
        raise InputError(f"Expected the format {_FORMAT}. Received: {str(manifest['format'])[:80]!r} in {folder}.")
    for name, expected in checksums.items():
        if not (folder / name).is_file() or sha256(folder / name) != expected:
            raise InputError(f"Expected {name} as it was saved. Received: a missing or damaged file in {folder}. Save the simulator again.")
    try:
        settings = read_json(folder / "settings.json", _MOST_BYTES)
        for name in _NETWORKS:
            check_network(folder / f"{name}.keras")
        networks = {name: keras.saving.load_model(folder / f"{name}.keras", compile=False, safe_mode=True) for name in _NETWORKS}
        return make(networks, settings)
    except (*DAMAGES, tf.errors.OpError) as error:
        reason = (str(error).splitlines() or [""])[0]
        raise InputError(f"Expected networks and settings that load in safe mode. Received: {folder} ({reason}).") from None
