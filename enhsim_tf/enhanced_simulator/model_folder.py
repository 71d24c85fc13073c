"""Folders of fitted models: one for each channel, found and named."""

import os
import urllib.parse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.common.atomic_files import encoded
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.enhanced_simulator.saving import MANIFEST, is_foreign

if TYPE_CHECKING:
    pass


def folder_of(models: str | os.PathLike, channel: str) -> Path:
    """The folder of a channel: its name, encoded.

    Raises:
        InputError: If no file can have the name.
    """
    return Path(models) / encoded(channel)


def models_of(models: str | os.PathLike) -> dict[str, Path]:
    """The fitted channels of a folder, by name; a saved simulator itself is one.

    Raises:
        InputError: If there is none.
    """
    models = Path(os.path.abspath(models))  # so that "." has a name too
    if os.path.isfile(models / MANIFEST):  # asked in this way, a name that no file can have is no error
        return {urllib.parse.unquote(models.name): models}
    folders = sorted(models.glob(f"[!.]*/{MANIFEST}")) if os.path.isdir(models) else []
    if not folders:
        raise InputError(
            f"Expected a folder of fitted simulators. Received: {printable(str(models))[:200]}, which holds none. Make one with `fit`."
        )
    found: dict[str, Path] = {}
    for folder in (manifest.parent for manifest in folders):
        name = urllib.parse.unquote(folder.name)
        if name in found:
            raise InputError(f"Expected a folder a channel. Received: {found[name].name} and {folder.name}, both of {name!r}. Remove one.")
        found[name] = folder
    return found


def chosen_of(models: Mapping[str, Path], channels: Sequence[str] | None) -> dict[str, Path]:
    """The fitted channels that were named, or all.

    Args:
        models: Those of `models_of`.
        channels: Names, or None.

    Raises:
        InputError: If one of them is not there.
    """
    unknown = [name for name in channels or () if name not in models]
    if unknown:
        raise InputError(f"Expected --channel, one of: {printable(', '.join(list(models)[:8]))}. Received: {unknown[0]!r}.")
    return {name: models[name] for name in channels or models}


def refuse_foreign(folder: Path) -> None:
    """Refuses a folder that holds something else than a saved simulator.

    Raises:
        InputError: If it does.
    """
    if is_foreign(folder):
        raise InputError(f"Expected a folder for models. Received: {folder}, which holds something else. Name another --out.")
