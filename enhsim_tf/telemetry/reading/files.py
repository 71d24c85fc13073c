"""Reads tables from files of every kind, from several files of one series, and from pandas
objects.
"""

import dataclasses
import gzip
import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS, reading
from enhsim_tf.telemetry.cleaning.numbers import is_plain
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding, Places
from enhsim_tf.telemetry.reading.clock_values import epoch_unit_of
from enhsim_tf.telemetry.reading.column_names import name_tells
from enhsim_tf.telemetry.reading.formats import HAS_TABLES, READERS, read_any_text
from enhsim_tf.telemetry.reading.text_files import Table
from enhsim_tf.telemetry.source_kinds import PACKED, SOURCES

_OF_FOLDERS = ((".csv",), (".parquet",), (".tsv", ".txt"), (".xlsx", ".xlsm"))


def read_table(
    source: Path | Sequence[Path] | pd.DataFrame | pd.Series, options: Cleaning
) -> Table:
    """Reads a file, a folder of files, several files with the same columns, or a pandas object; the
    rows of files follow each other.
    """
    if isinstance(source, pd.DataFrame | pd.Series):
        table = Table(source.to_frame() if isinstance(source, pd.Series) else source)
        return _with_plain_columns(table, "the DataFrame")
    paths = (
        source
        if not isinstance(source, Path)
        else files_of(source)
        if source.is_dir()
        else [source]
    )
    tables = [_with_plain_columns(_read_file(path, options), path.name) for path in paths]
    table = tables[0] if len(tables) == 1 else _join(tables, paths)
    what = source.name if isinstance(source, Path) else f"{paths[0].name} ..."
    return dataclasses.replace(table, what=what)


def files_of(folder: Path) -> list[Path]:
    """Returns the tables in a folder, in the order of their names: CSV files, or those of the next
    kind if there are none. Refuses tables in CSV and in Parquet side by side.
    """
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    for endings in (*_OF_FOLDERS, tuple(READERS)):
        paths = [path for path in files if suffix_of(path) in endings]
        if paths:
            others = [path.name for path in files if suffix_of(path) == ".parquet"]
            if others and endings == (".csv",):
                raise InputError(
                    f"Expected tables of one kind in a folder. Received: {paths[0].name} and "
                    f"{others[0]} in {folder.name}.",
                    otherwise="the files of one kind by their names",
                )
            return sorted(
                paths,
                key=lambda path: [
                    int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)
                ],
            )
    raise InputError(
        f"Expected a folder with tables. Received: {folder} without any. Give {SOURCES}."
    )


def suffix_of(path: Path) -> str:
    """Returns the ending of a file's name in lower case, without that of a packed file: `.csv` for
    `day1.CSV.gz`.
    """
    suffix = path.suffix.lower()
    return (Path(path.stem).suffix.lower() or ".csv") if suffix in PACKED else suffix


def _read_file(path: Path, options: Cleaning) -> Table:
    content, suffix = unpack(path)
    if options.table is not None and suffix not in HAS_TABLES:
        raise InputError(
            f"Expected table (--table) with a file of several, {', '.join(HAS_TABLES)}. Received: "
            f"{path.name}. Leave it out."
        )
    return READERS.get(suffix, read_any_text)(content, path.name, options)


def unpack(path: Path) -> tuple[bytes, str]:
    """Returns the content of a file, unpacked, and the ending of the file inside."""
    with reading(path.name):
        content = path.read_bytes()
        suffix = suffix_of(path)
        if path.suffix.lower() == ".gz":
            content = gzip.decompress(content)
        if path.suffix.lower() != ".zip":
            return content, suffix
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [
                member
                for member in archive.infolist()
                if not member.is_dir() and not member.filename.startswith("__MACOSX/")
            ]
            if len(members) == 1:
                return archive.read(members[0]), Path(members[0].filename).suffix.lower()
    said = ", ".join(member.filename for member in members[:4]) or "none"
    raise InputError(
        f"Expected one file in {path.name}. Received: {len(members)} ({said}). Unpack it and give "
        "the files."
    )


def _with_plain_columns(table: Table, name: str) -> Table:
    """Turns an index that means something into a column, and names into text."""
    frame = table.frame
    # the rows of a slice are counted from 0 as well
    is_counted = isinstance(frame.index, pd.RangeIndex) and frame.index.name is None
    if frame.index.nlevels == 1 and frame.index.name is None:
        frame = frame.rename_axis("column 0")  # as in text
    frame = frame.reset_index(drop=is_counted, allow_duplicates=True)
    if frame.columns.nlevels > 1:
        raise InputError(
            f"Expected one line of column names. Received: {frame.columns.nlevels} levels in "
            f"{name}. Join them."
        )
    if not 0 < len(frame.columns) <= MAX_COLUMNS:
        raise InputError(
            f"Expected a table of 1 to {MAX_COLUMNS:,} columns. Received: {len(frame.columns):,} "
            f"in {name}. Give another table."
        )
    frame = frame.set_axis([str(column).strip() for column in frame.columns], axis=1)
    return dataclasses.replace(table, frame=frame)


def _epoch_unit_of(cells: pd.Series) -> str | None:
    """Returns the unit in which a clock may hold times since 1970."""
    if not is_plain(cells) or name_tells(str(cells.name))[0] == 0:
        return None
    return epoch_unit_of(cells.to_numpy(np.float64, na_value=np.nan))


def _join(tables: Sequence[Table], paths: Sequence[Path]) -> Table:
    """Joins tables with the same columns."""
    names = list(tables[0].frame.columns)
    for table, path in zip(tables, paths, strict=True):
        if sorted(table.frame.columns) != sorted(names) or len(set(names)) < len(names):
            other = min(set(names).symmetric_difference(table.frame.columns), default=names[0])
            raise InputError(
                f"Expected files with the same columns. Received: {other!r} not exactly once in "
                f"{paths[0].name} and {path.name}. Read them one by one."
            )
    for name in names:
        columns = [table.frame[name].dtype for table in tables]
        dates = [each for each in columns if pd.api.types.is_datetime64_any_dtype(each)]
        has_zone = {isinstance(each, pd.DatetimeTZDtype) for each in dates}
        since = {_epoch_unit_of(table.frame[name]) for table in tables} - {None}
        units = {table.units.get(name, "") for table in tables}
        if max(map(len, (has_zone, since, units))) > 1:
            raise InputError(
                f"Expected files that are written alike. Received: {name!r} of different units, or "
                f"with and without a zone, in {paths[0].name} to {paths[-1].name}. Read them one "
                "by one."
            )
    places = []
    row = 0
    for table, path in zip(tables, paths, strict=True):
        places += [(row + first, line, name) for first, line, name in table.places.files] or [
            (row, 1, path.name)
        ]
        row += len(table.frame)
    frame = pd.concat([table.frame[names] for table in tables], ignore_index=True)
    findings = [
        Finding(
            "files",
            len(paths),
            f"files read one after the other: {len(paths)}, {paths[0].name} to {paths[-1].name}",
        )
    ]
    findings += list(
        {finding.text: finding for table in tables for finding in table.findings}.values()
    )
    return Table(
        frame,
        Places(tuple(places)),
        next((each.decimal for each in tables if each.decimal), None),
        tuple(findings),
        tables[0].units,
        tables[0].above,
    )
