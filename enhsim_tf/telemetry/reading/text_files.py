"""Reads text files as tables: one decision on the decimal sign from all columns, and messages with
the lines of the file.
"""

import contextlib
import csv
import dataclasses
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import (
    SIGNS,
    allows_point_thousands,
    has_commas,
    is_text,
    matches,
    shows_comma,
)
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import ROWS, Finding, Places
from enhsim_tf.telemetry.reading.dialect import (
    BLANKS,
    HEAD,
    Dialect,
    find_dialect,
    line_start,
    utf8_of,
)

_HEAD = 100_000  # bytes that are searched for blanks before cells
_LOOK = 2_000  # cells of a column that are searched for a decimal comma
_FEWEST_FLAGS = 20  # cells below which nothing is said about the digits behind a comma
_MAX_FLAGS = 3  # different ones, above which they are decimals
# plain ones, which pandas reads faster than text; other cells in their column leave it text
_TIME = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d").match
_DIGITS = re.compile(r"[+-]?[.,]?\d").match
_FILLED = re.compile(rb"\S").search
_ANNOTATION = re.compile(r"^#(?:group|datatype|default)\b", re.MULTILINE)
_ANNOTATED = re.compile(r"((?:^#.*\n)+)((?:^(?!#).*\n?)*)", re.MULTILINE)


class _RaggedError(ValueError):
    """Raised for lines of different lengths."""


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """A table as it was read."""

    frame: pd.DataFrame  # columns have names of text, which may repeat
    places: Places = ROWS  # where the rows are in their files
    decimal: str | None = None  # sign of numbers in text; None: each column shows its own
    findings: tuple[Finding, ...] = ()  # for the cleaning log
    # cells of a line of units by column
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    above: str = ""  # text that the file has beside the table
    what: str = "the table"  # where it is from, for messages


def table_of(
    frame: pd.DataFrame, dialect: Dialect, decimal: str | None, findings: Sequence[Finding]
) -> Table:
    """Makes a table of the cells below the header of a file."""
    frame.columns = dialect.names
    units = dict(zip(dialect.names, dialect.units, strict=False))
    return Table(
        frame,
        Places(((0, dialect.line, dialect.file),)),
        decimal,
        tuple(findings),
        units,
        "\n".join(dialect.above),
    )


def read_text(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads the content of a text file. Every line behind the header is a row; blank lines are rows
    of missing values.

    Raises:
        InputError: If it has no header, or its decimal sign cannot be told.
        ValueError: If it cannot be read. The message says why.
    """
    text, findings = utf8_of(content)
    if options.skip_rows:
        text = text[line_start(text, options.skip_rows) :]
        if not text.strip():
            raise ValueError(f"no line is left behind skip_rows={options.skip_rows}")
    head = text[:HEAD].decode(errors="ignore")  # its end may cut a character
    if _ANNOTATION.search(head[:10_000]):
        return _read_annotated(text.decode(), name, findings)
    dialect = find_dialect(head, name, options)
    if dialect.skipped:
        findings.append(
            Finding(
                "header lines",
                dialect.skipped,
                f"lines before the data that were skipped: {dialect.skipped:,}",
            )
        )
    begin = line_start(text, dialect.first_line)  # which costs less than a copy of the data
    if not _FILLED(text, begin):
        raise InputError(
            f"Expected rows below the header. Received: only names in {name}, "
            f"{', '.join(dialect.names[:4])}. Give a file with values."
        )
    frame = None
    with contextlib.suppress(_RaggedError):
        frame, decimal = _read_rows(text, begin, dialect, options.decimal)
    if frame is None or _may_be_ragged(frame, text, begin, dialect):
        data, ragged = _without_ragged(text[begin:], dialect, options.drop_bad)
        findings += ragged
        if ragged or frame is None:
            frame, decimal = _read_rows(data, 0, dialect, options.decimal)
    _refuse_open_quote(frame, text, begin, dialect)
    if decimal == ",":
        findings.append(
            Finding(
                "decimal comma",
                1,
                "the decimal sign of the file is a comma; points separate thousands",
            )
        )
    repeated = _repeated_headers(frame, dialect)
    if repeated:
        frame = frame.drop(index=repeated).reset_index(drop=True)
        lines = ", ".join(str(row + dialect.line) for row in repeated[:3])
        findings.append(
            Finding(
                "header lines",
                len(repeated),
                f"lines that repeat the header or mark a stop, left out: {len(repeated):,} (line "
                f"{lines})",
            )
        )
    table = table_of(frame, dialect, decimal, findings)
    behind_them = [
        (row - before, row + dialect.line + 1, name) for before, row in enumerate(repeated)
    ]
    return dataclasses.replace(table, places=Places((*table.places.files, *behind_them)))


def _may_be_ragged(frame: pd.DataFrame, text: bytes, begin: int, dialect: Dialect) -> bool:
    """Whether lines that were read may have fewer cells than the header: then some of the last
    column are missing, and so are separators, which can be counted unless cells hold them.
    """
    num_separators = (len(dialect.names) - 1) * len(frame)
    return bool(frame.iloc[:, -1].isna().any()) and (
        text.find(b'"', begin) >= 0
        or text.count(dialect.separator.encode(), begin) != num_separators
    )


def _refuse_open_quote(frame: pd.DataFrame, text: bytes, begin: int, dialect: Dialect) -> None:
    """Refuses a cell in quotation marks that holds what reads as rows of its own."""
    if text.find(b'"', begin) < 0 or text.count(b"\n", begin) <= len(frame):
        return
    mark = dialect.separator
    first = re.sub(r"\d", "0", dialect.head[0][0]) + mark

    def is_row(line: str) -> bool:
        is_full = line.count(mark) >= max(2, len(dialect.names) - 1)
        return is_full or len(first) > 8 and re.sub(r"\d", "0", line).startswith(first)

    for column in filter(lambda column: is_text(frame[column]), frame):
        cells = frame[column].dropna().astype("str")
        for row, cell in cells[cells.str.contains("\n", regex=False)].iloc[:1_000].items():
            if any(map(is_row, cell.split("\n")[1:])):
                raise InputError(
                    "Expected quotation marks in pairs. Received: one in line "
                    f"{row + dialect.line} of {dialect.file} with further rows inside. Correct it."
                )


def _without_ragged(data: bytes, dialect: Dialect, drop: bool) -> tuple[bytes, list[Finding]]:
    """Empties lines that have another number of cells than the header, if they are to be dropped,
    or if it is the last, without an end; otherwise refuses them.
    """
    width = len(dialect.names)
    lines = data.decode().split("\n")
    if dialect.separator == BLANKS:
        rows = ((number, number + 1, len(line.split())) for number, line in enumerate(lines))
    else:
        rows = _rows_of(lines, dialect.separator)
    whole = (0, width, width - dialect.may_lack_last)
    wrong = [row for row in rows if row[2] not in whole]
    if not wrong or width == 1:
        return data, []
    is_cut = wrong[-1][0] == len(lines) - 1 and wrong[-1][2] < width
    if len(wrong) > is_cut and not drop:
        first, _, cells = wrong[0]
        raise InputError(
            f"Expected {width} cells in a line, as in the header. Received: line "
            f"{first + dialect.line} has {cells}, in {dialect.file} ({len(wrong):,} such lines in "
            "all).",
            [{"drop_bad": True}],
            "a corrected file",
        )
    for begin, end, _ in wrong:
        lines[begin:end] = [""] * (end - begin)
    where = tuple(f"line {begin + dialect.line}" for begin, _, _ in wrong[:3])
    text = f"lines with another number of cells than the header: {len(wrong):,}"
    if is_cut:
        text += "; the last line is cut off"
    return "\n".join(lines).encode(), [Finding("ragged lines", len(wrong), text, where)]


def _rows_of(lines: Sequence[str], separator: str) -> Iterator[tuple[int, int, int]]:
    """Yields first line, end and number of cells of each row."""
    begin = 0
    rows = csv.reader((line.strip(" \r") for line in lines), delimiter=separator)
    for cells in rows:
        yield begin, rows.line_num, len(cells)
        begin = rows.line_num


def _read_rows(
    text: bytes, begin: int, dialect: Dialect, decimal: str | None
) -> tuple[pd.DataFrame, str | None]:
    """Reads the data, which begin at a place of the text, with the decimal sign that all columns
    allow; None if they do not show it.
    """
    width = len(dialect.names)
    if dialect.separator == "," and text.find(b'"', begin) < 0:
        return _parse(text, begin, dialect, decimal), decimal  # no cell has a comma
    head = pd.DataFrame([(row + [""] * width)[:width] for row in dialect.head])
    sign = decimal or ("," if any(shows_comma(_some(head[column])) for column in head) else None)
    if dialect.separator == "," and decimal is None:
        _refuse_flags(head, dialect)
    if sign is None and dialect.separator == ";":
        sign = _sign_of_country(head, dialect)
    frame = _parse(text, begin, dialect, sign)
    if sign is None and any(
        is_text(frame[column]) and shows_comma(_some(frame[column])) for column in frame
    ):
        sign = ","
        frame = _parse(text, begin, dialect, sign)
    if sign == "," and decimal is None:
        _check_points(frame, dialect)
    return frame, sign


def _some(cells: pd.Series) -> pd.Series:
    """Returns cells from all over a column as text."""
    return cells.iloc[:: max(1, len(cells) // _LOOK)].dropna().astype("str").str.strip()


def _sign_of_country(head: pd.DataFrame, dialect: Dialect) -> str | None:
    """Returns the comma where dates are written with points and all numbers with commas, as where
    the comma is the decimal sign.
    """
    if not any(matches(head[column], r"\d\d?\.\d\d?\.\d{4}.*").any() for column in head):
        return None
    pointed = [column for column in head if matches(head[column], r"[+-]?\d+\.\d+").any()]
    if pointed and all(
        allows_point_thousands(head[column][head[column] != ""]) for column in pointed
    ):
        raise InputError(
            f"Expected a decimal sign that can be told. Received: {head[pointed[0]].iloc[0]!r} in "
            f"{dialect.names[pointed[0]]!r} of {dialect.file}, where a point may separate "
            "thousands.",
            SIGNS,
        )
    return "," if not pointed and any(has_commas(head[column]) for column in head) else None


def _refuse_flags(head: pd.DataFrame, dialect: Dialect) -> None:
    """Refuses whole numbers with a digit behind a comma that hardly varies, as the flag of quality
    that weather services write behind a value.
    """
    cells = pd.concat([head[column] for column in head])
    behind = cells.str.extract(r"^[+-]?\d+,(\d+)$", expand=False).dropna()
    found = cells[matches(cells, r"[+-]?[1-9]\d{2,},\d")]
    if (
        len(found) >= _FEWEST_FLAGS
        and set(behind.str.len()) == {1}
        and behind.nunique() <= _MAX_FLAGS
    ):
        raise InputError(
            f"Expected one number in each cell. Received: {found.iloc[0]!r} in {dialect.file}, "
            "which may be a number and a flag.",
            (),
            "values and flags in columns of their own, or --decimal , if it is a decimal",
        )


def _check_points(frame: pd.DataFrame, dialect: Dialect) -> None:
    """Refuses numbers with decimal points in one column of a file that has decimal commas in
    others.
    """
    for column in frame:
        if not is_text(frame[column]):
            continue
        cells = _some(frame[column])
        points = cells[matches(cells, r"[+-]?\d+\.\d+")]
        if len(points) > len(cells) / 2 and not allows_point_thousands(points):
            raise InputError(
                "Expected one decimal sign in all columns. Received: a point in "
                f"{dialect.names[column]!r} ({points.iloc[0]}), commas in others, in "
                f"{dialect.file}.",
                SIGNS,
            )


def _parse(text: bytes, begin: int, dialect: Dialect, decimal: str | None) -> pd.DataFrame:
    width = len(dialect.names)
    is_blanks = dialect.separator == BLANKS
    head = b"\n" + text[begin : begin + _HEAD]
    is_padded = b"\n " in head or f"{dialect.separator} ".encode() in head
    options = {
        "sep": dialect.separator,
        "header": None,
        "names": range(width),
        "index_col": False,
        "low_memory": False,
        "skip_blank_lines": is_blanks,
        "decimal": decimal or ".",
        # it costs a fifth of the time
        "skipinitialspace": is_blanks or is_padded and dialect.separator != "\t",
        "parse_dates": [
            place
            for row in dialect.head[:1]
            for place, cell in enumerate(row[:width])
            if _TIME(cell)
        ],
        "date_format": "ISO8601",
    }
    file = io.BytesIO(text)
    file.seek(begin)
    with warnings.catch_warnings():
        # otherwise lines longer than the header are cut
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            frame = pd.read_csv(file, **options)
        except pd.errors.EmptyDataError:
            return pd.DataFrame(columns=range(width), dtype=object)
        except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
            is_quote = "EOF" in str(error) or "quot" in str(error)
            raise _RaggedError(
                "a quote that does not end" if is_quote else "lines that do not match the header"
            ) from None
    return frame


def _repeated_headers(frame: pd.DataFrame, dialect: Dialect) -> list[int]:
    """Returns the numbers of the rows that repeat the names, as in files that were joined, or that
    WinCC writes where it stops (`$RT_OFF$`); refuses a header with others or in another order.
    """
    names = dialect.names
    place = next((number for number, each in enumerate(names) if each[:7] != "column "), 0)
    first = frame.iloc[:, place]
    if not is_text(first):
        return []
    first = first.astype("str")
    second = frame.iloc[:, (place + 1) % len(names)].astype("str")
    is_header = (first == names[place]) | first.isin(names) & second.isin(names)
    found = np.flatnonzero((first.str.startswith("$RT_") | is_header).fillna(False))
    rows = []
    for row in found.tolist():
        cells = [str(cell).strip() for cell in frame.iloc[row]]
        is_same = all(cell in (each, "nan") for cell, each in zip(cells, names, strict=True))
        if is_same or first.iloc[row].startswith("$RT_"):
            rows.append(row)
        elif 2 * sum(cell in names for cell in cells) > len(cells) or (
            cells[place] == names[place] and not any(map(_DIGITS, cells))
        ):
            raise InputError(
                f"Expected one order of columns. Received: {', '.join(cells)[:60]} at line "
                f"{row + dialect.line} of {dialect.file}, below {', '.join(names)[:60]}.",
                otherwise="the parts one by one",
            )
    return rows


def _read_annotated(text: str, name: str, findings: list[Finding]) -> Table:
    """Reads InfluxDB's annotated CSV, in which each table has annotations and a header of its
    own.
    """
    frames = []
    places = []
    row = 0
    for block in _ANNOTATED.finditer(text):
        annotations, data = block.groups()
        if not data.strip():
            continue
        line = text.count("\n", 0, block.start(2))
        try:
            frame = pd.read_csv(
                io.StringIO(data.rstrip()), low_memory=False, skip_blank_lines=False
            )
        except pd.errors.ParserError:
            raise ValueError(
                f"a table behind line {line + 1} whose lines have different lengths"
            ) from None
        if "error" in frame and "reference" in frame:
            raise ValueError(f"the database answered with an error: {frame['error'].max()!s:.100}")
        defaults = re.search("^#default,(.*)", annotations, re.MULTILINE)
        values = defaults[1].rstrip("\r").split(",") if defaults else []
        for column, value in zip(frame.columns[1:], values, strict=False):
            if value:
                frame[column] = frame[column].astype(object).fillna(value)
        frames.append(frame.drop(columns="Unnamed: 0", errors="ignore"))
        places.append((row, line + 2, name))
        row += len(frame)
    if not frames:
        raise ValueError("it has no table")
    findings.append(
        Finding("header lines", len(frames), f"tables of annotated CSV: {len(frames):,}")
    )
    return Table(pd.concat(frames, ignore_index=True), Places(tuple(places)), ".", tuple(findings))
