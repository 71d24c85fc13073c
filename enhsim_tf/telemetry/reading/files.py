"""Reads tables from files of every kind, from several files of one series, and from pandas objects."""

import dataclasses
import gzip
import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pyarrow as pa

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import MAX_COLUMNS, READ_ERRORS, short_reason
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding, Places
from enhsim_tf.telemetry.reading.dialect import find_dialect
from enhsim_tf.telemetry.reading.text_files import Table, read_text, table_of
from enhsim_tf.telemetry.registry import PACKED, SOURCES

TEXTS = (".csv", ".tsv", ".txt")
_EXCEL = (".xlsx", ".xlsm")


def read_table(
    source: Path | Sequence[Path] | pd.DataFrame | pd.Series, options: Cleaning
) -> Table:
    """Reads a file, a folder of files, several files with the same columns, or a pandas object; the rows of files follow each other."""
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
    return tables[0] if len(tables) == 1 else _join(tables, paths)


def files_of(folder: Path) -> list[Path]:
    """Returns the tables in a folder, in the order of their names: CSV files, or those of the next kind if there are none."""
    for endings in ((".csv",), (".parquet",), (".tsv", ".txt"), _EXCEL):
        found = [
            path
            for path in folder.iterdir()
            if path.is_file() and _suffix_of(path) in endings and not path.name.startswith(".")
        ]
        if found:
            return sorted(
                found,
                key=lambda path: [
                    int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)
                ],
            )
    raise InputError(
        f"Expected a folder with tables. Received: {folder} without any. Give {SOURCES}."
    )


def _suffix_of(path: Path) -> str:
    """Returns the ending of a file's name in lower case, without that of a packed file: `.csv` for `day1.CSV.gz`."""
    suffix = path.suffix.lower()
    return (Path(path.stem).suffix.lower() or ".csv") if suffix in PACKED else suffix


def _read_file(path: Path, options: Cleaning) -> Table:
    try:
        content, name = _unpack(path)
        suffix = Path(name).suffix.lower()
        if suffix == ".parquet":
            if content is not None:
                raise ValueError("a packed Parquet file; unpack it")
            return Table(pd.read_parquet(path))
        content = path.read_bytes() if content is None else content
        return (
            _read_excel(io.BytesIO(content), path.name, options)
            if suffix in _EXCEL
            else read_text(content, path.name, options)
        )
    except InputError:
        raise
    except (*READ_ERRORS, pa.ArrowException) as error:
        raise InputError(
            f"Expected a table. Received: {path.name}, which cannot be read ({short_reason(error)}). Correct it or save it again."
        ) from None


def _unpack(path: Path) -> tuple[bytes | None, str]:
    """Returns the content of a packed file, or None if it is not packed, and the name of the file inside."""
    suffix = path.suffix.lower()
    if suffix == ".gz":
        content, name = (
            gzip.decompress(path.read_bytes()),
            path.stem if Path(path.stem).suffix else f"{path.stem}.csv",
        )
    elif suffix == ".zip":
        with zipfile.ZipFile(path) as archive:
            members = [
                member
                for member in archive.infolist()
                if not member.is_dir() and not member.filename.startswith("__MACOSX/")
            ]
            if len(members) != 1:
                said = ", ".join(member.filename for member in members[:4]) or "none"
                raise InputError(
                    f"Expected one file in {path.name}. Received: {len(members)} ({said}). Unpack it and give the files."
                )
            content, name = archive.read(members[0]), members[0].filename
    else:
        return None, path.name
    if Path(name).suffix.lower() not in (*TEXTS, *_EXCEL, ".parquet"):
        raise ValueError(f"{name} inside, which is no table")
    return content, name


def _read_excel(stream: io.BytesIO, name: str, options: Cleaning) -> Table:
    """Reads the first sheet of a workbook, with the same search for its header as in text."""
    try:
        import openpyxl
    except ImportError:
        raise InputError(
            f"Expected the package openpyxl for {name}. Received: none. Install it, or save the sheet as CSV."
        ) from None
    findings, book = [], openpyxl.load_workbook(stream, read_only=True, data_only=True)
    rows = [list(row) for row in book.worksheets[0].iter_rows(values_only=True)]
    if len(book.worksheets) > 1:
        findings.append(
            Finding("files", 1, f"only the first sheet was read: {book.worksheets[0].title}")
        )
    width = max(
        (place + 1 for row in rows for place, cell in enumerate(row) if cell is not None), default=0
    )
    cells = [
        ["" if cell is None else str(cell).replace("\n", " ") for cell in row[:width]]
        for row in rows[:100]
    ]
    text = "\n".join(
        "\t".join(cell.replace("\t", " ").replace('"', "'") for cell in row) if any(row) else ""
        for row in cells
    )
    dialect = find_dialect(text, name, options.no_header, "\t")
    frame = pd.DataFrame([row[:width] for row in rows[dialect.first_line :]]).infer_objects()
    return table_of(frame, dialect, name, None, findings)


def _with_plain_columns(table: Table, name: str) -> Table:
    """Turns an index that means something into a column, and names into text."""
    frame = table.frame
    frame = frame.reset_index(
        drop=isinstance(frame.index, pd.RangeIndex)
    )  # the rows of a slice are counted from 0 as well
    if frame.columns.nlevels > 1:
        raise InputError(
            f"Expected one line of column names. Received: {frame.columns.nlevels} levels in {name}. Join them."
        )
    if not 0 < len(frame.columns) <= MAX_COLUMNS:
        raise InputError(
            f"Expected a table of 1 to {MAX_COLUMNS:,} columns. Received: {len(frame.columns):,} in {name}. Give another table."
        )
    frame = frame.set_axis([str(column).strip() for column in frame.columns], axis=1)
    return dataclasses.replace(table, frame=frame)


def _join(tables: Sequence[Table], paths: Sequence[Path]) -> Table:
    """Joins tables with the same columns."""
    names = list(tables[0].frame.columns)
    for table, path in zip(tables, paths, strict=True):
        if sorted(table.frame.columns) != sorted(names) or len(set(names)) < len(names):
            other = min(set(names).symmetric_difference(table.frame.columns), default=names[0])
            raise InputError(
                f"Expected files with the same columns. Received: {other!r} not exactly once in {paths[0].name} and {path.name}. Read them one by one."
            )
    places, row = [], 0
    for table, path in zip(tables, paths, strict=True):
        places += [(row + first, line, name) for first, line, name in table.places] or [
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
        Places(places),
        next((each.decimal for each in tables if each.decimal), None),
        tuple(findings),
        tables[0].units,
    )
