"""Turns the rows of a raw channel into regular samples: unique times, one sampling interval, parts without long gaps.

Times are int64 nanoseconds. Each step drops or merges rows, or fills samples, and records this in the `CleaningLog`.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import CleaningLog
from enhsim_tf.telemetry.windows import runs_of

_ALIKE = (0.8, 1.25)  # steps within these factors have the same rate; with jitter of a quarter, means of four steps stay inside
_RUN = 4  # smallest number of consecutive steps that form a stretch with another rate
_LEAST_REGULAR = 0.4  # share of the steps that are whole numbers of intervals; random times reach 0.25


@dataclasses.dataclass
class Rows:
    """The rows that are still in use, in chronological order. All arrays have the shape `(rows,)`."""

    times: np.ndarray  # int64 nanoseconds
    values: np.ndarray  # float64; a missing value is NaN or infinite
    source_row: np.ndarray  # number of the row in the source

    def __len__(self) -> int:
        return len(self.times)

    def take(self, which: np.ndarray | slice) -> "Rows":
        """Selects rows by index, mask or slice."""
        return Rows(self.times[which], self.values[which], self.source_row[which])


@dataclasses.dataclass(frozen=True)
class Part:
    """Regular samples without a gap. Both arrays have the shape `(samples,)`."""

    begin: float  # time of the first sample in nanoseconds, which need not be whole ones
    values: np.ndarray  # float64
    source_row: np.ndarray  # row of each sample in the source; of a filled one, the last row before it


@dataclasses.dataclass(frozen=True)
class _Segment:
    """Rows that lie on one regular grid: their slice, the grid point of each in ascending order, the time of point 0, and their distances."""

    rows: slice
    places: np.ndarray
    begin: float
    off: np.ndarray


def regularise(rows: Rows, bad: np.ndarray, log: CleaningLog, name: str, options: Cleaning) -> tuple[list[Part], int, float]:
    """Turns rows into regular parts; `bad` marks the source rows whose value cannot be read.

    Returns:
        The parts, the number of rows that their samples represent, and the interval in nanoseconds.
    """
    rows = _drop_missing_values(_drop_duplicate_times(rows, bad, log, name, options), bad, log, name)
    holds, longest = options.fill == "hold", options.longest_gap + 1
    by_interval = options.interval_s is not None or holds
    if log.times is None:
        interval = 1e9
    elif options.interval_s is not None:
        interval = options.interval_s * 1e9
    elif len(rows) < 2:
        raise InputError(
            f"Expected at least 2 rows to infer the interval. Received: 1 usable row from {name}. Give interval_s (--interval)."
        )
    else:
        interval = find_interval(rows.times)
        if regular_step_fraction(rows.times, interval) < _LEAST_REGULAR:
            raise InputError(
                f"Expected roughly regular times. Received: steps from {np.diff(rows.times).min() / 1e9:g} s to "
                f"{np.diff(rows.times).max() / 1e9:g} s without a common interval, in {name}. "
                "Give interval_s (--interval), and fill='hold' (--fill hold) for telemetry that is sent only when it changes."
            )
        other = np.flatnonzero(_have_other_rate(rows.times, interval))
        if len(other) and not holds:  # a long step of telemetry that is held is no slower rate
            by_interval = True
            usual = f"one every {interval / 1e9:.6g} s, to which they are averaged or filled"
            log.add("other rates", rows.source_row[other], f"rows in stretches of another rate than {usual}: {{count}}")
    segments = _binned(rows.times, interval, longest) if by_interval else _regular(rows.times, interval, options.max_jitter, longest)
    same_place = "last" if holds else "mean" if by_interval else options.same_time or "mean"
    parts, used = _build_parts(rows, segments, interval, log, name, same_place, options)
    return parts, used, interval


def find_interval(times: np.ndarray) -> float:
    """Finds the sampling interval, in nanoseconds, that most of at least two rows with different times have."""
    steps = np.sort(np.diff(times).astype(np.float64))
    near = np.searchsorted(steps, _ALIKE[1] * steps, "right") - np.searchsorted(steps, _ALIKE[0] * steps, "left")
    most = steps[np.argmax(near)]
    interval = float(np.median(steps[(_ALIKE[0] * most <= steps) & (steps <= _ALIKE[1] * most)]))
    return _refined(times, interval)


def _refined(times: np.ndarray, interval: float) -> float:
    """Refines the interval on the longest run without long gaps: the step that 90 % of the rows have, or the slope of a fitted line."""
    steps = np.diff(times).astype(np.float64)
    numbers = np.round(steps / interval)
    near = (numbers >= 1) & (numbers <= 3)
    first, last = _longest_run(near)
    sure = _longest_run(near & (np.abs(steps / interval - numbers) <= 0.25))  # excludes jumps of the clock
    if 2 * (sure[1] - sure[0]) >= last - first:
        first, last = sure
    places = np.concatenate([[0], np.cumsum(numbers[first:last])])
    since = (times[first : last + 1] - times[first]).astype(np.float64)
    common, counts = np.unique(steps[first:last] / numbers[first:last], return_counts=True)
    step = float(common[np.argmax(counts)])
    if counts.max() >= 0.9 * (last - first) and np.ptp(since - places * step) <= 0.5 * step:
        return step
    centred = places - places.mean()
    slope = float(centred @ since / (centred @ centred))
    plain = (float(f"{slope:.{digits}e}") for digits in range(15))  # fewest digits that fit as well
    return next((number for number in plain if abs(number - slope) * places[-1] <= 0.05 * slope), slope)


def _longest_run(marks: np.ndarray) -> tuple[int, int]:
    return max(runs_of(marks), key=lambda run: run[1] - run[0], default=(0, 0))


def regular_step_fraction(times: np.ndarray, interval: float) -> float:
    """Fraction of the steps that are close to a whole number of intervals; about a quarter for random times."""
    ratios = np.diff(times) / interval
    numbers = np.round(ratios)
    return float(np.mean((numbers >= 1) & (np.abs(ratios - numbers) <= 0.25)))


def _have_other_rate(times: np.ndarray, interval: float) -> np.ndarray:
    """Marks rows in stretches whose steps are all shorter than the interval, or all longer and similar to each other."""
    ratios, marks = np.diff(times) / interval, np.zeros(len(times), bool)
    if len(ratios) < _RUN:
        return marks
    windows = np.lib.stride_tricks.sliding_window_view(ratios, _RUN)
    lowest, highest = windows.min(axis=1), windows.max(axis=1)
    starts = np.flatnonzero((highest < _ALIKE[0]) | (lowest > _ALIKE[1]) & (highest < 1.3 * lowest))
    marks[(starts[:, None] + np.arange(_RUN + 1)).ravel()] = True
    return marks


def _drop_duplicate_times(rows: Rows, bad: np.ndarray, log: CleaningLog, name: str, options: Cleaning) -> Rows:
    """Keeps one row for each time. A mean that would merge most rows must be asked for."""
    same_time = options.same_time
    values = np.where(bad[rows.source_row], np.inf, rows.values)  # an unreadable value is not a duplicate of a missing one
    is_copy = pd.DataFrame({"time": rows.times, "value": values}).duplicated().to_numpy()
    copies = rows.source_row[is_copy]
    log.add("duplicate rows", copies, "rows that repeat the time and value of another: {count}", rows_left_out=len(copies))
    rows = rows.take(~is_copy)
    kept, left = _merge_groups(rows, rows.times, same_time or "mean")
    if same_time is None and options.interval_s is None and 2 * len(left) >= len(rows) > 2:
        raise InputError(
            f"Expected a time for each row. Received: {len(rows):,} rows of {name} with {len(kept):,} different times. If they belong to several "
            "series, give series_column (--series-column); if the clock lost digits, give interval_s (--interval) or same_time='mean'."
        )
    text = f"rows with another value at the same time, of which the {same_time or 'mean'} was taken: {{count}}"
    log.add("same time", left, text, rows_left_out=len(left))
    return kept


def _merge_groups(rows: Rows, groups: np.ndarray, how: str) -> tuple[Rows, np.ndarray]:
    """Merges each group of neighbouring rows into one row; also returns the source rows that were merged into others."""
    if not np.any(groups[1:] == groups[:-1]):
        return rows, rows.source_row[:0]
    has_value = np.isfinite(rows.values)
    order = np.arange(len(rows)) * (-1 if how == "last" else 1)
    ranked = np.lexsort((order, ~has_value, groups))  # within each group, rows with a value come first
    chosen = ranked[np.flatnonzero(np.diff(groups[ranked], prepend=groups[ranked[0]] - 1))]
    kept = rows.take(chosen)
    if how != "last":
        means = pd.Series(np.where(has_value, rows.values, np.nan)).groupby(groups).mean().to_numpy()
        kept.values = np.where(np.isfinite(means), means, kept.values)
    return kept, np.delete(rows.source_row, chosen)


def _drop_missing_values(rows: Rows, bad: np.ndarray, log: CleaningLog, name: str) -> Rows:
    """Drops rows without a finite value."""
    has_value = np.isfinite(rows.values)
    unread, missing = rows.source_row[~has_value & bad[rows.source_row]], rows.source_row[~has_value & ~bad[rows.source_row]]
    log.add("bad values", unread, "values that cannot be read, taken as missing: {count}", rows_left_out=len(unread))
    log.add("missing values", missing, "rows without a value (NaN, infinite or empty), taken as gaps: {count}", rows_left_out=len(missing))
    if not has_value.any():
        raise InputError(f"Expected values. Received: only missing ones in {name}. Choose another channel.")
    return rows.take(has_value)


def _regular(times: np.ndarray, interval: float, max_jitter: float, max_step: int) -> list[_Segment]:
    """Splits a series, also at jumps of the clock, into segments on regular grids with the same interval and individual start times."""
    ratios = np.diff(times) / interval
    numbers = np.round(ratios)
    whole = (numbers <= max_step) & (np.abs(ratios - numbers) <= 2 * max_jitter + 1e-9)
    segments = []
    for start, stop in _between(~whole):
        all_places = np.concatenate([[0], np.cumsum(numbers[start : stop - 1])]).astype(np.int64)
        all_off = (times[start:stop] - times[start]) - all_places * interval
        first = 0
        while first < stop - start:
            end = first + _end_of_spread(all_off[first:], 2 * max_jitter * interval + 0.5)
            places, off = all_places[first:end] - all_places[first], all_off[first:end] - all_off[first]
            middle = float(np.median(off))
            if np.abs(off - middle).max() > max_jitter * interval:
                middle = float(off.max() + off.min()) / 2
            segments.append(_Segment(slice(start + first, start + end), places, float(times[start + first]) + middle, off - middle))
            first = end
    return segments


def _between(breaks: np.ndarray) -> list[tuple[int, int]]:
    """First row and end (exclusive) of each run of rows, where `breaks` marks the steps between rows at which a run ends."""
    edges = [0, *(np.flatnonzero(breaks) + 1).tolist(), len(breaks) + 1]
    return list(zip(edges[:-1], edges[1:], strict=True))


def _end_of_spread(values: np.ndarray, spread: float) -> int:
    """Length of the longest prefix of `values` whose range is at most `spread`."""
    low = high = values[0]
    size, begin = 1_024, 0
    while begin < len(values):
        block = values[begin : begin + size]
        lows, highs = np.minimum(np.minimum.accumulate(block), low), np.maximum(np.maximum.accumulate(block), high)
        wide = highs - lows > spread
        if wide.any():
            return begin + int(np.argmax(wide))
        low, high = lows[-1], highs[-1]
        begin, size = begin + size, 2 * size
    return len(values)


def _binned(times: np.ndarray, interval: float, max_step: int) -> list[_Segment]:
    """Splits a series at its long gaps and assigns every row to the nearest point of one grid that starts at the first row."""
    places = np.round((times - times[0]) / interval).astype(np.int64)
    segments = []
    for start, stop in _between(np.diff(places) > max_step):
        begin = float(times[0]) + places[start] * interval
        inside = places[start:stop] - places[start]
        segments.append(_Segment(slice(start, stop), inside, begin, times[start:stop] - begin - inside * interval))
    return segments


def _build_parts(
    rows: Rows, segments: Sequence[_Segment], interval: float, log: CleaningLog, name: str, same_place: str, options: Cleaning
) -> tuple[list[Part], int]:
    """Builds regular parts, fills their short gaps, and counts the rows that they use. Of several rows at one grid point, one is kept."""
    parts, used, merged, short, gaps, num_filled = [], 0, [], [], [], 0
    off, holds = np.zeros(len(rows)), options.fill == "hold"
    for segment in segments:
        inside, length = rows.take(segment.rows), int(segment.places[-1]) + 1
        if length < options.min_part:
            short.append(inside.source_row)
            continue
        off[segment.rows] = segment.off
        inside, left = _merge_groups(inside, segment.places, same_place)
        merged.append(left)
        places, samples = np.unique(segment.places), np.arange(length)
        previous = np.searchsorted(places, samples, "right") - 1
        values = inside.values[previous] if holds else np.interp(samples, places, inside.values)
        parts.append(Part(segment.begin, values, inside.source_row[previous]))
        used += len(inside)
        gaps.append(inside.source_row[:-1][np.diff(places) > 1])
        num_filled += length - len(places)
    if not parts:
        longest = max(int(segment.places[-1]) + 1 for segment in segments)
        raise InputError(
            f"Expected regular samples, at least {options.min_part} in a row. Received: {longest} at most, every {interval / 1e9:.6g} s, in {name}. "
            "Give interval_s (--interval), a longer max_fill (--max-fill), or a smaller min_part (of `fit`, --window)."
        )
    _log_breaks(rows, segments, interval, log, options.longest_gap)
    _log_jitter(rows, off, interval, log)
    for kind, found, text in (
        ("averaged", merged, f"rows that share an interval with another row, of which the {same_place} was taken: {{count}}"),
        ("short parts", short, f"rows in parts of fewer than {options.min_part:,} samples ({counted(len(short), 'such part')}): {{count}}"),
    ):
        numbers = np.concatenate([*found, rows.source_row[:0]])
        log.add(kind, numbers, text, rows_left_out=len(numbers))
    how = "filled with the value before them," if holds else "filled by straight lines with"
    text = f"gaps of up to {counted(options.longest_gap, 'sample')}, {how} {counted(num_filled, 'sample')} in total: {{count}}"
    log.add("gaps filled", np.concatenate(gaps), text, samples_filled=num_filled)
    return parts, used


def _log_breaks(rows: Rows, segments: Sequence[_Segment], interval: float, log: CleaningLog, max_fill: int) -> None:
    before = np.array([segment.rows.stop - 1 for segment in segments[:-1]], np.int64)
    steps = (rows.times[before + 1] - rows.times[before]) / interval
    is_gap = np.round(steps) > max_fill + 1
    unit = 1.0 if log.times is None else interval / 1e9
    longest, what = steps.max(initial=0) * unit, "samples" if log.times is None else "s"
    text = f"gaps of more than {counted(max_fill, 'sample')}, the longest {longest:.6g} {what}, at which the series is split: {{count}}"
    log.add("gaps", rows.source_row[before[is_gap]], text, details={"longest": float(longest)})
    log.add("clock steps", rows.source_row[before[~is_gap]], "jumps of the clock, at which the series is split: {count}")


def _log_jitter(rows: Rows, off: np.ndarray, interval: float, log: CleaningLog) -> None:
    share = np.abs(off) / interval
    snapped = np.flatnonzero(share > 1e-3)  # smaller deviations come from rounded times
    largest = float(share.max()) * interval / 1e9
    worst = rows.source_row[snapped[np.argsort(-share[snapped], kind="stable")]]
    text = f"times off the regular grid, by up to {largest:.4g} s ({share.max():.0%} of an interval), snapped to it: {{count}}"
    log.add("jitter", worst, text, details={"largest_s": largest})
