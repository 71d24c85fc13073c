"""Finds out how the dates in a column of text are written, and parses them.

ISO 8601 and names of months are left to pandas. Day of year, the order of day and month, and times with commas are decided here, because
pandas would guess or refuse.
"""

import re

import numpy as np
import pandas as pd
from pandas.tseries.api import guess_datetime_format

ISO = "ISO8601"
LOOK = 200  # number of cells that are inspected to find a form
_TIME = r"(?P<time>\d\d?:\d\d(?P<seconds>:\d\d(?P<fraction>\.\d+)?)?)(?P<half> ?[AaPp][Mm])?"
_END = rf"(?:(?P<gap>[T:]|,? +){_TIME})?(?P<zone> ?(?:Z|[+-]\d\d(?::?\d\d)?))?"
_DAY_OF_YEAR = re.compile(rf"\d{{4}}(?P<mark>[-/:. ]?)\d{{3}}{_END}")
_DAY_MONTH = re.compile(rf"(?P<first>\d\d?)(?P<mark>[./-])(?P<second>\d\d?)(?P=mark)\d{{4}}{_END}")


def date_forms(text: pd.Series) -> list[str]:
    """Finds the forms in which a column of dates may be written.

    Args:
        text: Text without missing cells.

    Returns:
        Formats as for `datetime.strptime`, or `ISO`. None of them: the text is no dates. Two: day and month cannot be told apart.
    """
    head = _plain(text.iloc[:LOOK])
    if not len(head):
        return []
    if not head.str.fullmatch(r"\d{1,7}").all() and pd.to_datetime(head, format=ISO, utc=True, errors="coerce").notna().mean() > 0.5:
        return [ISO]
    for cell in head.iloc[:3]:  # the first cells may be damaged
        if found := _DAY_OF_YEAR.fullmatch(cell):
            return [f"%Y{found['mark']}%j{_end(found)}"] if found["mark"] or found["time"] else []
        if found := _DAY_MONTH.fullmatch(cell):
            return [f"{order.replace('-', found['mark'])}{_end(found)}" for order in _orders(text, found["mark"])]
        if re.search(r"[A-Za-z]{3}", cell) and (form := guess_datetime_format(cell)) and "%Y" in form and "%d" in form:
            return [form]
        if found := re.fullmatch(rf"\d\d?/[A-Z][a-z]{{2}}/\d{{4}}{_END}", cell):  # of web servers
            return [f"%d/%b/%Y{_end(found)}"]
        if re.fullmatch(rf"\d{{4}}(?P<mark>[/.])\d\d?(?P=mark)\d\d?{_END}", cell) and (form := guess_datetime_format(cell)):
            return [form]
    return []


def _orders(text: pd.Series, mark: str) -> list[str]:
    """Returns the orders of day and month that all dates allow; with points, the day comes first."""
    days = pd.Series(text.str[:12].unique(), dtype="str")  # far fewer than rows
    parts = days.str.extract(rf"^\s*(\d\d?)\{mark}(\d\d?)\{mark}").dropna().astype(int)
    largest = parts.max()
    orders = [order for order, which in (("%d-%m-%Y", 1), ("%m-%d-%Y", 0)) if largest[which] <= 12]
    return orders[:1] if mark == "." else orders


def _end(found: re.Match) -> str:
    """Returns the format of the time of day and the zone behind a date."""
    if not found["time"]:
        return ""
    hours = "%I:%M" if found["half"] else "%H:%M"
    time = hours + (":%S" if found["seconds"] else "") + (".%f" if found["fraction"] else "")
    half = "" if not found["half"] else found["half"][:-2] + "%p"
    return found["gap"] + time + half + ("" if not found["zone"] else found["zone"][: found["zone"].startswith(" ")] + "%z")


def _plain(text: pd.Series) -> pd.Series:
    """Rewrites what no parser takes: decimal commas in seconds, and UTC in words."""
    return text.str.strip().str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True).str.replace(r" ?(?:UTC|GMT)$", "+00:00", regex=True)


def parse_dates(text: pd.Series, form: str) -> tuple[pd.Series, np.ndarray]:
    """Parses dates of one form.

    Args:
        text: The text; missing where there is none.
        form: A format as for `datetime.strptime`, or `ISO`.

    Returns:
        The dates without a zone, NaT where a cell cannot be parsed, and the mask of those that state a zone, which are in UTC.

    Raises:
        ValueError: If the format cannot be used.
    """
    try:
        dates = pd.to_datetime(text, format=form, errors="coerce")
        zoned = np.full(len(dates), isinstance(dates.dtype, pd.DatetimeTZDtype))
    except ValueError as error:
        if "ixed" not in str(error):
            raise
        dates = pd.to_datetime(text, format=form, utc=True, errors="coerce")  # some state a zone, or another one than others
        zoned = _has_zone(text, form)
    if isinstance(dates.dtype, pd.DatetimeTZDtype):
        dates = dates.dt.tz_convert("UTC").dt.tz_localize(None)
    left = (dates.isna() & text.notna()).to_numpy()
    if left.any():
        rest = _plain(text[left].astype(str))
        whole = form.replace(".%f", "")
        for other in dict.fromkeys((form, whole, whole.replace("%S", "%S.%f"))):
            found = pd.to_datetime(rest, format=other, utc=True, errors="coerce").dt.tz_localize(None)
            dates = fill_dates(dates, found)
        zoned[left] = _has_zone(rest, form)
    return dates, zoned


def fill_dates(dates: pd.Series, found: pd.Series) -> pd.Series:
    """Fills missing dates with others. Whole seconds and fractions have different units, of which the finer is taken.

    Args:
        dates: Dates without a zone.
        found: Others, by the labels of the rows.
    """
    unit = np.promote_types(dates.dtype, found.dtype)
    return dates.astype(unit).fillna(found.astype(unit))


def _has_zone(text: pd.Series, form: str) -> np.ndarray:
    """Says which cells state a zone: by an offset behind a time of day, or by the format."""
    if form != ISO:
        return np.full(len(text), "%z" in form or "%Z" in form)
    zone = r"[T ]\d\d(?::?\d\d(?::?\d\d(?:[.,]\d+)?)?)?\s?(?:Z|UTC|GMT|[+-]\d\d(?::?\d\d)?)\s*$"
    return text.str.contains(zone).fillna(False).to_numpy(bool)
