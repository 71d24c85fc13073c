"""Finds out how a text file is written: its encoding, separator, and the line that holds the columns' names."""

import csv
import dataclasses
import re
from collections.abc import Sequence

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.report import Finding

BLANKS = r"\s+"  # the separator of files whose columns stand apart by blanks
_SEPARATORS = ";\t|,"  # the comma comes last because it may be a decimal sign
_HEAD_LINES, _HEAD = 120, 4_000_000  # lines and characters that are inspected
_LOOK = 50  # columns that are inspected
_NUMBER = r"(?:[+-] *)?(?:\d[\d.,'\u2019 \u00a0\u202f]*|[.,]\d+)(?:[de][+-]?\d+)?(?: ?(?:[num\u00b5]?s|sec|min|h|hr|days?|%))?"
_DATE = r"\d{1,4}[-/.: ]\d.*|\d{8}T.*|\d{1,2}[-/ ][a-z]{3}.*|(?:[a-z]{3}, )?\d{1,2} [a-z]{3} .*|[a-z]{3}\.? +\d{1,2},? +\d.*"
_SOLID = re.compile(f"(?:{_NUMBER}|{_DATE}|[+-]?inf(?:inity)?)$", re.IGNORECASE)


@dataclasses.dataclass(frozen=True)
class Dialect:
    """How a text file is written."""

    separator: str
    names: list[str]  # of the columns; one without a name is called by its number
    first_line: int  # at which the data begin, counted from 0
    skipped: int  # number of lines before the data that are neither names nor blank
    head: list[list[str]]  # cells of the first rows of data
    units: Sequence[str] = ()  # cells of the line between the names and the data, where units stand


def decode(content: bytes) -> tuple[str, list[Finding]]:
    """Decodes the content of a text file, and returns findings for the cleaning log; raises a `ValueError` if it is not text."""
    findings = []
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = content.decode("utf-16")
    else:
        whole = content.rstrip(b"\x00")
        if len(whole) < len(content):
            text = f"NUL bytes at the end, as after a power failure: {len(content) - len(whole):,}"
            findings.append(Finding("padding", len(content) - len(whole), text))
        try:
            text = whole.decode("utf-8-sig")  # with or without a byte order mark
        except UnicodeDecodeError:
            text = whole.decode("cp1252", "replace")
            findings.append(
                Finding("encoding", 1, "the text is not UTF-8 and was read as Windows-1252")
            )
    if "\x00" in text:
        raise ValueError("it is not text")
    if "\r" in text and "\n" not in text:
        text = text.replace("\r", "\n")
    if not text or text.isspace():
        raise ValueError("it is empty")
    return text, findings


def find_dialect(text: str, name: str, no_header: bool, separator: str | None = None) -> Dialect:
    """Finds the separator, if it is not known, the names and the beginning of the data, from the first part of a text.

    Raises:
        InputError: If there is no line of names above the data, and `no_header` is False.
        ValueError: If there is nothing but comments.
    """
    lines = [line.rstrip("\r") for line in text[:_HEAD].split("\n", _HEAD_LINES)[:_HEAD_LINES]]
    if stated := re.fullmatch(
        r'"?sep=(.)"?', lines[0].strip(" \ufeff")
    ):  # as spreadsheets write it
        lines[0], separator = "", stated[1]
    if not any(map(_is_content, lines)):
        raise ValueError("it is empty")
    layouts = [_lay_out(mark, _split(lines, mark), no_header) for mark in separator or _SEPARATORS]
    if not any(each and len(each.names) > 1 for each in layouts):
        layouts = [
            _lay_out(
                BLANKS, [line.split() if _is_content(line) else [] for line in lines], no_header
            )
        ]
    found = [each for each in layouts if each and len(each.names) > 1]
    if not found or found[0].separator == BLANKS:
        single = _lay_out(
            ",", [[line.strip()] if _is_content(line) else [] for line in lines], no_header
        )
        found += [single] if single else []
    with_header = [each for each in found if any(each.names)]
    best = max(
        with_header or found, key=lambda each: len(each.names) if with_header else 0, default=None
    )
    if best is None:
        raise ValueError("lines of different lengths")
    if not with_header and not no_header:
        best = _named_by_comment(best, lines)
        if best is None:
            raise InputError(
                f"Expected a header line with the columns' names. Received: {', '.join(found[0].head[0][:4]) if found[0].head else 'none'} "
                f"in {name}. Add a line of names on top, or give no_header=True (--no-header)."
            )
    return dataclasses.replace(
        best, names=[each or f"column {number}" for number, each in enumerate(best.names)]
    )


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(("#", "%"))


def _split(lines: Sequence[str], mark: str) -> list[list[str]]:
    """Splits lines into cells; comments and blank lines have none."""
    rows = []
    for line in lines:
        cells = (
            next(
                csv.reader(
                    [line.replace("\r", " ")], delimiter=mark, skipinitialspace=mark != "\t"
                ),
                [],
            )
            if _is_content(line)
            else []
        )
        rows.append([cell.strip() for cell in cells])
    return rows


def _lay_out(mark: str, rows: list[list[str]], no_header: bool) -> Dialect | None:
    """Finds names and data among the first rows, or None if the rows have no common number of cells."""
    filled = [row for row in rows if row]
    last = filled[len(filled) // 2 :]
    widths = [len(row) for row in last]
    width = max(set(widths), key=lambda each: (widths.count(each), each))
    if widths.count(width) < 0.6 * len(widths):
        return None
    sample = [row for row in last if len(row) == width]
    counts = [str(number) for number in range(width)]
    solid = [place for place in range(min(width, _LOOK)) if _is_solid(sample, place)]

    def share(row: list[str]) -> float:
        """Share of the columns of numbers and dates that hold one in this row, none if its cells are names that count, as in `,0,1`."""
        if (
            len(row) > 1
            and row[1:] in (counts[: len(row) - 1], counts[1 : len(row)])
            and not _SOLID.match(row[0])
        ):
            return 0.0
        return sum(place < len(row) and bool(_SOLID.match(row[place])) for place in solid) / max(
            1, len(solid)
        )

    begin = next(
        (number for number, row in enumerate(rows) if len(row) == width and share(row) > 0.5), None
    )
    if begin is None:  # words only
        begin = next(number for number, row in enumerate(rows) if row) + (not no_header)
    while begin > 0 and len(rows[begin - 1]) == width and share(rows[begin - 1]) > 0:
        begin -= 1
    if (
        begin > 0 and len(rows[begin - 1]) == width + 1 and share(rows[begin - 1]) == 0
    ):  # of a last column that is mostly left out
        width += 1
    block = next(
        (number for number in range(begin, 0, -1) if rows[number - 1]), 0
    )  # a blank line may follow the names
    block = block if block and len(rows[block - 1]) == width else begin
    top = block
    while (
        block > 0
        and rows[block - 1]
        and len(rows[block - 1]) <= width
        and (share(rows[block - 1]) == 0 or len(rows) == 1)
    ):
        block -= 1
    names, units, skipped = [""] * width, [], sum(bool(row) for row in rows[:begin])
    if block < top and not no_header:
        header = max(
            range(block, top),
            key=lambda number: (len({cell for cell in rows[number] if cell}), -number),
        )
        given = rows[header]
        if (
            mark == BLANKS and 1 < len(given) == width - 1 and ":" in rows[begin][1]
        ):  # a date and a time of day below one name
            given = ["", *given]
        short = width - len(given)
        if short and any(row[len(given) :] != [""] * short for row in sample):
            return None
        names, skipped = [*given, *[""] * short], skipped - 1
        if not any(names):
            return None
        others = [rows[number] for number in range(block, top) if number != header]
        for place in [
            place for place, name in enumerate(names) if not name
        ]:  # names in two lines, as under merged cells
            names[place] = next(
                (row[place] for row in others if place < len(row) and row[place]), ""
            )
        units = rows[header + 1] if header + 1 < top else []
    elif block < top and no_header:
        begin, skipped = block, sum(bool(row) for row in rows[:block])
    return Dialect(mark, names, begin, skipped, [row for row in rows[begin:] if row], units)


def _is_solid(sample: Sequence[Sequence[str]], place: int) -> bool:
    """Whether a column holds numbers or dates in most of the rows in which it holds anything."""
    cells = [row[place] for row in sample if row[place]]
    return bool(cells) and 2 * sum(bool(_SOLID.match(cell)) for cell in cells) > len(cells)


def _named_by_comment(found: Dialect, lines: Sequence[str]) -> Dialect | None:
    """Returns the dialect with names from the last comment above the data, as NumPy writes them, or None if it has not as many.

    If that repeats a name, it holds units, as in files of weather buoys, and the comment before it the names.
    """
    comments = [
        line.lstrip("#%").strip()
        for line in lines[: found.first_line]
        if line.startswith(("#", "%"))
    ]
    if not comments:
        return None
    mark = re.escape(found.separator)
    if found.separator == BLANKS:
        mark = BLANKS if len(comments[-1].split()) == len(found.names) else r"\s{2,}|\t"
    *before, names = (
        [name.strip() for name in re.split(mark, comment)] for comment in comments[-2:]
    )
    if before and len(before[0]) == len(names) == len(set(before[0])) > len(set(names)):
        found, names = dataclasses.replace(found, units=names), before[0]
    if (
        len(names) != len(found.names)
        or not all(names[1:])
        or all(_SOLID.match(name) for name in names)
    ):
        return None
    return dataclasses.replace(found, names=names)
