"""Finds and names the folders of fitted models."""

import os
import urllib.parse
from collections.abc import Mapping, Sequence
from pathlib import Path

from enhsim_tf.common.atomic_files import encode_name
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.simulator.saving import MANIFEST, is_foreign, settings_of

_MOST_BYTES = 60  # of the name of a folder


def folder_of(models: str | os.PathLike, channel: str) -> Path:
    """Returns the folder of a channel. Its name is the channel's name, percent-encoded.

    Args:
        models: Folder of all models.
        channel: Name of the channel.

    Raises:
        InputError: If the name is empty or too long for a folder.
    """
    return Path(models) / encode_name(channel)


def name_of_channels(channels: Sequence[str]) -> str:
    """Returns the name of a model: that of its channel, or those of its channels joined by `~`, shortened if there are many.

    Args:
        channels: Names of the channels.
    """
    joined = "~".join(channels)
    return joined if len(channels) == 1 or len(joined.encode()) <= _MOST_BYTES else f"{channels[0]}~{len(channels) - 1} more"


def channels_of(folder: Path) -> tuple[str, ...]:
    """Returns the names of the channels of a saved simulator without loading it.

    Args:
        folder: The folder of the simulator.

    Raises:
        InputError: If the folder was not written by `EnhancedSimulator.save`.
    """
    names = settings_of(folder).get("channels")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(f"Expected the names of channels in settings.json. Received: {str(names)[:80]} in {folder}. Fit it again.")
    return tuple(names)


def models_of(models: str | os.PathLike) -> dict[str, Path]:
    """Returns the fitted channels in a folder.

    Args:
        models: Folder of all models, or the folder of one saved simulator.

    Returns:
        A dictionary from the names of the channels to their folders.

    Raises:
        InputError: If the folder contains no saved simulator.
    """
    models = Path(os.path.abspath(models))  # so that "." has a name too
    if os.path.isfile(models / MANIFEST):  # unlike Path.is_file, this does not raise for names that are not valid file names
        return {urllib.parse.unquote(models.name): models}
    folders = sorted(models.glob(f"[!.]*/{MANIFEST}")) if os.path.isdir(models) else []
    if not folders:
        raise InputError(
            f"Expected a folder of fitted simulators. Received: {printable(str(models))[:200]}, which contains none. Make one with `fit`."
        )
    found: dict[str, Path] = {}
    for folder in (manifest.parent for manifest in folders):
        name = urllib.parse.unquote(folder.name)
        if name in found:
            raise InputError(
                f"Expected one folder per channel. Received: {found[name].name} and {folder.name}, both of {name!r}. Remove one."
            )
        found[name] = folder
    return found


def chosen_of(models: Mapping[str, Path], channels: Sequence[str] | None) -> dict[str, Path]:
    """Selects fitted channels by name.

    Args:
        models: All fitted channels, as returned by `models_of`.
        channels: Names of the channels to select. None or an empty sequence selects all.

    Raises:
        InputError: If there is no fitted channel of one of the names.
    """
    unknown = [name for name in channels or () if name not in models]
    if unknown:
        raise InputError(f"Expected --channel, one of: {printable(', '.join(list(models)[:8]))}. Received: {unknown[0]!r}.")
    return {name: models[name] for name in channels or models}


def refuse_foreign(folder: Path) -> None:
    """Checks that a folder is new, empty or a saved simulator, so that it may be replaced.

    Args:
        folder: The folder.

    Raises:
        InputError: If the folder contains something else.
    """
    if is_foreign(folder):
        raise InputError(f"Expected a folder for models. Received: {folder}, which contains something else. Give another --out.")
