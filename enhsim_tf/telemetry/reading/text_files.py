"""Reads text files as tables: one decision on the decimal sign from all columns, and messages with the lines of the file."""

import dataclasses
import io
import re
import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import (
    allows_point_thousands,
    has_commas,
    is_text,
    shows_comma,
)
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import ROWS, Finding, Places
from enhsim_tf.telemetry.reading.dialect import BLANKS, Dialect, decode, find_dialect

_LOOK = 2_000  # cells of a column that are searched for a decimal comma
_ANNOTATION = re.compile(r"^#(?:group|datatype|default)\b", re.MULTILINE)


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """A table as it was read."""

    frame: pd.DataFrame  # columns have names of text, which may repeat
    places: Places = ROWS  # where the rows are in their files
    decimal: str | None = None  # sign of numbers in text; None: each column shows its own
    findings: tuple[Finding, ...] = ()  # for the cleaning log
    units: Mapping[str, str] = dataclasses.field(
        default_factory=dict
    )  # cells of a line of units by column


def table_of(
    frame: pd.DataFrame,
    dialect: Dialect,
    name: str,
    decimal: str | None,
    findings: Sequence[Finding],
) -> Table:
    """Makes a table of the cells below the header of a file."""
    frame.columns = dialect.names
    units = dict(zip(dialect.names, dialect.units, strict=False))
    return Table(
        frame, Places([(0, dialect.first_line + 1, name)]), decimal, tuple(findings), units
    )


def read_text(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads the content of a text file. Every line behind the header is a row; blank lines are rows of missing values.

    Raises:
        InputError: If it has no header, or its decimal sign cannot be told.
        ValueError: If it cannot be read. The message says why.
    """
    text, findings = decode(content)
    if _ANNOTATION.search(text[:10_000]):
        return _read_annotated(text, name, findings)
    dialect = find_dialect(text, name, options.no_header)
    if dialect.skipped:
        findings.append(
            Finding(
                "header lines",
                dialect.skipped,
                f"lines before the data that were skipped: {dialect.skipped:,}",
            )
        )
    data = "".join(text.split("\n", dialect.first_line)[dialect.first_line :])
    frame, decimal = _read_rows(data, dialect, name, options.decimal)
    if decimal == ",":
        findings.append(
            Finding(
                "decimal comma",
                1,
                "the decimal sign of the file is a comma; points separate thousands",
            )
        )
    repeated = _repeated_headers(frame, dialect.names)
    if repeated:
        frame = frame.astype(object)
        frame.iloc[repeated] = None
        lines = ", ".join(str(row + dialect.first_line + 1) for row in repeated[:3])
        findings.append(
            Finding(
                "header lines",
                len(repeated),
                f"lines that repeat the header or mark a stop, left out: {len(repeated):,} (line {lines})",
            )
        )
    return table_of(frame, dialect, name, decimal, findings)


def _read_rows(
    data: str, dialect: Dialect, name: str, decimal: str | None
) -> tuple[pd.DataFrame, str | None]:
    """Reads the data with the decimal sign that all columns allow; None if they do not show it."""
    names = dialect.names
    head = pd.DataFrame([(row + [""] * len(names))[: len(names)] for row in dialect.head])
    sign = decimal or ("," if any(_shows_comma(head[column]) for column in head) else None)
    if sign is None and dialect.separator == ";":
        sign = _sign_of_country(head, names, name)
    frame = _parse(data, dialect, name, sign)
    if sign is None and any(
        is_text(frame[column]) and _shows_comma(frame[column]) for column in frame
    ):
        sign, frame = ",", _parse(data, dialect, name, ",")
    if sign == "," and decimal is None:
        _check_points(frame, names, name)
    return frame, sign


def _shows_comma(cells: pd.Series) -> bool:
    return shows_comma(cells.iloc[:: max(1, len(cells) // _LOOK)].dropna().astype("str"))


def _sign_of_country(head: pd.DataFrame, names: Sequence[str], name: str) -> str | None:
    """Returns the comma where dates are written with points and all numbers with commas, as where the comma is the decimal sign."""
    columns = [head[column].astype("str").str.strip() for column in head]
    if not any(cells.str.fullmatch(r"\d\d?\.\d\d?\.\d{4}.*").any() for cells in columns):
        return None
    pointed = [
        column
        for column, cells in zip(head, columns, strict=True)
        if cells.str.fullmatch(r"[+-]?\d+\.\d+").any()
    ]
    if pointed and all(
        allows_point_thousands(columns[column][columns[column] != ""]) for column in pointed
    ):
        raise InputError(
            f"Expected a decimal sign that can be told. Received: {head[pointed[0]].iloc[0]!r} in {names[pointed[0]]!r} of {name}, where a point may "
            "separate thousands. Give decimal (--decimal . or --decimal ,)."
        )
    return "," if not pointed and any(has_commas(cells) for cells in columns) else None


def _check_points(frame: pd.DataFrame, names: Sequence[str], name: str) -> None:
    """Refuses numbers with decimal points in one column of a file that has decimal commas in others."""
    for column in frame:
        if not is_text(frame[column]):
            continue
        cells = (
            frame[column].iloc[:: max(1, len(frame) // _LOOK)].dropna().astype("str").str.strip()
        )
        points = cells[cells.str.fullmatch(r"[+-]?\d+\.\d+").to_numpy(bool)]
        if len(points) > len(cells) / 2 and not allows_point_thousands(points):
            raise InputError(
                f"Expected one decimal sign in all columns. Received: a point in {names[column]!r} ({points.iloc[0]}), commas in others, in {name}. "
                "Give decimal (--decimal . or --decimal ,)."
            )


def _parse(data: str, dialect: Dialect, name: str, decimal: str | None) -> pd.DataFrame:
    width, is_blanks = len(dialect.names), dialect.separator == BLANKS
    options = {
        "sep": dialect.separator,
        "header": None,
        "names": range(width),
        "index_col": False,
        "low_memory": False,
    }
    options |= {
        "skip_blank_lines": is_blanks,
        "decimal": decimal or ".",
        "skipinitialspace": dialect.separator != "\t",
    }
    with warnings.catch_warnings():
        warnings.simplefilter(
            "error", pd.errors.ParserWarning
        )  # otherwise lines longer than the header are cut
        try:
            frame = pd.read_csv(io.BytesIO(data.encode()), **options)
        except pd.errors.EmptyDataError:
            return pd.DataFrame(columns=range(width), dtype=object)
        except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
            found = re.search(r"in line (\d+), saw (\d+)", str(error))
            if found or isinstance(error, pd.errors.ParserWarning):
                line, cells = found.groups() if found else (1, "more")
                raise ValueError(
                    f"line {int(line) + dialect.first_line} has {cells} cells, the header {width}"
                ) from None
            is_quote = "EOF" in str(error) or "quot" in str(error)
            raise ValueError(
                "a quote that does not end" if is_quote else "lines that do not match the header"
            ) from None
    if is_blanks and frame.iloc[:-1, -1].isna().any():  # the last line may be cut
        for number, line in enumerate(data.rstrip().split("\n")[:-1], dialect.first_line + 1):
            if 0 < len(line.split()) < width:
                raise ValueError(f"line {number} has {len(line.split())} cells, the header {width}")
    return frame


def _repeated_headers(frame: pd.DataFrame, names: Sequence[str]) -> list[int]:
    """Returns the numbers of the rows that repeat the names, as in files that were joined, or that WinCC writes where it stops (`$RT_OFF$`)."""
    first = next(
        (place for place, name in enumerate(names) if not name.startswith("column ")), None
    )
    if first is None or not is_text(frame.iloc[:, first]):
        return []
    is_mark = frame.iloc[:, first].astype("str").str.startswith("$RT_").fillna(False)
    rows = np.flatnonzero((frame.iloc[:, first] == names[first]).fillna(False) | is_mark)
    repeats = (
        all(
            str(cell).strip() in (name, "nan")
            for cell, name in zip(frame.iloc[row], names, strict=True)
        )
        for row in rows
    )
    return [
        row for row, repeated in zip(rows, repeats, strict=True) if repeated or is_mark.iloc[row]
    ]


def _read_annotated(text: str, name: str, findings: list[Finding]) -> Table:
    """Reads InfluxDB's annotated CSV, in which each table has annotations and a header of its own."""
    lines = text.split("\n")
    marks = [number for number, line in enumerate(lines) if _ANNOTATION.match(line)]
    begins = [number for number in marks if number - 1 not in marks]
    frames, places, row = [], [], 0
    for begin, end in zip(begins, [*begins[1:], len(lines)], strict=True):
        header = next(
            (number for number in range(begin, end) if not lines[number].startswith("#")), end
        )
        defaults = next((line for line in lines[begin:header] if line.startswith("#default")), "")
        data = "\n".join(line.rstrip("\r") for line in lines[header:end]).rstrip("\n")
        if not data.strip():
            continue
        try:
            frame = pd.read_csv(io.StringIO(data), low_memory=False, skip_blank_lines=False)
        except pd.errors.ParserError:
            raise ValueError(
                f"a table in the lines {header + 1} to {end} whose lines have different lengths"
            ) from None
        if "error" in frame and "reference" in frame:
            raise ValueError(
                f"the database answered with an error: {str(frame['error'].iloc[0] if len(frame) else '')[:100]}"
            )
        values = defaults.rstrip("\r").split(",")
        for column, value in zip(frame.columns[1:], values[1:], strict=False):
            if value:
                frame[column] = frame[column].astype(object).fillna(value)
        frames.append(
            frame.iloc[:, 1:]
            if frame.shape[1] and str(frame.columns[0]).startswith("Unnamed")
            else frame
        )
        places.append((row, header + 2, name))
        row += len(frame)
    if not frames:
        raise ValueError("it has no table")
    findings.append(
        Finding("header lines", len(frames), f"tables of annotated CSV: {len(frames):,}")
    )
    return Table(pd.concat(frames, ignore_index=True), Places(places), ".", tuple(findings))
