"""The kinds of files that hold tables: one function that reads each, and one line in `READERS`.

A reader takes the content of a file, its name and the options of reading, and returns a `Table`. To
add a kind of file, write a reader and add its line.
"""

import dataclasses
import io
import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import reading
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding
from enhsim_tf.telemetry.reading.dialect import find_dialect
from enhsim_tf.telemetry.reading.text_files import Table, read_text, table_of

_HDF5 = b"\x89HDF\r\n\x1a\n"
_MATLAB = b"MATLAB 7.3"
_OF_JSON = (
    "the list inside alone; of Prometheus, pandas.DataFrame(json.load(open(file))['data']['result']"
    "[0]['values'], columns=['time', 'value'], dtype=float)"
)
# texts of other forms by how they begin: what they are, and what to give instead
_FOREIGN = {
    rb"Linux \S+ \(": (
        "the text of sar, iostat or pidstat",
        "of sar the output of sadf -d; of others their table alone, with a column of times",
    ),
    rb"\(\d+\.\d+\) \S+ +[\dA-Fa-f]+#|date \w{3} .*\r?\nbase (?:hex|dec)|;\$FILEVERSION": (
        "frames of a CAN bus",
        "their signals, which cantools or asammdf decode with the DBC file of the bus",
    ),
    rb"(?:#.*\n)*[-+.\deE]+[ \t]+\(+[-+.\deE]+ [-+.\deE() \t]*\)\s*\n": (
        "vectors in brackets",
        "the same numbers without brackets",
    ),
    rb"(?i)\s*<(?:\?xml|!doctype|html|svg)[\s>]": (
        "XML or HTML",
        "the table that pandas.read_xml or pandas.read_html returns, as a DataFrame",
    ),
    rb"Program Version,EnergyPlus": ("records of EnergyPlus", "the CSV that ReadVarsESO writes"),
    rb"\d\d:\d\d:\d\d\.\d+ -> ": (
        "a log of a serial monitor",
        "the lines with a comma instead of ' -> ', only numbers behind it and names on top",
    ),
}
# attributes of the conventions for climate and forecast by which values are to be converted
_PACKED = {"scale_factor": 1, "add_offset": 0}
_SINCE_1970 = re.compile(
    r"(?:s|secs?|seconds?) since 1970-0?1-0?1(?:[T ]0?0:00(?::00(?:\.0*)?)?)?(?: ?(?:Z|UTC))?",
    re.IGNORECASE,
).fullmatch
_FEWEST_ROWS = 3  # with numbers, below which a sheet is no telemetry


def read_parquet(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads a Parquet file."""
    with reading(name, pa.ArrowException):
        return Table(pd.read_parquet(io.BytesIO(content)))


def read_json(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads JSON lines, one record each, one list of records, or columns as lists; what is inside
    of others is named `outer.inner`.
    """
    with reading(name):
        text = content.decode("utf-8-sig").strip()
        findings: list[Finding] = []
        try:
            records, is_whole = [json.loads(text)], True
        except json.JSONDecodeError:
            if text.startswith("["):
                raise
            records, is_whole = _lines_of(text, content.endswith(b"\n"), findings), False
    if len(records) == 1 and isinstance(records[0], dict):
        if _holds_columns(records[0]):
            return Table(pd.DataFrame(records[0]))
        with reading(name):
            lists = _lists_of(records[0])
        if lists:
            zone = str(records[0].get("timezone", ""))
            return dataclasses.replace(_of_arrays(lists, name, options), above=zone)
        names = ", ".join(records[0])
        raise InputError(
            f"Expected records, one in each line, or a list of them. Received: one record in "
            f"{name}, of {names:.80}.",
            otherwise=_OF_JSON,
        )
    if options.table is not None:
        raise InputError(
            "Expected table (--table) with lists inside of one record. Received: a table of "
            f"records, {name}. Leave it out."
        )
    with reading(name):
        frame = _frame_of(records[0] if is_whole else records)
    return Table(frame, findings=tuple(findings))


def _holds_columns(record: Mapping[str, Any]) -> bool:
    """Whether a record holds columns by their names, as pandas writes a table: values by row."""
    columns = list(record.values())
    rows = columns[0] if columns and isinstance(columns[0], dict) else {}
    return (
        len(rows) >= _FEWEST_ROWS
        and all(isinstance(column, dict) and column.keys() == rows.keys() for column in columns)
        and all(row.lstrip("-").isdigit() for row in rows)
    )


def _lines_of(text: str, is_ended: bool, findings: list[Finding]) -> list[Any]:
    """Returns the values of JSON lines, of which the last may be cut off if it does not end."""
    lines = [line for line in text.splitlines() if line.strip()]
    values = [json.loads(line) for line in lines[:-1]]
    try:
        values += [json.loads(line) for line in lines[-1:]]
    except json.JSONDecodeError:
        if not values or is_ended:
            raise
        findings.append(Finding("ragged lines", 1, "the last line is cut off and left out"))
    return values


def _frame_of(records: Sequence[Any]) -> pd.DataFrame:
    """Makes a table of records, or of lists of one length, of which the first may hold names."""
    if not isinstance(records, list):
        raise ValueError("neither records nor lists")
    if not records or not all(isinstance(record, list) for record in records):
        return pd.json_normalize(records)
    if len(lengths := {len(record) for record in records}) > 1:
        raise ValueError(f"lists of {min(lengths)} to {max(lengths)} values")
    refuse_channels_first((len(records), len(records[0])), "the lists")
    if all(isinstance(cell, str) and not re.match(r"\s*[+-]?\.?\d", cell) for cell in records[0]):
        return pd.DataFrame(records[1:], columns=records[0])
    return pd.DataFrame(records).rename(columns="column {}".format)


def _lists_of(record: Mapping[str, Any], group: str = "") -> dict[tuple[str, str], np.ndarray]:
    """Returns the lists inside of a record, and the columns of its lists of records and of lists,
    by the name of what holds them and their own.
    """
    lists: dict[tuple[str, str], np.ndarray] = {}
    for key, value in record.items():
        inside = f"{group}.{key}".strip(".")
        if isinstance(value, dict):
            lists |= _lists_of(value, inside)
        elif isinstance(value, list) and (named := _named_lists(value)):
            lists |= {(group, f"{key}.{name}"): column for name, column in named.items()}
        elif isinstance(value, list) and value:
            is_records = isinstance(value[0], dict)
            frame = pd.json_normalize(value) if is_records else pd.DataFrame(value)
            cells = frame[[column for column in frame if frame[column].dtype == object]]
            if cells.map(lambda cell: isinstance(cell, list | dict)).any(axis=None):
                continue
            if frame.shape[1] >= 10 * len(frame) > 10:  # which is refused as channels first
                lists[group, key] = frame.to_numpy()
                continue
            for name, column in frame.items():
                names = (group, key if frame.shape[1] == 1 else f"{key}.{name}")
                lists[(inside, name) if is_records else names] = column.to_numpy()
    return lists


def _named_lists(records: Sequence[Any]) -> dict[str, np.ndarray]:
    """Returns the lists of records of a name and one list each, as charts hold their series, by
    these names; none of other records.
    """
    named: dict[str, np.ndarray] = {}
    for record in records:
        if not isinstance(record, dict):
            return {}
        lists = [value for value in record.values() if isinstance(value, list)]
        name = record.get("name", record.get("label"))
        if len(lists) != 1 or not isinstance(name, str) or name in named:
            return {}
        # a list that is shorter than that of the records is one of tags or coordinates
        is_long = len(lists[0]) > max(2, len(records))
        if not is_long or any(isinstance(value, list | dict) for value in lists[0]):
            return {}
        named[name] = pd.Series(lists[0]).to_numpy()
    return named


def read_excel(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads a sheet of a workbook, with the same search for its header as in text."""
    try:
        import openpyxl
    except ImportError:
        raise InputError(
            f"Expected the package openpyxl for {name}. Received: none. Install it, or save the "
            "sheet as CSV."
        ) from None
    with reading(name):
        book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        sheets = {
            sheet.title: [list(row) for row in sheet.iter_rows(values_only=True)]
            for sheet in book.worksheets
        }
    usable = {title: rows for title, rows in sheets.items() if _num_numeric(rows) >= _FEWEST_ROWS}
    first, *others = sheets
    findings = []
    if options.table is None and (first in usable or not usable):
        title = first
        if others:
            text = f"only the first sheet was read: {first}"
            others = [title for title in others if title in usable]
            text += f"; give --table for another: {', '.join(others)}" if others else ""
            findings.append(Finding("files", 1, text))
    else:
        received = f"no numbers in the first sheet of {name}, {first}"
        title = chosen_table(usable if options.table is None else sheets, name, options, received)
    rows = sheets[title][options.skip_rows :]
    width = max(
        (place + 1 for row in rows for place, cell in enumerate(row) if cell is not None), default=0
    )
    frame = pd.DataFrame([row[:width] for row in rows], dtype=object)
    head = frame.head(100).replace(r"\s", " ", regex=True)
    text = head.to_csv(sep="\t", header=False, index=False)
    with reading(name):
        dialect = find_dialect(text, name, options, "\t")
    frame = frame.iloc[dialect.first_line :].reset_index(drop=True).infer_objects()
    return table_of(frame, dialect, None, findings)


def _num_numeric(rows: Sequence[Sequence[Any]]) -> int:
    """Returns the number of rows that hold a number."""
    return sum(
        any(isinstance(cell, int | float) and not isinstance(cell, bool) for cell in row)
        for row in rows
    )


def read_matlab(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads a MATLAB file: its vectors and matrices, or one of its structs."""
    if content.startswith(_MATLAB):
        return read_hdf5(content, name, options)
    import scipy.io

    with reading(name, scipy.io.matlab.MatReadError):
        variables = scipy.io.loadmat(io.BytesIO(content), simplify_cells=True)
    arrays = {}
    for key, value in variables.items():
        if isinstance(value, dict):
            arrays |= _fields_of(value, key)
        elif not key.startswith("__"):
            arrays["", key] = np.asarray(value)
    return _of_arrays(arrays, name, options)


def _fields_of(
    struct: Mapping[str, Any], group: str, outside: Collection[int] = ()
) -> dict[tuple[str, str], np.ndarray]:
    """Returns the arrays of a struct and of the structs in it, by their group and name. The signals
    of Simulink's structure with time belong to it; a struct with several arrays of a length that
    occurs nowhere outside of it, such as one of many runs, is a group of its own.
    """
    fields: dict[tuple[str, str], np.ndarray] = {}
    structs: dict[str, Mapping[str, Any]] = {}
    for key, value in struct.items():
        if isinstance(value, dict):
            structs[key] = value
        elif isinstance(value, np.ndarray | list) and all(isinstance(x, dict) for x in value):
            structs |= {f"{key}.{number}": each for number, each in enumerate(value, 1)}
        else:
            fields[group, key] = np.asarray(value)
    outside = {1, *outside, *(each.size for each in fields.values())}
    for name, each in structs.items():
        own = f"{group}.{name}"
        inside = _fields_of(each, own, outside)
        sizes = [
            values.size
            for (owner, _), values in inside.items()
            if owner == own and values.size not in outside
        ]
        if len(set(sizes)) == len(sizes):
            inside = {
                (group, f"{name}.{field}") if owner == own else (owner, field): values
                for (owner, field), values in inside.items()
            }
        fields |= inside
    return fields


def read_hdf5(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads the data sets of a group of an HDF5 file, or one of records."""
    import h5py

    arrays: dict[tuple[str, str], np.ndarray] = {}
    units: dict[str, str] = {}

    def add(path: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        parent, _, key = path.rpartition("/")
        stated = {key.casefold(): np.ravel(value) for key, value in item.attrs.items()}
        unit = next((stated[key][0] for key in ("units", "unit") if len(stated.get(key, ""))), "")
        units[path] = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
        packed = [key for key, same in _PACKED.items() if np.any(stated.get(key, same) != same)]
        if packed or re.search(r" since \d", units[path]) and not _SINCE_1970(units[path]):
            stated = f"the units {units[path]!r}" if not packed else packed[0]
            raise InputError(
                f"Expected values as they are. Received: {stated} of {path!r} in {name}.",
                (),
                "what xarray.open_dataset(file).to_dataframe() returns",
            )
        values = item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[()]
        if item.attrs.get("MATLAB_class") == b"char":
            rows = values.T if values.ndim == 2 and values.dtype == np.uint16 else ()
            texts = ["".join(map(chr, row)) for row in rows]
            if texts and re.match(r"\d+[-/.:]\d", texts[0]):  # others are names and notes
                arrays[parent, key] = np.array(texts, object)
        elif values.dtype.names:
            arrays.update({(path, field): values[field] for field in values.dtype.names})
        else:  # MATLAB's axes are in reverse order
            arrays[parent, key] = values.T if content.startswith(_MATLAB) else values

    with reading(name), h5py.File(io.BytesIO(content)) as file:
        file.visititems(add)
    return _of_arrays(arrays, name, options, units)


def _of_arrays(
    arrays: Mapping[tuple[str, str], np.ndarray],
    name: str,
    options: Cleaning,
    units: Mapping[str, str] | None = None,
) -> Table:
    """Makes a table of the arrays of one group that have one length, by their group and name;
    `units` are by both with a slash between them.
    """
    tables: dict[tuple[str, int], dict[str, Any]] = {}
    others: list[str] = []  # complex ones, and those with more dimensions
    for (group, key), values in arrays.items():
        values = np.squeeze(values)
        if values.dtype.kind == "S":
            values = np.char.decode(values, "utf-8", "replace")
        if not values.ndim or len(values) < 2:
            continue
        if values.ndim > 2 or values.dtype.kind not in "fiubUOM":
            others.append(key)
            continue
        columns = tables.setdefault((group, len(values)), {})
        if values.ndim == 1:
            columns[key] = values
        else:
            refuse_channels_first(values.shape, f"{key} of {name}")
            columns |= {f"{key}.{number}": column for number, column in enumerate(values.T)}
    if not tables:
        raise InputError(
            f"Expected vectors or matrices of numbers. Received: {', '.join(others) or 'none'} in "
            f"{name}. Save them as variables of their own, or as CSV."
        )
    groups = [group for group, _ in tables]
    firsts = [next(iter(columns)) for columns in tables.values()]
    named = {}
    for (group, _), first, columns in zip(tables, firsts, tables.values(), strict=True):
        title = first
        if group and groups.count(group) == 1:
            title = group
        elif group and firsts.count(first) > 1:
            title = f"{group}/{first}"
        named[title] = (group, columns)
    group, chosen = named[chosen_table(named, name, options)]
    frame = pd.DataFrame({key: pd.Series(values) for key, values in chosen.items()})
    stated = {key: (units or {}).get(f"{group}/{key}".strip("/"), "") for key in frame}
    text = f"arrays that are neither vectors nor matrices of real numbers: {', '.join(others[:8])}"
    findings = (Finding("columns left out", len(others), text),) if others else ()
    return Table(frame, findings=findings, units=stated)


def refuse_channels_first(shape: tuple[int, int], what: str) -> None:
    """Refuses a matrix that seems to have a channel in each row."""
    rows, columns = shape
    if rows <= 64 and columns >= 10 * rows and columns >= 100:
        raise InputError(
            f"Expected samples in rows, channels in columns. Received: shape {shape} in "
            f"{what}, which seems to have channels first. Save it transposed (array.T)."
        )


def chosen_table(
    tables: Mapping[str, Any], name: str, options: Cleaning, received: str = ""
) -> str:
    """Returns the name of the table that is asked for, or of the only one, unless `received` says
    why that must be asked for.
    """
    if options.table in tables:
        return options.table
    if options.table is not None:
        received = repr(options.table)
    elif not received and len(tables) == 1:
        return next(iter(tables))
    received = received or f"{len(tables)} in {name}"
    raise InputError(
        f"Expected one table. Received: {received}.", [{"table": each} for each in tables]
    )


READERS: dict[str, Callable[[bytes, str, Cleaning], Table]] = {
    ".parquet": read_parquet,
    ".xlsx": read_excel,
    ".xlsm": read_excel,
    ".mat": read_matlab,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".jsonl": read_json,
    ".ndjson": read_json,
    ".json": read_json,
}
"""The readers by the endings of files; those of all others are text."""
HAS_TABLES = (".xlsx", ".xlsm", ".mat", ".h5", ".hdf5", ".json")
"""Endings of files that may hold several tables."""
CONVERT = {
    ".mf4": "asammdf",
    ".mdf": "asammdf",
    ".tdms": "npTDMS",
    ".ulg": "pyulog",
    ".bag": "rosbags",
    ".nc": "xarray",
    ".bz2": "bzip2 -d",
    ".xz": "xz -d",
    ".tar": "tar",
    ".tgz": "tar",
    ".xls": "a spreadsheet program, as .xlsx",
    ".npz": "numpy.load, as .npy",
}
"""What reads files that are not read here."""


def read_any_text(content: bytes, name: str, options: Cleaning) -> Table:
    """Reads text, and refuses other content with a line that says how to convert it."""
    for pattern, (form, otherwise) in _FOREIGN.items():
        if re.match(pattern, content):
            raise InputError(f"Expected a table. Received: {form}, {name}.", (), otherwise)
    try:
        return read_text(content, name, options)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        ending = "." + name.rpartition(".")[2].lower()
        tool = CONVERT.get(ending, "the program that wrote it")
        raise InputError(
            f"Expected a table. Received: {name}, which cannot be read ({error}). Convert it with "
            f"{tool}, to CSV or a DataFrame, or save it again."
        ) from None
