"""The steps from the rows of a raw channel to regular samples: unique times, one sampling rate, parts without gaps.

Each step drops, merges or adds rows and records what it did in the `CleaningLog`.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.regular_grid import OtherRateSegment, Segment, find_other_rates
from enhsim_tf.telemetry.cleaning.report import CleaningLog


@dataclasses.dataclass
class Rows:
    """The rows that are still in use, in chronological order. All arrays have the shape `(rows,)`.

    Args:
        times: Times in nanoseconds, int64.
        values: Values, float64; a missing value is NaN or infinite.
        source_row: Number of the row in the source.
        from_source: 1 for a row of the source, 0 for an interpolated row.
    """

    times: np.ndarray
    values: np.ndarray
    source_row: np.ndarray
    from_source: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    def take(self, which: np.ndarray | slice) -> "Rows":
        """Selects rows by index, mask or slice."""
        return Rows(self.times[which], self.values[which], self.source_row[which], self.from_source[which])


@dataclasses.dataclass(frozen=True)
class Part:
    """Regular samples without a gap.

    Args:
        begin: Time of the first sample in nanoseconds, a float because the grid need not lie on whole nanoseconds.
        values: float64 array of shape `(samples,)`.
        source_row: For each sample, its row in the source. A filled sample has the number of the last row before it.
    """

    begin: float
    values: np.ndarray
    source_row: np.ndarray


def drop_duplicate_timestamps(rows: Rows, bad: np.ndarray, log: CleaningLog, name: str, same_time: str | None, bins: bool) -> Rows:
    """Keeps one row for each time.

    Args:
        rows: The rows.
        bad: Mask of the source rows whose value cannot be read.
        log: The cleaning log, to which findings are added.
        name: Channel name, for messages.
        same_time: Which of several values is kept: mean, first, last or refuse. None: the mean, if this merges less than half of the rows.
        bins: Whether rows are averaged over given intervals, so that the mean may merge any number.

    Returns:
        Rows with unique times.

    Raises:
        InputError: If a time has several values and `same_time` is "refuse", or None where it would merge most rows.
    """
    values = np.where(bad[rows.source_row], np.inf, rows.values)  # an unreadable value is not a duplicate of a missing one
    is_copy = pd.DataFrame({"time": rows.times, "value": values}).duplicated().to_numpy()
    copies = rows.source_row[is_copy]
    log.add("duplicate rows", copies, "rows that repeat the time and value of another: {count}", rows_left_out=len(copies))
    rows = rows.take(~is_copy)
    kept, left = _merge_groups(rows, rows.times, same_time or "mean")
    if same_time is None and not bins and 2 * len(left) >= len(rows) > 2:
        raise InputError(
            f"Expected a time for each row. Received: {len(rows):,} rows of {name} with {len(kept):,} different times. If they belong to several "
            "series, give series_column (--series-column); if the clock lost digits, give interval_s (--interval) or same_time='mean'."
        )
    if same_time == "refuse" and len(left):
        raise InputError(
            f"Expected one value for each time. Received: {len(left):,} more in {name}, the first at {log.place(left[0])}. Give same_time='mean'."
        )
    log.add(
        "same time",
        left,
        f"rows with another value at the same time, of which the {same_time or 'mean'} was taken: {{count}}",
        rows_left_out=len(left),
    )
    return kept


def _merge_groups(rows: Rows, groups: np.ndarray, how: str) -> tuple[Rows, np.ndarray]:
    """Merges each group of neighbouring rows into one row; also returns the source rows that were merged into others."""
    if not np.any(groups[1:] == groups[:-1]):
        return rows, rows.source_row[:0]
    has_value, real = np.isfinite(rows.values), rows.from_source > 0
    order = np.arange(len(rows)) * (-1 if how == "last" else 1)
    ranked = np.lexsort((order, ~real, ~has_value, groups))  # within each group, rows with a value come first
    chosen = ranked[np.flatnonzero(np.diff(groups[ranked], prepend=groups[ranked[0]] - 1))]
    kept = rows.take(chosen)
    if how not in ("first", "last"):
        means = pd.Series(np.where(has_value, rows.values, np.nan)).groupby(groups).mean().to_numpy()
        kept.values = np.where(np.isfinite(means), means, kept.values)
    is_left = real.copy()
    is_left[chosen] = False
    return kept, rows.source_row[is_left]


def drop_missing_values(rows: Rows, bad: np.ndarray, log: CleaningLog, name: str) -> Rows:
    """Drops rows without a value.

    Args:
        rows: The rows.
        bad: Mask of the source rows whose value cannot be read.
        log: The cleaning log, to which findings are added.
        name: Channel name, for messages.

    Returns:
        The rows with finite values.

    Raises:
        InputError: If no row has a value.
    """
    has_value = np.isfinite(rows.values)
    unread, missing = rows.source_row[~has_value & bad[rows.source_row]], rows.source_row[~has_value & ~bad[rows.source_row]]
    log.add("bad values", unread, "values that cannot be read, taken as missing: {count}", rows_left_out=len(unread))
    log.add("missing values", missing, "rows without a value (NaN, infinite or empty), taken as gaps: {count}", rows_left_out=len(missing))
    if not has_value.any():
        raise InputError(f"Expected values. Received: only missing ones in {name}. Choose another channel.")
    return rows.take(has_value)


def resample_to_common_interval(rows: Rows, interval: float, log: CleaningLog, resample: bool, max_fill: int) -> Rows:
    """Resamples stretches with another sampling rate to the common interval, or leaves them out.

    Args:
        rows: The rows.
        interval: The common sampling interval in nanoseconds.
        log: The cleaning log, to which findings are added.
        resample: Whether to resample such stretches. Stretches that are slower than `max_fill` allows are left out in any case.
        max_fill: Largest number of samples that are interpolated between two rows.

    Returns:
        Rows of one sampling rate.
    """
    pieces, done, left = [], 0, []
    finer, coarser, merged = [], [], 0
    for segment in find_other_rates(rows.times, interval):
        first, last = max(segment.first, done), segment.last
        if first >= last:  # a faster and a slower stretch share at most one row
            continue
        pieces.append(rows.take(slice(done, first)))
        inside, done = rows.take(slice(first, last + 1)), last + 1
        if not resample or segment.longest - 1 > max_fill:
            ends = np.array(
                [0] * (first > 0) + [-1] * (last < len(rows) - 1), np.int64
            )  # the end rows also belong to the neighbouring stretches
            pieces.append(inside.take(ends))
            left.append(np.delete(inside.source_row, ends))
            continue
        (finer if segment.ratio < 1 else coarser).append((inside.source_row[0], segment.ratio))
        pieces.append(_resample_segment(inside, interval, segment, from_last=first == 0))
        merged += int(inside.from_source.sum() - pieces[-1].from_source.sum())
    for kind, found, how in (("finer stretches", finer, "averaged"), ("coarser stretches", coarser, "interpolated")):
        steps = " or ".join(dict.fromkeys(f"{ratio * interval / 1e9:.4g}" for _, ratio in found[:3]))
        text = f"stretches with a row every {steps} s instead of {interval / 1e9:.6g} s, {how}: {{count}}"
        log.add(kind, [number for number, _ in found], text, rows_left_out=merged if found is finer else 0)
    if left:
        numbers = np.concatenate(left)
        log.add("other rates", numbers, f"rows in {len(left):,} stretches of another rate: {{count}}", rows_left_out=len(numbers))
    pieces.append(rows.take(slice(done, None)))
    return Rows(*(np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in dataclasses.fields(Rows)))


def _resample_segment(rows: Rows, interval: float, segment: OtherRateSegment, from_last: bool) -> Rows:
    """Resamples a stretch to the grid of its neighbour: averages faster rows, interpolates linearly between slower ones."""
    anchor = int(rows.times[-1 if from_last else 0])
    places = (rows.times - anchor) / interval
    if segment.ratio < 1:
        cells = np.round(places).astype(np.int64)
        kept, _ = _merge_groups(rows, cells, "mean")
        kept.times = anchor + np.round(np.unique(cells) * interval).astype(np.int64)
        return kept
    cells = np.arange(np.ceil(places[0] - 1e-6), np.floor(places[-1] + 1e-6) + 1)
    from_source = np.zeros(len(cells), np.int64)
    from_source[np.clip(np.round(places - cells[0]).astype(np.int64), 0, len(cells) - 1)] = rows.from_source
    previous = np.clip(np.searchsorted(places, cells + 1e-6, "right") - 1, 0, None)
    times = anchor + np.round(cells * interval).astype(np.int64)
    return Rows(times, np.interp(cells, places, rows.values), rows.source_row[previous], from_source)


def build_parts(
    rows: Rows,
    segments: Sequence[Segment],
    interval: float,
    log: CleaningLog,
    name: str,
    same_place: str,
    max_fill: int,
    min_part: int,
    hold: bool = False,
) -> tuple[list[Part], int]:
    """Builds regular parts and fills their short gaps.

    Args:
        rows: The rows.
        segments: Segments of the rows that lie on a regular grid.
        interval: The sampling interval in nanoseconds.
        log: The cleaning log, to which findings are added.
        name: Channel name, for messages.
        same_place: Which of several rows at one grid point is kept: mean, first, last or refuse.
        max_fill: Longest gap inside a segment, in samples.
        min_part: Shortest part that is kept, in samples.
        hold: Whether gaps are filled with the value before them, and not by linear interpolation.

    Returns:
        The parts, and the number of source rows that their samples represent.

    Raises:
        InputError: If no part is long enough, or several rows share a grid point and `same_place` is "refuse".
    """
    parts, used, merged, short, gaps, num_filled, num_coarse = [], 0, [], [], [], 0, 0
    off = np.zeros(len(rows))
    for segment in segments:
        inside, length = rows.take(segment.rows), int(segment.places[-1]) + 1
        if length < min_part:
            short.append(inside.source_row[inside.from_source > 0])
            continue
        off[segment.rows] = segment.off
        inside, left = _merge_groups(inside, segment.places, same_place)
        if same_place == "refuse" and len(left):
            raise InputError(
                f"Expected one row for each interval of {interval / 1e9:.6g} s. Received: another at {log.place(left[0])} of {name}. "
                "Give same_time='mean'."
            )
        merged.append(left)
        places, samples = np.unique(segment.places), np.arange(length)
        previous = np.searchsorted(places, samples, "right") - 1
        values = inside.values[previous] if hold else np.interp(samples, places, inside.values)
        parts.append(Part(segment.begin, values, inside.source_row[previous]))
        used += int(inside.from_source.sum())
        gaps.append(inside.source_row[:-1][np.diff(places) > 1])
        num_filled += length - len(places)
        num_coarse += int((inside.from_source == 0).sum())
    if not parts:
        longest = max(int(segment.places[-1]) + 1 for segment in segments)
        raise InputError(
            f"Expected regular samples, at least {min_part} in a row. Received: {longest} at most, every {interval / 1e9:.6g} s, in {name}. "
            "Give interval_s (--interval), a longer max_fill (--max-fill) or a shorter min_part."
        )
    _log_breaks(rows, segments, interval, log, max_fill)
    _log_jitter(rows, off, interval, log)
    for kind, found, text in (
        ("averaged", merged, f"rows that share an interval with another row, of which the {same_place} was taken: {{count}}"),
        ("short parts", short, f"rows in parts of fewer than {min_part:,} samples ({len(short):,} such parts): {{count}}"),
    ):
        numbers = np.concatenate([*found, rows.source_row[:0]])
        log.add(kind, numbers, text, rows_left_out=len(numbers))
    begins = np.concatenate(gaps)
    how = "filled with the value before them," if hold else "filled by straight lines with"
    text = f"gaps of up to {max_fill} samples, {how} {num_filled:,} samples in total: {{count}}"
    log.add("gaps filled", begins, text, samples_filled=num_filled)
    log.set_samples_filled("coarser stretches", num_coarse)
    return parts, used


def _log_breaks(rows: Rows, segments: Sequence[Segment], interval: float, log: CleaningLog, max_fill: int) -> None:
    before = np.array([segment.rows.stop - 1 for segment in segments[:-1]], np.int64)
    steps = (rows.times[before + 1] - rows.times[before]) / interval
    is_gap = np.round(steps) > max_fill + 1
    unit = 1.0 if log.times is None else interval / 1e9
    longest, what = steps.max(initial=0) * unit, "samples" if log.times is None else "s"
    text = f"gaps of more than {max_fill} samples, the longest {longest:.6g} {what}, at which the series is split: {{count}}"
    log.add("gaps", rows.source_row[before[is_gap]], text, details={"longest": float(longest)})
    log.add("clock steps", rows.source_row[before[~is_gap]], "jumps of the clock, at which the series is split: {count}")


def _log_jitter(rows: Rows, off: np.ndarray, interval: float, log: CleaningLog) -> None:
    share = np.abs(off) / interval
    snapped = np.flatnonzero(share > 1e-3)  # smaller deviations come from rounded times
    largest = float(share.max()) * interval / 1e9
    worst = rows.source_row[snapped[np.argsort(-share[snapped], kind="stable")]]
    text = f"times off the regular grid, by up to {largest:.4g} s ({share.max():.0%} of an interval), snapped to it: {{count}}"
    log.add("jitter", worst, text, details={"largest_s": largest})
