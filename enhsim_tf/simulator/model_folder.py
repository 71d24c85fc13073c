"""Folders of fitted simulators: how they are named and found, and how a simulator is written to one
and read again.

A simulator is `arrays.npz`, `settings.json`, and `manifest.json` with the format and the checksums
of both. Everything with more than a few numbers is an array. No code is saved; see `packing`.
"""

import hashlib
import io
import json
import os
import re
import urllib.parse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import replace_folder, sha256, write_json
from enhsim_tf.common.errors import InputError

MANIFEST = "manifest.json"
_SETTINGS = "settings.json"
_ARRAYS = "arrays.npz"
_MOST_NAME = 60  # bytes of the name of a folder
# of an encoded name; the names of temporary folders and locks add 50, and most file systems allow
# 255
_MAX_CHARACTERS = 160
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)  # names of Windows
_NUMBER = "10"  # of the format
_FAMILY = "enhsim_tf.EnhancedSimulator/"  # every manifest begins with it, whatever its format


def folder_of(models: str | os.PathLike, name: str) -> Path:
    """Returns the folder of a channel or model: its name, percent-encoded, which
    `urllib.parse.unquote` restores.

    It is within the folder of the models, is not hidden, and has no name that Windows reserves.

    Raises:
        InputError: If the name is empty, too long for a file, or not valid Unicode.
    """
    try:
        folder = urllib.parse.quote(name, safe=" ").replace(".", "%2E")
    except UnicodeEncodeError:
        raise InputError(
            f"Expected a channel name of Unicode characters. Received: {name[:60]!r}. Rename it."
        ) from None
    folder = re.sub("^ +| +$", lambda spaces: "%20" * len(spaces[0]), folder)  # Windows strips them
    if _RESERVED.fullmatch(folder):
        folder = f"%{ord(folder[0]):02X}{folder[1:]}"
    if not 1 <= len(folder) <= _MAX_CHARACTERS:
        raise InputError(
            f"Expected a channel name of 1 to {_MAX_CHARACTERS} letters (signs and letters beyond "
            "ASCII count for three or more). "
            f"Received: {name[:60]!r} with {len(folder)}. Rename it, or name the other channels."
        )
    return Path(models) / folder


def name_of_channels(channels: Sequence[str]) -> str:
    """Returns the name of a model: that of its channel, or those of its channels joined by `~`,
    shortened if there are many.
    """
    joined = "~".join(channels)
    return (
        joined
        if len(channels) == 1 or len(joined.encode()) <= _MOST_NAME
        else f"{channels[0]}~{len(channels) - 1} more"
    )


def models_of(models: str | os.PathLike) -> dict[str, Path]:
    """Returns the folders of the fitted simulators in a folder, or of the one that it is, by name;
    raises InputError if there is none.
    """
    models = Path(os.path.abspath(models))  # so that "." has a name too
    # unlike Path.is_file, this does not raise for names that are not valid file names
    if os.path.isfile(models / MANIFEST):
        return {urllib.parse.unquote(models.name): models}
    manifests = sorted(models.glob(f"[!.]*/{MANIFEST}")) if os.path.isdir(models) else []
    if not manifests:
        raise InputError(
            f"Expected a folder of fitted simulators. Received: {models}, which contains none. "
            "Make one with `fit`."
        )
    return {urllib.parse.unquote(manifest.parent.name): manifest.parent for manifest in manifests}


def chosen_of(models: Mapping[str, Path], channels: Sequence[str] | None) -> dict[str, Path]:
    """Selects models of `models_of` by name; None or an empty sequence selects all. Raises
    InputError for a name that there is not.
    """
    unknown = [name for name in channels or () if name not in models]
    if unknown:
        raise InputError(
            f"Expected --channel, one of: {', '.join(list(models)[:8])}. Received: {unknown[0]!r}."
        )
    return {name: models[name] for name in channels or models}


def refuse_foreign(folder: str | os.PathLike) -> None:
    """Raises InputError unless a folder is new, empty or a saved simulator, so that it may be
    replaced. A damaged simulator counts as one.
    """
    folder = Path(folder)
    is_ours = False
    if (folder / MANIFEST).is_file():  # other programs write files of this name too
        with open(folder / MANIFEST, "rb") as file:
            is_ours = f'"{_FAMILY}'.encode() in file.read(1_000)
    if (
        os.path.lexists(folder)
        and not is_ours
        and not (folder.is_dir() and not any(folder.iterdir()))
    ):
        raise InputError(
            f"Expected a new folder, an empty one, or a saved simulator. Received: {folder}, which "
            "contains something else. "
            "Give another folder, or another --out."
        )


def write_saved(
    folder: str | os.PathLike, arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]
) -> None:
    """Writes a simulator to a folder atomically, in place of one that was there: its arrays by
    name, and settings in plain JSON types.

    Raises InputError if the folder contains something else.
    """
    refuse_foreign(folder)
    with replace_folder(folder) as temporary:
        np.savez(temporary / _ARRAYS, **arrays)
        write_json(temporary / _SETTINGS, settings)
        checksums = {name: sha256(temporary / name) for name in (_ARRAYS, _SETTINGS)}
        write_json(temporary / MANIFEST, {"format": _FAMILY + _NUMBER, "sha256": checksums})


def read_saved(folder: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Returns the arrays and the settings of a saved simulator.

    Raises InputError if the folder was not written by `write_saved`, or if a file in it has changed
    since.
    """
    folder = Path(folder)
    form, checksums = _values_of(folder / MANIFEST, "format", "sha256")
    if form != _FAMILY + _NUMBER:
        number = str(form).removeprefix(_FAMILY)[:80]
        raise InputError(
            f"Expected a model of format {_NUMBER}. Received: format {number} in {folder}. Fit it "
            "again."
        )
    files = {
        name: (folder / name).read_bytes()
        for name in (_ARRAYS, _SETTINGS)
        if (folder / name).is_file()
    }
    if checksums != {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}:
        raise InputError(
            f"Expected {_ARRAYS} and {_SETTINGS} to be unchanged since they were saved. Received: "
            f"a missing or damaged file in {folder}. "
            "Fit it again."
        )
    # unpickling could run code
    with np.load(io.BytesIO(files[_ARRAYS]), allow_pickle=False) as arrays:
        return dict(arrays), json.loads(files[_SETTINGS])


def channels_of(folder: str | os.PathLike) -> tuple[str, ...]:
    """Returns the names of the channels of a saved simulator without loading it; raises InputError
    if they cannot be read, or have changed since they were saved.
    """
    folder = Path(folder)
    (channels,) = _values_of(folder / _SETTINGS, "channels")
    (checksums,) = _values_of(folder / MANIFEST, "sha256")
    if not isinstance(checksums, dict) or checksums.get(_SETTINGS) != sha256(folder / _SETTINGS):
        raise InputError(
            f"Expected {_SETTINGS} to be unchanged since it was saved. Received: a damaged file in "
            f"{folder}. Fit it again."
        )
    return tuple(channels)


def _values_of(path: Path, *names: str) -> list[Any]:
    """Returns values of a JSON file of a saved simulator by their names; raises InputError if it
    has not all of them.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return [content[name] for name in names]
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise InputError(
            f"Expected a folder written by EnhancedSimulator.save. Received: {path.parent} "
            f"({type(error).__name__} in {path.name}). Fit it again."
        ) from None
