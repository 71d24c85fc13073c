"""The options of reading and cleaning telemetry, declared once for Python and the commands."""

import dataclasses
from collections.abc import Sequence

from enhsim_tf.common.errors import InputError

_CHOICES = {
    "same_time": ("mean", "last"),
    "fill": ("linear", "hold"),
    "labelled": ("keep", "missing"),
    "decimal": (None, ".", ","),
}
UNITS_NS = {
    "D": 86_400 * 10**9,
    "h": 3_600 * 10**9,
    "min": 60 * 10**9,
    "s": 10**9,
    "ms": 10**6,
    "us": 10**3,
    "ns": 1,
}
DAYS = {"excel": 25_569.0, "mjd": 40_587.0, "jd": 2_440_587.5, "datenum": 719_529.0}
"""Kinds of days and their number of 1970-01-01: spreadsheets, modified Julian dates, Julian dates, MATLAB."""
_MAX_FILL = {"linear": 5, "hold": 1_000_000}
_NAMES = ("label_column", "series_column")


@dataclasses.dataclass(frozen=True)
class Cleaning:
    """Options of `read_source` and `clean`.

    Args:
        interval_s: Sampling interval in seconds. Every row is assigned to the nearest point of this grid, and rows that share
            a point are averaged. None: the interval that most rows have.
        timezone: Time zone of times without one, such as "Europe/Berlin". None: UTC; times that jump back by one hour, as a
            local clock does, then raise an `InputError`.
        time_format: How times are written: a format as for `datetime.strptime`, or for numbers their unit ("D", "h", "min", "s", "ms",
            "us", "ns", since 1970 or any other zero) or kind of day ("excel", "mjd", "jd", "datenum"). None: detected.
        drop_bad: Whether values and times that cannot be read are dropped and counted, instead of raising an `InputError`.
        decimal: Decimal sign, "." or ",". The other sign then separates thousands. None: decided from all columns of a file.
        missing_values: Values that mean "no value", numbers or text, such as `(-999.9, "offline")`.
        same_time: Treatment of different values at the same time: take their "mean", which without `interval_s` must not merge most rows, or
            the "last".
        max_fill: Longest gap that is filled, in samples. The series is split at longer gaps. None: 5, or 1,000,000 with
            `fill="hold"`.
        fill: How gaps are filled: "linear", by straight lines, or "hold", with the last value before the gap, for telemetry that is
            sent only when its value changes. With "hold", the last of several rows in an interval is used, not their mean.
        min_part: Shortest part that is kept, in samples.
        label_column: Name, or names, of the columns of a table that label anomalous rows, or "none". None: detected.
        labelled: Treatment of rows that are labelled anomalous: "keep" them, or take their values as "missing".
        series_column: Name, or names, of the columns whose values tell several series of one table apart, or "none". None: detected.
        no_header: Whether a text file has no line of column names. Its columns are then called "column 0", "column 1", ...

    Raises:
        InputError: If an option is out of range.
    """

    interval_s: float | None = None
    timezone: str | None = None
    time_format: str | None = None
    drop_bad: bool = False
    decimal: str | None = None
    missing_values: Sequence[float | str] = ()
    same_time: str = "mean"
    max_fill: int | None = None
    fill: str = "linear"
    min_part: int = 2
    label_column: str | Sequence[str] | None = None
    labelled: str = "keep"
    series_column: str | Sequence[str] | None = None
    no_header: bool = False

    def __post_init__(self):
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise InputError(
                    f"Expected {name}, one of: {', '.join(filter(None, choices))}. Received: {name}={getattr(self, name)!r}."
                )
        if self.interval_s is not None and not 1e-9 <= self.interval_s <= 1e9:
            raise InputError(
                f"Expected interval_s from 1e-9 to 1e9 seconds. Received: interval_s={self.interval_s}."
            )
        if self.longest_gap < 0 or self.min_part < 1:
            raise InputError(f"Expected max_fill >= 0, min_part >= 1. Received: {self}.")
        form, units = self.time_format, (*UNITS_NS, *DAYS)
        if form is not None and form not in units and "%" not in form:
            raise InputError(
                "Expected time_format as datetime.strptime takes it, such as '%d.%m.%Y %H:%M:%S', or one of: "
                f"{', '.join(units)}. Received: time_format={form!r}."
            )
        for name in _NAMES:
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, (given,) if isinstance(given, str) else tuple(given))
        given = self.missing_values
        object.__setattr__(
            self,
            "missing_values",
            (given,) if isinstance(given, str | float | int) else tuple(given),
        )

    @property
    def longest_gap(self) -> int:
        """Longest gap that is filled, in samples."""
        return _MAX_FILL[self.fill] if self.max_fill is None else self.max_fill

    def of_run(self, **changes: object) -> "Cleaning":
        """Returns the options for a recorded run of a simulator, which has another layout, with further changes of fields."""
        own = {"time_format": None, "label_column": None, "labelled": "keep", "series_column": None}
        return dataclasses.replace(self, **own | {"no_header": False} | changes)
