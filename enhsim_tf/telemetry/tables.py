"""Reads tables, as CSV in common dialects or Parquet, and finds their time column and numeric columns.

Every line of a text file is a row. Blank lines are kept as missing values, and a line that does not match the header is an error.
"""

import io
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import MAX_COLUMNS, READ_ERRORS, check_parquet, short_reason
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.cleaning.numbers import is_missing, is_text, parse_numbers
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.cleaning.times import parse_times

NO_TIME = "none"  # instead of the name of a time column: the table has no times, and samples are counted
_TIME_NAMES = ("time", "times", "timestamp", "datetime", "date", "date_time", "utc", "_time", "t", "epoch", "time_s", "time_ms")
_SEPARATORS = ";\t|,"  # the comma comes last because it may be a decimal separator
_HEAD = 100_000  # number of characters that are searched for the header
_LOOK = 200  # number of rows that are inspected to infer what a text column holds


def read_table(path: Path) -> tuple[pd.DataFrame, list[Finding]]:
    """Reads a table.

    Args:
        path: A `.parquet` file, or a text file with a header line.

    Returns:
        The table, whose column names are text, and findings for the cleaning log.

    Raises:
        InputError: If the table cannot be read or has no header.
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
        table = table.reset_index()  # the index becomes an ordinary column
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
            raise ValueError("it is not text") from None
        text, encoding = content.decode("latin-1"), "Latin-1"
        findings.append(Finding("encoding", 1, "the text is not UTF-8 and was read as Latin-1"))
    if "\x00" in text or not text.strip():
        raise ValueError("it is not text" if text.strip() else "it is empty")
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
        warnings.simplefilter("error", pd.errors.ParserWarning)  # otherwise lines longer than the header are cut
        names = pd.read_csv(io.StringIO(text), header=None, nrows=1, dtype=str, keep_default_na=False, **options).iloc[0].str.strip()
        table = pd.read_csv(io.StringIO(text), **options)
    if not parse_numbers(names, path.name, drop=True)[1].any():
        raise InputError(
            f"Expected a header line with the columns' names. Received: {', '.join(names[:4])} in {path.name}. Add a line of names on top."
        )
    unnamed = [f"column {number}" if name == "" else name for number, name in enumerate(names)]
    table.columns = unnamed  # the names of the file, since pandas renames repeated ones
    return table, findings


def _separator(lines: list[str]) -> str:
    """The separator that occurs equally often in each of the first lines, and most often among such separators."""
    counts = {mark: {line.count(mark) for line in lines if line.strip()} for mark in _SEPARATORS}
    equal = {mark: min(count) for mark, count in counts.items() if len(count) == 1}
    best = max(equal, key=equal.get, default=",")
    if equal.get(best, 0) > 0:
        return best
    return max(_SEPARATORS, key=lines[0].count) if any(mark in lines[0] for mark in _SEPARATORS) else ","


def time_column(table: pd.DataFrame, what: str) -> str | None:
    """Finds the column that holds times.

    Args:
        table: The table.
        what: Description of the source, for messages.

    Returns:
        Name of the column, or None if there is none.

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
    if not len(given) or not parse_numbers(given, "", drop=True)[1].all():  # a column with numbers is not a date column
        return False
    return bool(pd.to_datetime(given.astype(str), format="ISO8601", utc=True, errors="coerce").notna().mean() > 0.5)


def numeric_columns(table: pd.DataFrame) -> tuple[list[str], list[str]]:
    """Splits the columns of a table into numeric and other columns. Text columns that hold at least some numbers are numeric.

    Args:
        table: The table.

    Returns:
        Names of the numeric columns, and names of the others.
    """
    numeric, others = [], []
    for name in table.columns:
        values = table[name]
        if is_text(values):
            cells = values.astype(object)
            parsed, _, _ = parse_numbers(cells[~is_missing(cells)].iloc[:_LOOK], str(name), drop=True)
            is_number = bool(np.isfinite(parsed).any())
        elif name == "column 0" and np.array_equal(values, np.arange(len(values))):
            is_number = False  # unnamed row numbers, as pandas writes them
        else:
            is_number = pd.api.types.is_numeric_dtype(values.dtype) and not pd.api.types.is_bool_dtype(values.dtype)
        (numeric if is_number else others).append(name)
    return numeric, others


def read_table_channels(path: Path, columns: list[str] | None, time: str | None, options: Cleaning) -> dict[str, pd.Series]:
    """Reads columns of a table with their times; see `sources.read_source`, which calls it."""
    table, findings = read_table(path)
    repeated = set(table.columns[table.columns.duplicated()])
    for name in [*(columns or ()), *([time] if time not in (None, NO_TIME) else [])]:
        if name in repeated:
            raise InputError(f"Expected columns of different names. Received: {name!r} more than once in {path.name}. Rename them.")
        if name not in table.columns:
            known = ", ".join(table.columns[:8])
            raise InputError(f"Expected a column of {path.name}: {known}. Received: {name!r}. Name one of these.")
    if columns is None and repeated:
        raise InputError(f"Expected columns of different names. Received: {min(repeated)!r} more than once in {path.name}. Rename them.")
    found = time_column(table, path.name) if time is None else time
    if time is None and found is not None:
        findings.append(Finding("time column", 1, f"the time column is {found!r}"))
    index = pd.RangeIndex(len(table))
    if found not in (None, NO_TIME):
        what = f"the times {found!r} of {path.name}"
        stamps, bad, noted = parse_times(table[found], what, options.on_bad_times == "drop", options.time_unit, options.time_format)
        if bad.any():
            rows = tuple(f"row {row}" for row in np.flatnonzero(bad)[:3])
            noted = [*noted, Finding("bad times", int(bad.sum()), f"times that cannot be read, taken as missing: {int(bad.sum()):,}", rows)]
        index, findings = stamps.rename(str(found)), [*findings, *noted]
    if columns is None:
        columns, others = numeric_columns(table.drop(columns=[found] if found in table.columns else []))
        if others:
            findings.append(Finding("columns left out", len(others), f"columns without numbers: {', '.join(others[:8])}"))
        if not columns:
            raise InputError(f"Expected a column of numbers. Received: none in {path.name} beside the times. Give another table.")
    channels = {}
    for column in columns:
        channels[column] = pd.Series(table[column].array, index=index, name=column, copy=False)
        channels[column].attrs["findings"] = [finding.to_dict() for finding in findings]
    return channels
