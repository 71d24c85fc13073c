"""Parses a raw column as numbers, including text, objects and decimal commas.

An empty cell is a missing value. A cell that cannot be parsed either raises an `InputError` that
names its row or is marked, so that the caller can count it.
"""

import decimal as decimal_module
import numbers
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.report import ROWS, Finding, Places

_MISSING = ("", "na", "n/a", "#n/a", "<na>", "null", "none", "nat")
_C_NAN = r"[+-]?(?:nan(?:\([a-z0-9_]*\))?|1\.#(?:qnan|snan|ind|nan)0*)"  # as printf of C writes NaN
_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_INFINITE = r"[+-]?(?i:inf(?:inity)?)"
_COMMA = r"[+-]?(?:0?|[1-9]\d*|[1-9]\d{0,2}(?:\.\d{3})+),\d+(?:[eE][+-]?\d+)?"  # not +0123,1
_COMMA_THOUSANDS = r"[+-]?[1-9]\d{0,2}(?:,\d{3})+"
_POINT_THOUSANDS = r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+"
_BOTH = rf"{_COMMA_THOUSANDS}\.\d*"  # 1,234.5 shows that commas separate thousands
_WHOLE = r"[+-]?\d+"
# thousands apart by apostrophes or blanks
_GROUPED = r"[+-]?[1-9]\d{0,2}(?:['\u2019 \u00a0\u202f]\d{3})+(?:[.,]\d+)?"
# behind a number
_UNIT = (
    r"[+-]?[\d.,'\u2019\s]*[\d.](?:[eE][+-]?\d+)?"
    r"( ?(?:[%\u2030\u00b0]|[^\W\d_])(?:[^\d:]|\d(?!\d))*)$"
)
SIGNS = ({"decimal": "."}, {"decimal": ","})
"""The options of the decimal sign."""
_CURRENCY = r"^[$\u20ac\u00a3\u00a5] ?(?=[\d.,])"
_LARGEST = float(np.finfo(np.float32).max)


def parse_numbers(
    values: Any,
    what: str,
    drop: bool = False,
    decimal: str | None = None,
    missing_values: Sequence[float | str] = (),
    places: Places = ROWS,
    units: bool = True,
) -> tuple[np.ndarray, np.ndarray, list[Finding]]:
    """Parses a one-dimensional column of numbers, text or objects.

    Args:
        values: The column.
        what: Description of the source, for messages.
        drop: Whether a value that is no number in the range of float32 is marked and taken as
            missing, instead of refused.
        decimal: Decimal sign of text; the other sign separates thousands. None: inferred from the
            text.
        missing_values: Numbers and text that mean "no value".
        places: Where the rows are in their file, for messages.
        units: Whether text such as 23.5 °C is a number, if most cells have the same unit.

    Returns:
        float64 values with NaN where missing, the mask of values that could not be parsed, and
        findings for the cleaning log.
    """
    values = as_column(values, what)
    plain = is_plain(values)
    if not (plain or is_text(values)):
        raise InputError(
            f"Expected numbers. Received: dtype {values.dtype} from {what}.",
            [{"states": True}] if values.dtype == bool else (),
            "a numeric column",
        )
    cells = (
        pd.Series(values.to_numpy(np.float64, na_value=np.nan)) if plain else values.astype(object)
    )
    cells, findings = _without(cells, missing_values)
    if plain:
        parsed = cells.to_numpy()
        bad = np.zeros(len(cells), bool)
    else:
        parsed, bad, noted = _parse_text_numbers(cells, decimal, units)
        findings += noted
    beyond = np.isfinite(parsed) & (np.abs(parsed) > _LARGEST)
    wrong = bad | beyond
    if not wrong.any():
        return parsed, wrong, findings
    if not drop:
        row = int(np.argmax(wrong))
        expected = f"values that float32 holds, up to {_LARGEST:.1e}" if beyond[row] else "numbers"
        raise InputError(
            f"Expected {expected}. Received: {format_cell(values.iloc[row])} at {places.of(row)} "
            f"of {what} ({int(wrong.sum()):,} in all).",
            _options(values[wrong].iloc[:1_000], decimal),
        )
    return np.where(wrong, np.nan, parsed), wrong, findings


def as_column(values: Any, what: str) -> pd.Series:
    """Converts values to a Series with rows counted from 0; raises an `InputError` if they are not
    one-dimensional.
    """
    if isinstance(values, pd.DataFrame) or np.ndim(values) != 1:
        raise InputError(
            f"Expected one series of shape (samples,). Received: shape {np.shape(values)} from "
            f"{what}. Name one column."
        )
    try:
        cells = pd.Series(values).reset_index(drop=True)
        return cells.astype(object) if isinstance(cells.dtype, pd.CategoricalDtype) else cells
    # types that pandas does not support
    except (ValueError, TypeError, NotImplementedError) as error:
        reason = (str(error).splitlines() or [""])[0]
        raise InputError(
            f"Expected one plain column. Received: {type(values).__name__} from {what} ({reason}). "
            "Name one column."
        ) from None


def is_plain(values: pd.Series) -> bool:
    """Whether a column holds real numbers, which need not be parsed."""
    return pd.api.types.is_numeric_dtype(values.dtype) and values.dtype.kind not in "bc"


def is_text(values: pd.Series) -> bool:
    """Whether a column holds text or objects, which must be parsed cell by cell."""
    return values.dtype == object or pd.api.types.is_string_dtype(values.dtype)


def are_strings(cells: pd.Series) -> np.ndarray:
    """Mask of the cells of a column of text or objects that are text."""
    if cells.dtype != object:
        return np.ones(len(cells), bool)
    return cells.map(lambda cell: isinstance(cell, str)).to_numpy(bool)


def matches(text: pd.Series, pattern: str) -> np.ndarray:
    """Mask of the cells of text, none of them missing, that match a pattern as a whole."""
    return text.str.fullmatch(pattern).to_numpy(bool)


def format_cell(cell: Any) -> str:
    """Formats a cell for a message, shortened to 60 characters."""
    text = repr(cell) if isinstance(cell, str) else str(cell)
    return " ".join(text.split())[:60]


def is_missing(cells: pd.Series) -> np.ndarray:
    """Mask of missing cells: None, NaN, empty text and words such as "n/a"."""
    missing = cells.isna().to_numpy(bool, copy=True)
    of_text = ~missing & are_strings(cells)
    text = cells if of_text.all() else cells[of_text]
    if (
        pd.api.types.is_string_dtype(text.dtype)
        and text.dtype != object
        and (text.str.len() > len("-nan(snan)") + 2).all()
    ):
        return missing  # no such word is that long, as dates are
    text = text.str.strip().str.casefold()
    missing[of_text] = text.isin(_MISSING).to_numpy(bool) | matches(text, _C_NAN)
    return missing


def _without(
    cells: pd.Series, missing_values: Sequence[float | str]
) -> tuple[pd.Series, list[Finding]]:
    """Empties the cells that mean "no value", and says how many."""
    if not len(missing_values):
        return cells, []
    words = {str(value).strip() for value in missing_values}
    numbers_of = [float(word) for word in words if re.fullmatch(f"{_NUMBER}|{_INFINITE}", word)]
    found = pd.to_numeric(cells, errors="coerce").isin(numbers_of).to_numpy(bool)
    if cells.dtype == object:
        found = found | cells.map(
            lambda cell: isinstance(cell, str) and cell.strip() in words
        ).to_numpy(bool)
    if not found.any():
        return cells, []
    text = (
        f"values that mean no value ({', '.join(sorted(words))}), taken as missing: {found.sum():,}"
    )
    return cells.mask(found), [Finding("missing words", int(found.sum()), text)]


def _options(cells: pd.Series, decimal: str | None) -> list[dict[str, Any]]:
    """What may be given for cells that are no numbers."""
    words = list(dict.fromkeys(str(cell).strip() for cell in cells))
    if re.fullmatch(f"{_COMMA_THOUSANDS}|{_COMMA}", words[0]):
        return [sign for sign in SIGNS if sign["decimal"] != decimal]
    is_short = len(words) <= 3 and all("," not in word for word in words)
    return [{"drop_bad": True}, *([{"missing_values": words}] if is_short else [])]


def shows_comma(text: pd.Series) -> bool:
    """Whether text without missing cells has numbers whose comma can only be a decimal sign, such
    as 20,5, but not 1,500.
    """
    commas = text[matches(text, _COMMA)]
    is_decimal = ~matches(commas, _COMMA_THOUSANDS)
    return bool(is_decimal.any()) and not matches(text, _BOTH).any()


def has_commas(text: pd.Series) -> bool:
    """Whether text without missing cells has numbers with commas, whatever these mean."""
    return bool(matches(text, f"{_COMMA}|{_COMMA_THOUSANDS}").any())


def allows_point_thousands(text: pd.Series) -> bool:
    """Whether every point in text without missing cells may separate thousands, such as in 1.200
    and 999.
    """
    return bool(matches(text, f"{_POINT_THOUSANDS}|{_WHOLE}|{_COMMA}").all())


def _parse_text_numbers(
    cells: pd.Series, decimal: str | None, units: bool
) -> tuple[np.ndarray, np.ndarray, list[Finding]]:
    parsed = np.full(len(cells), np.nan)
    left = ~is_missing(cells)
    of_text = are_strings(cells)
    for row in np.flatnonzero(left & ~of_text):
        parsed[row] = _parse_object(cells.iloc[row])
    rows = np.flatnonzero(left & of_text)
    text = cells.iloc[rows].str.strip().str.replace("\u2212", "-", regex=False)  # a minus sign
    text, unit = _without_unit(text) if units else (text, "")
    text = _plain(text)
    sign = decimal or _sign_of(text)
    forms = {
        ",": f"{_COMMA}|{_POINT_THOUSANDS}|{_WHOLE}",
        ".": f"{_NUMBER}|{_COMMA_THOUSANDS}|{_BOTH}",
    }
    readable = matches(text, f"{forms.get(sign, _NUMBER)}|{_INFINITE}")
    text = text[readable]
    count = int(text.str.contains(",", regex=False).sum()) if sign == "," else 0
    text = text.str.replace("." if sign == "," else ",", "", regex=False).str.replace(
        ",", ".", regex=False
    )
    values = text.to_numpy(np.float64)
    infinite = np.flatnonzero(np.isinf(values))
    values[infinite[~matches(text.iloc[infinite], _INFINITE)]] = np.nan  # 1e999
    parsed[rows[readable]] = values
    findings = []
    if count:
        said = f"numbers written with a decimal comma: {count:,}"
        findings.append(Finding("decimal comma", count, said))
    if unit:
        said = f"numbers written with the unit {unit}: {len(text):,}"
        findings.append(Finding("units", len(text), said))
    return parsed, left & np.isnan(parsed), findings


def _without_unit(text: pd.Series) -> tuple[pd.Series, str]:
    """Takes off the unit that most cells have, and returns it; cells with another one or none are
    then no numbers.
    """
    if text.str.contains(_CURRENCY).mean() > 0.5:
        sign = text.iloc[0][0]
        return text.str.removeprefix(sign).str.lstrip().where(text.str.startswith(sign), "?"), sign
    found = text.iloc[:1_000].str.extract(f"^{_UNIT}", expand=False).mode()
    if not len(found):
        return text, ""
    has_it = text.str.endswith(found.iloc[0]).to_numpy(bool)
    has_marks = text.str.contains(r"\d[.,]\d|[%\u00b0]").any()
    # words: 10 cm or 2a
    if (
        has_it.sum() <= len(text) / 2
        or text[has_it].nunique() <= (1 if has_marks else 10)
        or not text.str.contains("[., %\u00b0]").any()
    ):
        return text, ""
    return text.str.removesuffix(found.iloc[0]).where(has_it, "?"), found.iloc[0].strip()


def _plain(text: pd.Series) -> pd.Series:
    """Rewrites numbers of other programs: blanks behind the sign, Fortran's exponents, and
    thousands that are apart by apostrophes or blanks.
    """
    odd = text[~matches(text, _NUMBER)]
    odd = odd.str.replace(r"^([+-])\s+(?=[\d.])", r"\1", regex=True)
    odd = odd.str.replace(r"(?<=[\d.])[dD](?=[+-]\d\d)", "e", regex=True)
    odd = odd.mask(matches(odd, _GROUPED), odd.str.replace(r"['\u2019\s]", "", regex=True))
    return odd.reindex(text.index).fillna(text) if len(odd) else text


def _sign_of(text: pd.Series) -> str | None:
    """Returns the decimal sign that a column of text shows. None: points, and no commas that
    separate thousands.
    """
    if matches(text, _BOTH).any():
        return "."
    has_points = text[matches(text, _NUMBER)].str.contains(".", regex=False).any()
    return "," if shows_comma(text) and not has_points else None


def _parse_object(cell: Any) -> float:
    is_number = isinstance(cell, numbers.Real | decimal_module.Decimal) and not isinstance(
        cell, bool | np.bool_
    )
    try:
        return float(cell) if is_number else np.nan
    except (OverflowError, ValueError):  # an integer beyond float64, or a signalling NaN
        return np.nan
