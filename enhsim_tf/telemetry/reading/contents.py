"""Says what each column of a table holds: numbers, dates, times of day, spans of time, words."""

import dataclasses
import datetime
from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.numbers import (
    are_strings,
    has_commas,
    is_missing,
    is_plain,
    is_text,
    parse_numbers,
)
from enhsim_tf.telemetry.cleaning.times import (
    LOOK,
    TIME_OF_DAY,
    are_spans,
    date_forms,
    parse_times,
)
from enhsim_tf.telemetry.reading.text_files import Table

_FEWEST_HEX = 3  # different cells with letters, below which they are damaged numbers
_OBJECTS = {
    "dates": datetime.date | np.datetime64,
    "times of day": datetime.time,
    "spans": datetime.timedelta,
}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Contents(Table):
    """A table, and what its columns hold."""

    kinds: Mapping[str, str]  # by column, see `_kind_of`
    numbers: Mapping[str, np.ndarray]  # the values of the columns of numbers

    def of_kind(self, kind: str) -> list[str]:
        """The columns of a kind."""
        return [name for name, its_kind in self.kinds.items() if its_kind == kind]


def first_cells(cells: pd.Series, most: int = LOOK) -> pd.Series:
    """Returns the first cells that are not missing as text."""
    return cells.dropna().iloc[:most].astype("str")


def different(frame: pd.DataFrame, names: list[str]) -> list[str]:
    """Leaves out columns that hold the same as the first of them."""
    return names[:1] + [name for name in names[1:] if not frame[name].equals(frame[names[0]])]


def contents_of(table: Table, asked: Collection[str], time_format: str | None) -> Contents:
    """Says what the columns of a table hold. Those that fit the time format hold dates, unless they
    are asked for as channels.
    """
    frame = table.frame
    kinds = {name: _kind_of(frame[name]) for name in frame.columns}
    if "%" in (time_format or ""):
        kinds |= {
            name: "dates"
            for name in frame.columns
            if name not in asked and _fits(frame[name], str(time_format))
        }
    # of a family such as D1, D2, ... of which one holds hexadecimal numbers, all do
    families = {name: name.rstrip("0123456789").removesuffix("column ") or name for name in kinds}
    hexadecimal = {
        family
        for name, family in families.items()
        if family != name and kinds[name] == "words" and _are_hex(first_cells(frame[name]))
    }
    kinds |= {name: "words" for name in kinds if families[name] in hexadecimal - {name}}
    numbers = {
        name: _values(frame[name], table.decimal)
        for name, kind in kinds.items()
        if kind == "numbers"
    }
    return Contents(**vars(table), kinds=kinds, numbers=numbers)


def _kind_of(cells: pd.Series) -> str:
    """Says what a column holds: "numbers", "dates", "spans" of time, "times of day", "words", other
    "objects", or nothing ("empty").

    Text that holds at least some numbers is numbers.
    """
    kind = cells.dtype
    if isinstance(kind, pd.CategoricalDtype):
        return _kind_of(cells.iloc[:LOOK].astype(object))
    if pd.api.types.is_datetime64_any_dtype(kind) or isinstance(kind, pd.PeriodDtype):
        return "dates"
    if getattr(kind, "kind", "") == "m":
        return "spans"
    if pd.api.types.is_bool_dtype(kind):
        return "words"
    if not is_text(cells):
        return "objects" if not is_plain(cells) else "numbers" if cells.notna().any() else "empty"
    for some in (cells.iloc[: 10 * LOOK], cells):
        given = some[~is_missing(some)].iloc[:LOOK]
        if len(given):
            break
    else:
        return "empty"
    for kind, classes in _OBJECTS.items():
        if isinstance(given.iloc[0], classes):
            return kind
    text = given[are_strings(given)].astype("str").str.strip()
    if len(text) == len(given) and (_are_hex(text) or _turn_hex(text, cells)):
        return "words"
    if not parse_numbers(given, "", drop=True, units=False)[1].all():
        return "numbers"
    if len(text) < len(given) / 2:
        return "objects"
    if has_commas(text):  # which are refused where they can be read in two ways
        return "numbers"
    if text.str.fullmatch(TIME_OF_DAY).mean() > 0.5:  # elapsed ones may pass 24 h late
        return (
            "spans"
            if are_spans(cells[~is_missing(cells)].astype("str").str.strip())
            else "times of day"
        )
    if are_spans(text):
        return "spans"
    return (
        "dates"
        if date_forms(text)
        else "words"
        if parse_numbers(given, "", drop=True)[1].all()
        else "numbers"
    )


def _fits(cells: pd.Series, form: str) -> bool:
    """Whether most cells are dates of a given format."""
    head = cells.dropna().iloc[:LOOK]
    if not len(head) or not (is_text(head) or pd.api.types.is_integer_dtype(head.dtype)):
        return False
    try:
        return bool(parse_times(head, "", drop=True, form=form).bad.mean() < 0.5)
    except InputError:  # an invalid format, which is refused when the clock is read
        return False


def _are_hex(text: pd.Series) -> bool:
    """Whether text is hexadecimal numbers of one length, some with letters."""
    return (
        text.str.len().nunique() == 1
        and bool(text.str.fullmatch("(?:0[xX])?[0-9A-Fa-f]{2,}").all())
        and bool(text.str.contains("[A-Fa-f]").any())
        and not text.str.fullmatch(r"\d+[eE]\d+|\d+").all()
    )


def _turn_hex(head: pd.Series, cells: pd.Series) -> bool:
    """Whether numbers of one length are hexadecimal further down, as `9A` behind `10`."""
    if head.str.len().nunique() > 1 or not head.str.fullmatch(r"\d{2,}").all():
        return False
    text = cells.dropna().astype("str").str.strip()
    mixed = text[text.str.fullmatch(r"(?=.*\d)[\dA-Fa-f]*[A-Fa-f][\dA-Fa-f]*")]
    of_length = mixed[mixed.str.len() == len(head.iloc[0])]
    return of_length[~of_length.str.fullmatch(r"\d+[eE]\d+")].nunique() >= _FEWEST_HEX


def _values(cells: pd.Series, decimal: str | None) -> np.ndarray:
    """Returns the values of a column of numbers, NaN where they are missing or cannot be read."""
    if is_text(cells) or isinstance(cells.dtype, pd.CategoricalDtype):
        return parse_numbers(cells, "", drop=True, decimal=decimal)[0]
    return cells.to_numpy(np.float64, na_value=np.nan)
