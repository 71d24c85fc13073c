"""Parts of one series that each count from zero, as repeated tests, cycles of a cell and engines of
a fleet do: in one table, told apart by a column, or in a file each.
"""

import dataclasses
from collections.abc import Collection

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.telemetry.cleaning.options import FILE, Cleaning
from enhsim_tf.telemetry.cleaning.report import Finding, Places
from enhsim_tf.telemetry.cleaning.times import LARGEST_NS, Times
from enhsim_tf.telemetry.reading.contents import Contents


def files_of_rows(places: Places, num_rows: int) -> tuple[np.ndarray, list[str]]:
    """Returns the number of the file of each row, counted from 0, and the names of the files."""
    begins: list[int] = []
    names: list[str] = []
    last = 0
    for row, line, name in places.files:
        # a header that is repeated inside of a file begins no other
        if not names or name != names[-1] or line <= last:
            begins.append(row)
            names.append(name)
        last = line
    return np.searchsorted(begins, np.arange(num_rows), "right") - 1, names


def one_after_another(
    table: Contents, times: Times | None, options: Cleaning
) -> tuple[Times, Finding]:
    """Places the parts that `options.part_column` tells apart one after another, each a power of
    ten seconds behind the one before it, and says so.

    Raises:
        InputError: If there is no clock that counts, or the column tells no parts apart.
    """
    column = str(options.part_column)
    if times is None or not times.counts:
        what = "no clock" if times is None else times.form
        raise InputError(
            f"Expected times that count in each part with part_column (--part-column). Received: "
            f"{what} in {table.what}.",
            otherwise="the column that counts with --time, or leave it out: gaps split a series",
        )
    if column == FILE and FILE not in table.frame:
        number, _ = files_of_rows(table.places, len(table.frame))
    else:
        number = table.frame.groupby(column, sort=False, dropna=False).ngroup().to_numpy()
    own_s = pd.Series(times.seconds)
    number, long_s = _numbered(table, number, own_s, options)
    # further apart than a gap that is filled
    gap_s = (options.longest_gap + 2) * max(long_s, options.interval_s or 0.0)
    reach_s = own_s.max() - min(own_s.min(), 0.0) + gap_s
    apart_s = 10 ** int(np.ceil(np.log10(max(np.nan_to_num(reach_s), 1.0))))
    last = int(number.max(initial=0))
    if (last * apart_s + reach_s) * 1e9 > LARGEST_NS:
        raise InputError(
            f"Expected parts that fit into 292 years one after another. Received: {last + 1:,} by "
            f"{column!r} in {table.what}, every {apart_s:,} s. Give fewer of them."
        )
    stamps = times.stamps + pd.to_timedelta(number * apart_s, unit="s")
    text = (
        f"parts told apart by {column}: {last + 1:,}, placed one after another, every {apart_s:,} s"
    )
    return dataclasses.replace(times, stamps=stamps), Finding("parts", last + 1, text)


def _numbered(
    table: Contents, value: np.ndarray, own_s: pd.Series, options: Cleaning
) -> tuple[np.ndarray, float]:
    """Returns the number of the part of each row, given that of its value, and a long step within
    parts. A value that comes again with its first time, as that of a step of every cycle, begins
    another part.
    """
    keys = [name for name in options.series_column or () if name in table.frame]
    series = table.frame.groupby(keys, dropna=False).ngroup() if keys else 0
    rows = pd.DataFrame({"value": value, "series": series, "time": own_s})
    by = ["value", "series"]
    if rows.groupby(by)["time"].diff().median() < 0:  # the latest row comes first
        rows = rows[::-1]
    rows = rows.assign(place=np.arange(len(rows)))
    groups = rows.groupby(by)
    steps = groups["time"].diff()
    is_first_time = rows["time"] <= groups["time"].cummin() + steps.abs().median()
    restarts = (steps < 0) & (groups["place"].diff() > 1) & is_first_time
    rows = rows.assign(again=restarts.groupby([rows[name] for name in by]).cumsum())
    number = rows.groupby(["value", "again"], sort=False).ngroup().sort_index().to_numpy()
    num_parts = number.max(initial=0) + 1
    if 2 * num_parts > len(number):
        raise InputError(
            f"Expected part_column (--part-column) with several rows for each value. Received: "
            f"{options.part_column!r} of {table.what}, {num_parts:,} parts of {len(number):,} "
            "rows. Name another column."
        )
    return number, float(np.nan_to_num(steps.abs()[(steps != 0) & ~restarts].quantile(0.9)))


def refuse_restarts(
    table: Contents, counters: Collection[str], times: Times | None, words: Collection[str]
) -> None:
    """Refuses times, or `counters` of rows beside no clock, that begin again with each value of
    another column, of numbers or one of `words`.
    """
    numbers = table.numbers
    codes = numbers | {name: pd.factorize(table.frame[name])[0] for name in words}
    counts = {name: numbers[name] for name in counters} if times is None else {}
    if times is not None and times.counts:
        counts[""] = times.seconds
    for counter, values in counts.items():
        restarts = np.diff(values) < 0
        if not 0 < restarts.sum() < len(restarts) / 2:  # others fall, with the latest row first
            continue
        told = [
            {"part_column": name}
            for name, each in codes.items()
            if np.array_equal(np.diff(each) != 0, restarts)
        ][:2]
        if not told:
            continue
        others = [{"series_column": option["part_column"]} for option in told]
        raise InputError(
            "Expected one series, or to know what tells its parts apart. Received: "
            f"{repr(counter) if counter else 'times'} beginning again "
            f"{counted(restarts.sum(), 'time')}, with another {told[0]['part_column']!r} each "
            f"time, in {table.what}.",
            [{"time": counter, **option} for option in told] if counter else [*told, *others],
        )
