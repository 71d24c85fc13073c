"""Finds out how a text file is written: its encoding, separator, and the line that holds the
columns' names.
"""

import codecs
import csv
import dataclasses
import itertools
import re
from collections.abc import Sequence
from typing import NoReturn

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding

BLANKS = r"\s+"  # the separator of files whose columns stand apart by blanks
_WHOLE = ""  # the separator of files of one column
_SEPARATORS = ";\t|,"  # the comma comes last because it may be a decimal sign
# lines and characters that are inspected
_HEAD_LINES = 300
HEAD = 4_000_000
_LOOK = 50  # columns that are inspected
_FEWEST_ROWS = 10  # with numbers above the names, below which they are no table without its own
csv.field_size_limit(HEAD)  # with another separator than its own, a line is one cell
_NUMBER = (
    r"(?:[+-] *)?(?:\d[\d.,'\u2019 \u00a0\u202f]*|[.,]\d+)(?:[de][+-]?\d+)?"
    r"(?: ?(?:[num\u00b5]?s|sec|min|h|hr|days?|%))?"
)
_DATE = (
    r"\d{1,4}[-/.: ]\d.*|\d{8}T.*|\d{1,2}[-/ ][a-z]{3}.*|"
    r"(?:[a-z]{3}, )?\d{1,2} [a-z]{3} .*|[a-z]{3}\.? +\d{1,2},? +\d.*"
)
_PLAIN = re.compile(r"\d+(?:\.\d+)?").fullmatch
_FORMAT = re.compile(r"\d+[sdn]").fullmatch
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
    may_lack_last: bool = False  # whether rows may leave out the last cell
    above: Sequence[str] = ()  # the lines above the data
    file: str = ""  # its name
    line: int = 1  # of the file, at which the data begin


def utf8_of(content: bytes) -> tuple[bytes, list[Finding]]:
    """Returns the content of a text file in UTF-8 with lines that end with a line feed, and
    findings for the cleaning log; raises a `ValueError` if it is not text.
    """
    findings = []
    if content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        text = content.decode("utf-16").encode()
    else:
        text = content.rstrip(b"\x00")
        if len(text) < len(content):
            cut = f"NUL bytes at the end, as after a power failure: {len(content) - len(text):,}"
            findings.append(Finding("padding", len(content) - len(text), cut))
        text = text.removeprefix(codecs.BOM_UTF8)
        try:
            if not text.isascii():
                text.decode()
        except UnicodeDecodeError:
            text = text.decode("cp1252", "replace").encode()
            findings.append(
                Finding("encoding", 1, "the text is not UTF-8 and was read as Windows-1252")
            )
    if b"\x00" in text:
        raise ValueError("it is not text")
    if b"\r" in text and b"\n" not in text:
        text = text.replace(b"\r", b"\n")
    if not text or text.isspace():
        raise ValueError("it is empty")
    return text, findings


def line_start(text: bytes, lines: int) -> int:
    """Returns how many bytes the first lines of a text have."""
    begin = 0
    for _ in range(lines):
        begin = text.find(b"\n", begin) + 1
        if not begin:
            return len(text)
    return begin


def find_dialect(text: str, name: str, options: Cleaning, separator: str | None = None) -> Dialect:
    """Finds the separator, if it is not known, the names and the beginning of the data, from the
    first part of a text, behind the rows that `options` skip.

    Raises:
        InputError: If there is no line of names above the data, and the options do not say so, or
            if another table stands above it.
        ValueError: If there is nothing but comments.
    """
    lines = [line.rstrip("\r") for line in text[:HEAD].split("\n", _HEAD_LINES)[:_HEAD_LINES]]
    # as spreadsheets write it
    if stated := re.fullmatch(r'"?sep=(.)"?', lines[0].strip(" \ufeff")):
        lines[0] = ""
        separator = stated[1]
    if not any(map(_is_content, lines)):
        raise ValueError("it is empty")
    marks = [mark for mark in separator or _SEPARATORS if any(mark in line for line in lines)]
    layouts = [_lay_out(mark, lines, options.no_header) for mark in marks]
    found = [layout for layout in layouts if layout and len(layout.names) > 1]
    if not found:
        by_blanks, single = (_lay_out(mark, lines, options.no_header) for mark in (BLANKS, _WHOLE))
        has_blanks = by_blanks is not None and len(by_blanks.names) > 1
        for layout in layouts:  # with too few names; decimal commas may seem to be separators
            if layout and not (layout.names or has_blanks and layout.separator == ","):
                _refuse_header(layout, name)
        if not has_blanks:
            _refuse_below_text(lines, name)
        found = [by_blanks if has_blanks else single]
    if found == [None]:
        raise ValueError("lines of different lengths")
    others = {layout.separator for layout in found} - {","}
    # cells between decimal commas hold the separator
    with_header = [
        layout
        for layout in found
        if any(layout.names)
        and (layout.separator != "," or others.isdisjoint("".join(sum(layout.head[:1], []))))
    ]
    best = max(with_header, key=lambda layout: len(layout.names), default=found[0])
    if not with_header and not options.no_header:
        best = _named_by_comment(best)
        if best is None:
            _refuse_header(found[0], name)
    _refuse_other_table(best, name, options.skip_rows)
    return dataclasses.replace(
        best,
        names=[each or f"column {number}" for number, each in enumerate(best.names)],
        file=name,
        line=best.first_line + options.skip_rows + 1,
    )


def _refuse_below_text(lines: Sequence[str], name: str) -> None:
    """Refuses columns of numbers below several lines of text, none of which names them."""
    for mark in (*_SEPARATORS.strip(","), BLANKS):
        bare = _lay_out(mark, lines, no_header=True)
        if bare is None:
            continue
        num_above = sum(map(_is_content, bare.above))
        num_solid = sum(bool(_SOLID.match(cell)) for cell in bare.head[0])
        if num_above > 1 and num_solid > 1 and len(bare.names) == len(bare.head[0]):
            _refuse_header(bare, name)


def _refuse_header(found: Dialect, name: str) -> NoReturn:
    """Refuses data without a line of names above it, or with one of another number of names."""
    above = [number for number, line in enumerate(found.above) if _is_content(line)]
    cells = _split([found.above[above[-1]]], found.separator)[0] if above else []
    width = len(found.names) or len(found.head[0])
    marks = found.separator != BLANKS
    if marks and 1 < len(cells) != width and not any(map(_SOLID.match, cells)):
        raise InputError(
            f"Expected as many names as values. Received: {len(cells)} names in line "
            f"{above[-1] + 1} of {name}, above {width} values.",
            otherwise="a name for each column, in quotation marks if it holds a separator",
        )
    first = ", ".join(found.head[0][:4]) if found.head else "none"
    raise InputError(
        f"Expected a header line with the columns' names. Received: {first} in {name}.",
        [{"no_header": True}],
        "a line of names on top",
    )


def _refuse_other_table(found: Dialect, name: str, skip_rows: int) -> None:
    """Refuses a text in which another table stands above the one that was found."""
    rows = _split(found.above, found.separator)
    marks = [[bool(_SOLID.match(cell)) for cell in row] for row in rows]

    def is_data(row: Sequence[bool]) -> bool:
        return len(row) > 1 and 4 * sum(row) >= 3 * len(row)

    of_data = [number for number, row in enumerate(marks) if is_data(row)]
    # a line of names, and three rows of as many cells below it
    has_names = any(
        names
        and not any(names)
        and all(is_data(row) and row[0] and len(row) == len(names) for row in below)
        for names, *below in zip(marks, marks[1:], marks[2:], marks[3:], strict=False)
    )
    if has_names or len(of_data) >= _FEWEST_ROWS:
        raise InputError(
            f"Expected one table. Received: {len(of_data)} lines with numbers above the names of "
            f"another table in {name}.",
            [{"skip_rows": skip_rows + of_data[-1] + 1}],
            "each table as a file",
        )


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(("#", "%"))


def _split(lines: Sequence[str], mark: str) -> list[list[str]]:
    """Splits lines into cells; comments and blank lines have none."""
    rows = []
    for line in lines:
        cells = [line]
        if not _is_content(line):
            cells = []
        elif mark == BLANKS:
            cells = line.split()
        elif mark != _WHOLE:
            line = line.replace("\r", " ")
            reader = csv.reader([line], delimiter=mark, skipinitialspace=mark != "\t")
            cells = next(reader, [])
        rows.append([cell.strip() for cell in cells])
    return rows


def _lay_out(mark: str, lines: Sequence[str], no_header: bool) -> Dialect | None:
    """Finds names and data among the first lines, or None if they have no common number of
    cells.
    """
    rows = _split(lines, mark)
    filled = [row for row in rows if row]
    last = filled[2 * len(filled) // 3 :]
    widths = [len(row) for row in last]
    width = max(widths, key=lambda number: (widths.count(number), number))
    if widths.count(width) < 0.6 * len(widths):
        return None
    sample = [row for row in last if len(row) == width]
    solid = [place for place in range(min(width, _LOOK)) if _is_solid(sample, place)]

    shares = [_share(row, solid) for row in rows]
    first, *second = filled[:2]
    is_above_data = all(_share(row, solid) > 0.5 for row in second)
    if 0 in solid and is_above_data and _are_rising_names(first):
        shares[rows.index(first)] = 0.0
    begin = _begin_of(rows, shares, width, otherwise=rows.index(filled[0]) + (not no_header))
    # of a last column that is mostly left out
    lacks = begin > 0 and len(rows[begin - 1]) == width + 1 and shares[begin - 1] == 0
    width += lacks
    # a blank line may follow the names
    top = next((number for number in range(begin, 0, -1) if rows[number - 1]), 0)
    top = top if top and len(rows[top - 1]) == width else begin
    block = top
    fewest = width if no_header else 1
    while (
        block > 0
        and fewest <= len(rows[block - 1]) <= width
        and (shares[block - 1] == 0 or len(rows) == 1)
    ):
        block -= 1
    names = [""] * width
    units: Sequence[str] = ()
    below = rows[begin] if begin < len(rows) else []
    if block < top and no_header:
        begin = block
    elif block < top:
        line = "".join(lines[begin : begin + 1])
        given, units = _names_of(rows[block:top], below, line, sample, mark, width)
        if not any(given) or len(given) == 1 < width:
            return None
        names = given if len(given) == width else []  # which is refused
    skipped = sum(map(bool, rows[:begin])) - any(names)
    head = [row for row in rows[begin:] if row]
    may_lack_last = lacks or any(names) and not names[-1]
    above = lines[:begin]
    return Dialect(mark or ",", names, begin, skipped, head, units, may_lack_last, above)


def _share(row: list[str], solid: Sequence[int]) -> float:
    """Share of the columns of numbers and dates that hold one in a row, none if its cells are names
    that count, as in `,0,1`, or formats, as `5s` and `20d` of the USGS.
    """
    if row and all(map(_FORMAT, row)):
        return 0.0
    first, *others = row or [""]
    counts = [str(number) for number in range(len(row))]
    if others and others in (counts[:-1], counts[1:]) and not any(map(str.isdigit, first)):
        return 0.0
    marks = [place < len(row) and bool(_SOLID.match(row[place])) for place in solid]
    return sum(marks) / max(1, len(solid))


def _are_rising_names(row: Sequence[str]) -> bool:
    """Whether a row has words, of which one is first, and numbers that rise: `time,31.5,63`."""
    numbers = [cell for cell in row if _PLAIN(cell)]
    is_rising = all(float(one) < float(other) for one, other in itertools.pairwise(numbers))
    words = [cell for cell in row if not _PLAIN(cell)]
    return is_rising and len(numbers) > 1 and row[:1] == words[:1] and all(map(str.isalpha, words))


def _begin_of(
    rows: Sequence[Sequence[str]], shares: Sequence[float], width: int, otherwise: int
) -> int:
    """Returns the first row of the data; `otherwise` if there are only words."""
    is_wide = [len(row) == width for row in rows]
    begin = next(
        (number for number, wide in enumerate(is_wide) if wide and shares[number] > 0.5), otherwise
    )
    while begin > 0 and is_wide[begin - 1] and shares[begin - 1] > 0:
        begin -= 1
    # rows below the names with too few or too many cells, which are refused as such
    above = begin
    while above > 0 and not is_wide[above - 1] and shares[above - 1] > 0.5:
        above -= 1
    is_below_names = above > 0 and is_wide[above - 1] and shares[above - 1] == 0
    return above if is_below_names or not above else begin


def _names_of(
    block: Sequence[list[str]],
    below: Sequence[str],
    line: str,
    sample: Sequence[Sequence[str]],
    mark: str,
    width: int,
) -> tuple[list[str], Sequence[str]]:
    """Returns the names and the units in a block of lines above the first row of data, whose cells
    are `below` and whose text is `line`; fewer names than columns if a sample of the data has
    values in the others.
    """
    # the line of the most different names, of several the first
    header = max(range(len(block)), key=lambda number: len({*block[number]} - {""}))
    given = block[header]
    if below and len(given) == width - 1:
        # a date and a time of day below one name
        if mark == BLANKS and len(given) > 1 and ":" in below[1]:
            given = ["", *given]
        # R writes no name above the numbers of the rows, and quotation marks
        elif line.startswith('"1"') and all(row[-1] for row in sample):
            given = ["", *(cell.strip('"') for cell in given)]
    if any(any(row[len(given) :]) for row in sample):
        return given, ()
    names = given + [""] * (width - len(given))
    # names in two lines; those in merged cells go before several of the other line
    for row in (*block[:header], *block[header + 1 :]):
        pairs = list(itertools.zip_longest(names, row, fillvalue=""))
        has_units = any(cell[:1] in ("[", "(") for cell in row)
        few_names = width > 2 * sum(map(bool, names[1:]))
        is_merged = few_names and all(row[1:width]) and not has_units
        before = ""
        for place, (name, other) in enumerate(pairs):
            before = name or before
            joined = f"{before} {other}" if is_merged and place else name or other
            names[place] = joined.strip()
    return names, block[header + 1] if header + 1 < len(block) else ()


def _is_solid(sample: Sequence[Sequence[str]], place: int) -> bool:
    """Whether a column holds numbers or dates in most of the rows in which it holds anything."""
    cells = [row[place] for row in sample if row[place]]
    return bool(cells) and 2 * sum(bool(_SOLID.match(cell)) for cell in cells) > len(cells)


def _named_by_comment(found: Dialect) -> Dialect | None:
    """Returns the dialect with names from the last comment above the data, as NumPy writes them, or
    None if it has not as many.

    If that repeats a name, it holds units, as in files of weather buoys, and the comment before it
    the names.
    """
    comments = [
        line.lstrip("#%").strip()
        for line in found.above
        if line.startswith(("#", "%")) and line.strip("#% ")
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
        found = dataclasses.replace(found, units=names)
        names = before[0]
    if (
        len(names) != len(found.names)
        or not all(names[1:])
        or all(_SOLID.match(name) for name in names)
    ):
        return None
    return dataclasses.replace(found, names=names)
