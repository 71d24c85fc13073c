"""The options of reading and cleaning telemetry, declared once for Python and the commands."""

import dataclasses
from collections.abc import Sequence

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.options import check_options, option

UNITS_NS = {
    "D": 86_400 * 10**9,
    "h": 3_600 * 10**9,
    "min": 60 * 10**9,
    "s": 10**9,
    "ms": 10**6,
    "us": 10**3,
    "ns": 1,
}
UNITS = {
    "D": "days d day tage",
    "h": "hours h hr hrs hour stunden",
    "min": "minutes min mins minute minuten",
    "s": "seconds s sec secs second sekunden",
    "ms": "milliseconds ms msec msecs millis millitm millisecond",
    "us": "microseconds us \u00b5s \u03bcs usec usecs micros microsecond",
    "ns": "nanoseconds ns nsec nsecs nanos nanosecond",
}
"""The words of each unit, its name first."""
DAYS = {"excel": 25_569.0, "mjd": 40_587.0, "jd": 2_440_587.5, "datenum": 719_529.0}
"""Kinds of days and their number of 1970-01-01: spreadsheets, modified Julian dates, Julian dates,
MATLAB.
"""
FILE = "file"
"""Instead of a column that tells parts apart: each file is a part."""
_MAX_FILL = {"linear": 5, "hold": 1_000_000}
_LISTS = ("label_column", "series_column", "missing_values")  # one, or several


@dataclasses.dataclass(frozen=True)
class Cleaning:
    """Options of `read_source` and `clean`.

    Args:
        interval_s: Sampling interval in seconds. Every row is assigned to the nearest point of this
            grid, and rows that share a point are averaged. None: the interval that most rows have.
        timezone: Time zone of times without one, such as "Europe/Berlin". None: UTC; times that
            jump back by one hour, as a local clock does, then raise an `InputError`.
        time_format: How times are written: a format as for `datetime.strptime`, or for numbers
            their unit ("D", "h", "min", "s", "ms", "us", "ns", since 1970 or any other zero) or
            kind of day ("excel", "mjd", "jd", "datenum"). None: detected.
        drop_bad: Whether values and times that cannot be read are dropped and counted, instead of
            raising an `InputError`.
        decimal: Decimal sign, "." or ",". The other sign then separates thousands. None: decided
            from all columns of a file.
        missing_values: Values that mean "no value", numbers or text, such as `(-999.9, "offline")`.
        same_time: Treatment of different values at the same time: take their "mean", which without
            `interval_s` must not merge most rows, or the "last".
        max_fill: Longest gap that is filled, in samples. The series is split at longer gaps. None:
            5, or 1,000,000 with `fill="hold"`.
        fill: How gaps are filled: "linear", by straight lines, or "hold", with the last value
            before the gap, for telemetry that is sent only when its value changes. With "hold", the
            last of several rows in an interval is used, not their mean.
        min_part: Shortest part that is kept, in samples.
        label_column: Name, or names, of the columns of a table that label anomalous rows, or
            "none". None: detected.
        labelled: Treatment of rows that are labelled anomalous: "keep" them, or take their values
            as "missing".
        series_column: Name, or names, of the columns whose values tell several series of one table
            apart, or "none". None: detected.
        part_column: Name of the column whose values tell parts of one series apart that each count
            from zero, such as repeated tests, or "file": each file is a part. None: one part.
        no_header: Whether a text file has no line of column names. Its columns are then called
            "column 0", "column 1", ...
        skip_rows: Number of lines of a text file, or rows of a sheet, that are left out on top.
        table: Name of the table in a file of several: a sheet of a workbook, a group, a struct or
            a variable. None: the only one, or the first that holds numbers.
        states: Whether columns of two to ten words, such as ON and OFF, are channels of 0 and 1.

    Raises:
        InputError: If an option is out of range.
    """

    interval_s: float | None = option(
        None,
        "sampling interval (default: the most frequent one)",
        float,
        least=1e-9,
        most=1e9,
        metavar="SECONDS",
    )
    timezone: str | None = option(
        None,
        "time zone, such as Europe/Berlin, of times that do not state one (default: UTC)",
        str,
        metavar="ZONE",
    )
    time_format: str | None = option(
        None,
        "how times are written: a format such as %%d.%%m.%%Y, or for numbers s, ms, us, ns, min, "
        "h, D, excel, mjd, jd, datenum (default: detected)",
        str,
        metavar="FORMAT",
    )
    drop_bad: bool = option(
        False, "drop and count values and times that cannot be read, instead of stopping", bool
    )
    decimal: str | None = option(
        None, "decimal sign; the other one separates thousands", str, choices=(".", ",")
    )
    missing_values: Sequence[float | str] = option(
        (),
        "values that mean 'no value', such as --missing-values=-999.9",
        str,
        metavar="VALUE,...",
        repeated=True,
    )
    same_time: str = option("mean", "", str, choices=("mean", "last"))
    max_fill: int | None = option(
        None, "longest gap, in samples, that is filled (default: 5; any with --fill hold)", least=0
    )
    fill: str = option(
        "linear",
        "fill gaps by straight lines, or hold the last value, for telemetry that is sent only when "
        "it changes",
        str,
        choices=("linear", "hold"),
    )
    min_part: int = option(2, "", least=1)
    label_column: str | Sequence[str] | None = option(
        None,
        "column that labels anomalous rows, or 'none'",
        str,
        metavar="NAME",
        repeated=True,
    )
    labelled: str = option("keep", "", str, choices=("keep", "missing"))
    series_column: str | Sequence[str] | None = option(
        None,
        "column whose values tell several series apart, or 'none'",
        str,
        metavar="NAME",
        repeated=True,
    )
    part_column: str | None = option(
        None,
        "column whose values tell repeated tests apart that each count from zero, or 'file'",
        str,
        metavar="NAME",
    )
    no_header: bool = option(
        False, "the file has no line of names: columns are 'column 0', 'column 1', ...", bool
    )
    skip_rows: int = option(0, "leave out N lines on top of a file", least=0)
    table: str | None = option(
        None, "sheet, group, struct or variable of a file that holds several", str, metavar="NAME"
    )
    states: bool = option(
        False, "columns of two to ten words, such as ON and OFF, are channels of 0 and 1", bool
    )

    def __post_init__(self):
        check_options(self)
        form = self.time_format
        units = (*UNITS_NS, *DAYS)
        if form is not None and form not in units and "%" not in form:
            raise InputError(
                "Expected time_format as datetime.strptime takes it, such as '%d.%m.%Y %H:%M:%S', "
                "or one of: "
                f"{', '.join(units)}. Received: time_format={form!r}."
            )
        for name in _LISTS:
            given = getattr(self, name)
            if given is not None:
                several = (given,) if isinstance(given, str | float | int) else tuple(given)
                object.__setattr__(self, name, several)

    @property
    def longest_gap(self) -> int:
        """Longest gap that is filled, in samples."""
        return _MAX_FILL[self.fill] if self.max_fill is None else self.max_fill

    def of_run(self, **changes: object) -> "Cleaning":
        """Returns the options for a recorded run of a simulator, which has another layout, with
        further changes of fields.
        """
        own = {"time_format": None, "label_column": None, "labelled": "keep", "series_column": None}
        own |= {"part_column": None, "no_header": False, "skip_rows": 0, "table": None}
        return dataclasses.replace(self, **own | changes)
