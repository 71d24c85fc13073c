"""The rows of a raw channel on their way to regular samples: one a time, one rate, parts without gaps.

Each step takes rows out, merges or adds them, and writes into the book what it did.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.regular_grid import OtherRate, Stretch, other_rates
from enhsim_tf.telemetry.cleaning.report import Book


@dataclasses.dataclass
class Rows:
    """Rows that are still in use, in the order of time.

    Args:
        times: int64 nanoseconds.
        values: float64, NaN or infinite where there is none.
        number: Row of the source.
        stands_for: 1, or 0 for a sample that was interpolated.
    """

    times: np.ndarray
    values: np.ndarray
    number: np.ndarray
    stands_for: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    def take(self, which: np.ndarray | slice) -> "Rows":
        """Some of the rows."""
        return Rows(self.times[which], self.values[which], self.number[which], self.stands_for[which])


@dataclasses.dataclass(frozen=True)
class Part:
    """Regular samples without a gap.

    Args:
        begin: Time of the first sample in nanoseconds, a float: grids need not fall on whole ones.
        values: float64 array of shape `(samples,)`.
        number: Row of the source that each sample is, or lies behind.
    """

    begin: float
    values: np.ndarray
    number: np.ndarray


def without_doubles(rows: Rows, bad: np.ndarray, book: Book, name: str, same_time: str) -> Rows:
    """One row for each time.

    Args:
        rows: The rows.
        bad: Marks of the source's rows whose value cannot be read.
        book: Takes what is found.
        name: Channel name, for messages.
        same_time: Which of different values is taken: mean, first, last or refuse.
    """
    values = np.where(bad[rows.number], np.inf, rows.values)  # what cannot be read is no copy of what is missing
    is_copy = pd.DataFrame({"time": rows.times, "value": values}).duplicated().to_numpy()
    copies = rows.number[is_copy]
    book.add("duplicate rows", copies, "rows that repeat the time and value of another: {count}", rows_left_out=len(copies))
    rows = rows.take(~is_copy)
    kept, left = _merged(rows, rows.times, same_time)
    if same_time == "refuse" and len(left):
        raise InputError(
            f"Expected one value for each time. Received: {len(left):,} more in {name}, the first at {book.place(left[0])}. Give same_time='mean'."
        )
    book.add(
        "same time", left, f"rows with another value for a time, of which the {same_time} was taken: {{count}}", rows_left_out=len(left)
    )
    return kept


def _merged(rows: Rows, groups: np.ndarray, how: str) -> tuple[Rows, np.ndarray]:
    """One row for each group of neighbours, and the numbers of the rows it replaces."""
    if not np.any(groups[1:] == groups[:-1]):
        return rows, rows.number[:0]
    has_value, real = np.isfinite(rows.values), rows.stands_for > 0
    order = np.arange(len(rows)) * (-1 if how == "last" else 1)
    ranked = np.lexsort((order, ~real, ~has_value, groups))  # in each group: rows with a value first
    chosen = ranked[np.flatnonzero(np.diff(groups[ranked], prepend=groups[ranked[0]] - 1))]
    kept = rows.take(chosen)
    if how not in ("first", "last"):
        means = pd.Series(np.where(has_value, rows.values, np.nan)).groupby(groups).mean().to_numpy()
        kept.values = np.where(np.isfinite(means), means, kept.values)
    is_left = real.copy()
    is_left[chosen] = False
    return kept, rows.number[is_left]


def without_missing(rows: Rows, bad: np.ndarray, book: Book, name: str) -> Rows:
    """The rows that have a value.

    Args:
        rows: The rows.
        bad: Marks of the source's rows whose value cannot be read.
        book: Takes what is found.
        name: Channel name, for messages.
    """
    has_value = np.isfinite(rows.values)
    unread, missing = rows.number[~has_value & bad[rows.number]], rows.number[~has_value & ~bad[rows.number]]
    book.add("bad values", unread, "values that cannot be read, taken as missing: {count}", rows_left_out=len(unread))
    book.add("missing values", missing, "rows without a value (NaN, infinite or empty), taken as gaps: {count}", rows_left_out=len(missing))
    if not has_value.any():
        raise InputError(f"Expected values. Received: only missing ones in {name}. Choose another channel.")
    return rows.take(has_value)


def at_one_rate(rows: Rows, interval: float, book: Book, resample: bool, max_fill: int) -> Rows:
    """The rows with stretches of other sampling rates resampled, or left out.

    Args:
        rows: The rows.
        interval: The sampling interval in nanoseconds.
        book: Takes what is found.
        resample: Whether to resample them. Slower ones than `max_fill` allows are left out in any case.
        max_fill: Most samples that are interpolated between two rows.
    """
    pieces, done, left = [], 0, []
    finer, coarser, merged = [], [], 0
    for stretch in other_rates(rows.times, interval):
        first, last = max(stretch.first, done), stretch.last
        if first >= last:  # stretches of two kinds share a row at most
            continue
        pieces.append(rows.take(slice(done, first)))
        inside, done = rows.take(slice(first, last + 1)), last + 1
        if not resample or stretch.longest - 1 > max_fill:
            ends = np.array([0] * (first > 0) + [-1] * (last < len(rows) - 1), np.int64)  # they belong to the neighbours too
            pieces.append(inside.take(ends))
            left.append(np.delete(inside.number, ends))
            continue
        (finer if stretch.ratio < 1 else coarser).append((inside.number[0], stretch.ratio))
        pieces.append(_resampled(inside, interval, stretch, from_last=first == 0))
        merged += int(inside.stands_for.sum() - pieces[-1].stands_for.sum())
    for kind, found, how in (("finer stretches", finer, "averaged down"), ("coarser stretches", coarser, "interpolated")):
        steps = " or ".join(dict.fromkeys(f"{ratio * interval / 1e9:.4g}" for _, ratio in found[:3]))
        text = f"stretches with a row every {steps} s instead of {interval / 1e9:.6g} s, {how}: {{count}}"
        book.add(kind, [number for number, _ in found], text, rows_left_out=merged if found is finer else 0)
    if left:
        numbers = np.concatenate(left)
        book.add("other rates", numbers, f"rows in stretches of another rate ({len(left):,}): {{count}}", rows_left_out=len(numbers))
    pieces.append(rows.take(slice(done, None)))
    return Rows(*(np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in dataclasses.fields(Rows)))


def _resampled(rows: Rows, interval: float, stretch: OtherRate, from_last: bool) -> Rows:
    """A stretch on the grid of its neighbour: means of finer rows, straight lines between coarser ones."""
    anchor = int(rows.times[-1 if from_last else 0])
    places = (rows.times - anchor) / interval
    if stretch.ratio < 1:
        cells = np.round(places).astype(np.int64)
        kept, _ = _merged(rows, cells, "mean")
        kept.times = anchor + np.round(np.unique(cells) * interval).astype(np.int64)
        return kept
    cells = np.arange(np.ceil(places[0] - 1e-6), np.floor(places[-1] + 1e-6) + 1)
    stands_for = np.zeros(len(cells), np.int64)
    stands_for[np.clip(np.round(places - cells[0]).astype(np.int64), 0, len(cells) - 1)] = rows.stands_for
    behind = np.clip(np.searchsorted(places, cells + 1e-6, "right") - 1, 0, None)
    times = anchor + np.round(cells * interval).astype(np.int64)
    return Rows(times, np.interp(cells, places, rows.values), rows.number[behind], stands_for)


def parts_of(
    rows: Rows, stretches: Sequence[Stretch], interval: float, book: Book, name: str, same_place: str, max_fill: int, min_part: int
) -> tuple[list[Part], int]:
    """Regular parts with their short gaps filled.

    Args:
        rows: The rows.
        stretches: Where they lie on regular grids.
        interval: The sampling interval in nanoseconds.
        book: Takes what is found.
        name: Channel name, for messages.
        same_place: Which of rows that share a place is taken: mean, first, last or refuse.
        max_fill: Longest gap inside a stretch, in samples.
        min_part: Shortest part that is kept, in samples.

    Returns:
        The parts, and how many rows their samples stand for.
    """
    parts, used, merged, short, gaps, num_filled, num_coarse = [], 0, [], [], [], 0, 0
    off = np.zeros(len(rows))
    for stretch in stretches:
        inside, length = rows.take(stretch.rows), int(stretch.places[-1]) + 1
        if length < min_part:
            short.append(inside.number[inside.stands_for > 0])
            continue
        off[stretch.rows] = stretch.off
        inside, left = _merged(inside, stretch.places, same_place)
        if same_place == "refuse" and len(left):
            raise InputError(
                f"Expected one row for each interval of {interval / 1e9:.6g} s. Received: another at {book.place(left[0])} of {name}. "
                "Give same_time='mean'."
            )
        merged.append(left)
        places, samples = np.unique(stretch.places), np.arange(length)
        behind = np.searchsorted(places, samples, "right") - 1
        parts.append(Part(stretch.begin, np.interp(samples, places, inside.values), inside.number[behind]))
        used += int(inside.stands_for.sum())
        gaps.append(inside.number[:-1][np.diff(places) > 1])
        num_filled += length - len(places)
        num_coarse += int((inside.stands_for == 0).sum())
    if not parts:
        longest = max(int(stretch.places[-1]) + 1 for stretch in stretches)
        raise InputError(
            f"Expected regular samples, at least {min_part} in a row. Received: {longest} at most, every {interval / 1e9:.6g} s, in {name}. "
            "Give interval_s, a longer max_fill or a shorter min_part."
        )
    _tell_breaks(rows, stretches, interval, book, max_fill)
    _tell_jitter(rows, off, interval, book)
    for kind, found, text in (
        ("averaged", merged, f"rows that share an interval with another, of which the {same_place} was taken: {{count}}"),
        ("short parts", short, f"rows in parts of fewer than {min_part:,} samples ({len(short):,} such parts): {{count}}"),
    ):
        numbers = np.concatenate([*found, rows.number[:0]])
        book.add(kind, numbers, text, rows_left_out=len(numbers))
    begins = np.concatenate(gaps)
    text = f"gaps of up to {max_fill} samples, filled by straight lines with {num_filled:,} samples in all: {{count}}"
    book.add("gaps filled", begins, text, samples_filled=num_filled)
    book.fill("coarser stretches", num_coarse)
    return parts, used


def _tell_breaks(rows: Rows, stretches: Sequence[Stretch], interval: float, book: Book, max_fill: int) -> None:
    before = np.array([stretch.rows.stop - 1 for stretch in stretches[:-1]], np.int64)
    steps = (rows.times[before + 1] - rows.times[before]) / interval
    is_gap = np.round(steps) > max_fill + 1
    unit = 1.0 if book.times is None else interval / 1e9
    longest, what = steps.max(initial=0) * unit, "samples" if book.times is None else "s"
    text = f"gaps of more than {max_fill} samples, the longest {longest:.6g} {what}, that part the series: {{count}}"
    book.add("gaps", rows.number[before[is_gap]], text, details={"longest": float(longest)})
    book.add("clock steps", rows.number[before[~is_gap]], "jumps of the clock that part the series: {count}")


def _tell_jitter(rows: Rows, off: np.ndarray, interval: float, book: Book) -> None:
    share = np.abs(off) / interval
    snapped = np.flatnonzero(share > 1e-3)  # below it, times that were rounded when they were written
    largest = float(share.max()) * interval / 1e9
    worst = rows.number[snapped[np.argsort(-share[snapped], kind="stable")]]
    text = f"times off the regular grid, by up to {largest:.4g} s ({share.max():.0%} of an interval), snapped to it: {{count}}"
    book.add("jitter", worst, text, details={"largest_s": largest})
