"""What can be a source of telemetry, for help and messages, and whether it exists. This module
imports nothing slow, as the command line uses it.
"""

import os
from collections.abc import Sequence
from pathlib import Path

from enhsim_tf.common.errors import InputError

PACKED = (".gz", ".zip")
"""Endings of packed files, each with one table inside."""
SOURCES = (
    "a text file with a table, a .parquet, .xlsx, .mat, .h5, .jsonl or .npy file, also in .gz or "
    ".zip, several files of one table, a folder of them, or "
    "influxdb://bucket/measurement/field?tag=value"
)
"""All sources as text, for help and messages."""


def existing(source: str | os.PathLike | Sequence[str | os.PathLike]) -> str | Path | list[Path]:
    """Returns a source as a path, several tables as their paths, or an address of InfluxDB; raises
    InputError unless files exist.
    """
    if isinstance(source, str | os.PathLike):
        source = os.fspath(source)
        if source.startswith("influxdb://"):
            return source
        # unlike Path.exists, this does not raise for names that no file can have
        if not os.path.exists(source):
            raise InputError(
                f"Expected a source of telemetry. Received: {source}, which does not exist. Give "
                f"{SOURCES}."
            )
        return Path(source)
    if not isinstance(source, list | tuple):
        raise InputError(
            f"Expected a source of telemetry. Received: {type(source).__name__}. Give {SOURCES}; "
            "in Python also a DataFrame or a Series, or Telemetry.of an array."
        )
    wrong = [
        str(path) if isinstance(path, str | os.PathLike) else type(path).__name__
        for path in source or [source]
        if not isinstance(path, str | os.PathLike) or not os.path.isfile(path)
    ]
    if wrong:
        raise InputError(
            "Expected files that exist, as several sources are files of one table. Received: "
            f"{wrong[0]}. Give one source."
        )
    paths = [Path(path) for path in source]
    return paths if len(paths) > 1 else paths[0]
