"""Tables as people keep them: CSV in any dialect, Parquet; their time column and their columns of numbers.

Every line is a row: blank ones are kept as missing values. A line that does not fit the header is refused.
"""

import io
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import MAX_COLUMNS, READ_ERRORS, check_parquet, short_reason
from enhsim_tf.telemetry.cleaning.numbers import is_missing, is_text, parse_numbers
from enhsim_tf.telemetry.cleaning.report import Finding

NO_TIME = "none"  # in place of a time column's name: samples are counted
_TIME_NAMES = ("time", "times", "timestamp", "datetime", "date", "date_time", "utc", "_time", "t", "epoch", "time_s", "time_ms")
_SEPARATORS = ";\t|,"  # the comma last: it may part decimals
_HEAD = 100_000  # characters in which the header is looked for
_LOOK = 200  # rows that are looked at to tell what a column of text holds


def read_table(path: Path) -> tuple[pd.DataFrame, list[Finding]]:
    """A table with text for column names, and what was noticed about it.

    Args:
        path: A `.parquet` file, or a text file with a header line.

    Raises:
        InputError: If it cannot be read, or has no header.
    """
    findings: list[Finding] = []
    try:
        if path.suffix.lower() == ".parquet":
            check_parquet(path)
            table = pd.read_parquet(path)
        else:
            table, findings = _read_text(path)
    except InputError:
        raise
    except (*READ_ERRORS, pd.errors.ParserWarning, pa.ArrowException) as error:
        reason = short_reason(error)
        raise InputError(f"Expected a table. Received: {path.name}, which cannot be read ({reason}). Save it again.") from None
    if not isinstance(table.index, pd.RangeIndex) and (any(table.index.names) or _holds_dates(table.index.to_series())):
        table = table.reset_index()  # what it is indexed by is a column like the others
    if table.columns.nlevels > 1:
        raise InputError(f"Expected one line of column names. Received: {table.columns.nlevels} levels in {path.name}. Join them.")
    table.columns = [str(name).strip() for name in table.columns]
    if len(table.columns) == 0:
        raise InputError(f"Expected a table with columns. Received: none in {path.name}. Give a table that holds a series.")
    return table, findings


def _read_text(path: Path) -> tuple[pd.DataFrame, list[Finding]]:
    findings = []
    content = path.read_bytes()
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"  # with or without a byte order mark
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        if b"\x00" in content:
            raise ValueError("it is no text") from None
        text, encoding = content.decode("latin-1"), "Latin-1"
        findings.append(Finding("encoding", 1, "the text is not UTF-8 and was read as Latin-1"))
    if "\x00" in text or not text.strip():
        raise ValueError("it is no text" if text.strip() else "it is empty")
    lines = text[:_HEAD].split("\n")
    comments = next((number for number, line in enumerate(lines) if line.strip() and not line.startswith("#")), len(lines))
    if comments == len(lines):
        raise ValueError("it is empty")
    if any(line.strip() for line in lines[:comments]):
        findings.append(Finding("header lines", comments, f"lines before the header, skipped: {comments:,}"))
    separator = _separator(lines[comments : comments + 3])
    if lines[comments].count(separator) >= MAX_COLUMNS:
        raise ValueError(f"more than {MAX_COLUMNS:,} columns")
    options = {"sep": separator, "skiprows": comments, "index_col": False, "skip_blank_lines": False, "low_memory": False}
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # lines longer than the header would lose their ends
        names = pd.read_csv(io.StringIO(text), header=None, nrows=1, dtype=str, keep_default_na=False, **options).iloc[0].str.strip()
        table = pd.read_csv(io.StringIO(text), **options)
    if not parse_numbers(names, path.name, drop=True)[1].any():
        raise InputError(
            f"Expected a header line with the columns' names. Received: {', '.join(names[:4])} in {path.name}. Add a line of names on top."
        )
    unnamed = [f"column {number}" if name == "" else name for number, name in enumerate(names)]
    table.columns = unnamed  # as they stand in the file: pandas makes names that stand twice differ
    return table, findings


def _separator(lines: list[str]) -> str:
    """The separator that the first lines have equally often, and most often."""
    counts = {mark: {line.count(mark) for line in lines if line.strip()} for mark in _SEPARATORS}
    equal = {mark: min(count) for mark, count in counts.items() if len(count) == 1}
    best = max(equal, key=equal.get, default=",")
    if equal.get(best, 0) > 0:
        return best
    return max(_SEPARATORS, key=lines[0].count) if any(mark in lines[0] for mark in _SEPARATORS) else ","


def time_column(table: pd.DataFrame, what: str) -> str | None:
    """Name of the column that holds times, or None.

    Args:
        table: The table.
        what: Where it comes from, for the message.

    Raises:
        InputError: If several columns hold times.
    """
    dates = [name for number, name in enumerate(table.columns) if _holds_dates(table.iloc[:, number])]
    named = [name for name in table.columns if name.casefold() in _TIME_NAMES]
    among = [name for name in dates if name in named] or dates or named
    if len(among) > 1:
        raise InputError(f"Expected one time column. Received: {', '.join(among[:4])} in {what}. Name it, or {NO_TIME!r} to count samples.")
    for name in set(named) - set(among):
        if among and is_text(table[name]) and table[name].iloc[:_LOOK].astype(str).str.match(r"\d{1,2}:\d\d").any():
            raise InputError(
                f"Expected one time column. Received: the date in {among[0]!r}, the time of day in {name!r} of {what}. Join them into one column."
            )
    return among[0] if among else None


def _holds_dates(values: pd.Series) -> bool:
    if pd.api.types.is_datetime64_any_dtype(values.dtype):
        return True
    if not is_text(values):
        return False
    cells = values.astype(object)
    given = cells[~is_missing(cells)].iloc[:_LOOK]
    if not len(given) or not parse_numbers(given, "", drop=True)[1].all():  # a number is no date
        return False
    return bool(pd.to_datetime(given.astype(str), format="ISO8601", utc=True, errors="coerce").notna().mean() > 0.5)


def numeric_columns(table: pd.DataFrame) -> tuple[list[str], list[str]]:
    """Columns that hold numbers, be it as text and among other words, and the names of the others."""
    numeric, others = [], []
    for name in table.columns:
        values = table[name]
        if is_text(values):
            cells = values.astype(object)
            parsed, _, _ = parse_numbers(cells[~is_missing(cells)].iloc[:_LOOK], str(name), drop=True)
            is_number = bool(np.isfinite(parsed).any())
        elif name == "column 0" and np.array_equal(values, np.arange(len(values))):
            is_number = False  # the row numbers that pandas writes without a name
        else:
            is_number = pd.api.types.is_numeric_dtype(values.dtype) and not pd.api.types.is_bool_dtype(values.dtype)
        (numeric if is_number else others).append(name)
    return numeric, others
