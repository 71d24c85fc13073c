"""The files that can be read as telemetry (step 4 of the paper's pipeline). This module imports nothing slow, as the command line uses it."""

import os
from collections.abc import Sequence
from pathlib import Path

from enhsim_tf.common.errors import InputError

PACKED = (".gz", ".zip")
"""Endings of packed files, each with one table inside."""
TABLES = (".csv", ".tsv", ".txt", ".parquet", ".xlsx", ".xlsm", *PACKED)
"""Endings of the names of tables."""

SOURCES = f"a {', '.join((*TABLES, '.npy'))} file, several files of tables, a folder of them, or influxdb://bucket/measurement/field?tag=value"
"""All sources as text, for help and messages."""


def existing(source: str | os.PathLike | Sequence[str | os.PathLike]) -> str | Path | list[Path]:
    """Returns a source as a path, several tables as their paths, or an address of InfluxDB; raises InputError unless files exist."""
    if isinstance(source, str | os.PathLike):
        source = os.fspath(source)
        if source.startswith("influxdb://"):
            return source
        if not os.path.exists(
            source
        ):  # unlike Path.exists, this does not raise for names that no file can have
            raise InputError(
                f"Expected a source of telemetry. Received: {source}, which does not exist. Give {SOURCES}."
            )
        return Path(source)
    paths = [Path(os.fspath(each)) for each in source]
    wrong = next(
        (path for path in paths if path.suffix.lower() not in TABLES or not os.path.exists(path)),
        None,
    )
    if wrong is not None or not paths:
        raise InputError(
            f"Expected tables that exist, as several sources are files of one table. Received: {wrong}. Give one source."
        )
    return paths
