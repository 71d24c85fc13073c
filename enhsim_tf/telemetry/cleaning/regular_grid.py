"""Turns the rows of a raw channel into regular samples: unique times, one sampling interval, parts
without long gaps.

Times are int64 nanoseconds. Each step drops or merges rows, or fills samples, and records this in
the `CleaningLog`.
"""

import dataclasses

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import CleaningLog
from enhsim_tf.telemetry.cleaning.times import ClockError
from enhsim_tf.telemetry.windows import runs_of

# steps within these factors have the same rate; with jitter of a quarter, means of four steps stay
# inside
_ALIKE = (0.8, 1.25)
_RUN = 4  # smallest number of consecutive steps that form a stretch with another rate
# largest distance of a time from the regular grid, in intervals; the series is split where it is
# larger
_MAX_JITTER = 0.25
# share of the steps that are whole numbers of intervals; random times reach 0.25
_LEAST_REGULAR = 0.4
# a clock of which most steps differ by less than this share from the median has jitter
_JITTERED = 0.6
_MOSTLY = 0.9
# times that leave the grid more often than once in sixteen rows do not keep to it
_FEW_BREAKS = 0.5
_SHORT = 8
_MOSTLY_FILLED = 1 / 3


@dataclasses.dataclass(frozen=True)
class Part:
    """Regular samples without a gap. Both arrays have the shape `(samples,)`."""

    begin: float  # time of the first sample in nanoseconds, which need not be whole ones
    values: np.ndarray  # float64
    # row of each sample in the source; of a filled one, the last row before it
    source_row: np.ndarray
    measured: np.ndarray  # whether it was measured, and not filled in


def regularise(
    rows: pd.DataFrame, bad: np.ndarray, log: CleaningLog, options: Cleaning
) -> tuple[list[Part], int, float]:
    """Turns rows into regular parts.

    Args:
        rows: The rows that have a time, in chronological order: `time` in nanoseconds, `value`, NaN
            or infinite where it is missing, and `row`, their number in the source.
        bad: Which rows of the source have a value that cannot be read.
        log: Receives what is found.
        options: How problems are treated.

    Returns:
        The parts, the number of rows that their samples represent, and the interval in nanoseconds.
    """
    steps = np.diff(rows["time"])
    values = rows["value"].to_numpy()
    step = steps[0] if len(steps) >= options.min_part else 0
    is_plain = step > 0 and (steps == step).all() and np.isfinite(values).all()
    if is_plain and options.interval_s in (None, step / 1e9):  # nothing to be done
        part = Part(0.0, values, rows["row"].to_numpy(), np.ones(len(rows), bool))
        return [part], len(rows), float(step)
    rows = _drop_duplicate_times(_drop_missing_values(rows, bad, log), log, options)
    times = rows["time"].to_numpy()
    holds = options.fill == "hold"
    by_interval = options.interval_s is not None or holds
    if log.times is None:
        interval = 1e9
    elif options.interval_s is not None:
        interval = options.interval_s * 1e9
    elif len(rows) < 2:
        raise InputError(
            "Expected at least 2 rows to infer the interval. Received: 1 usable row from "
            f"{log.channel}.",
            otherwise="telemetry with more rows",
        )
    else:
        interval = find_interval(times)
        steps = np.diff(times)
        is_regular = regular_step_fraction(times, interval) >= _LEAST_REGULAR
        usual = float(np.median(steps))
        if not is_regular and np.mean(np.abs(steps / usual - 1) < _JITTERED) < _MOSTLY:
            rounded = {"interval_s": float(f"{usual / 1e9:.3g}")}
            raise InputError(
                "Expected roughly regular times. Received: steps from "
                f"{steps.min() / 1e9:g} s to {steps.max() / 1e9:g} s without a common interval, in "
                f"{log.channel}.",
                [rounded, rounded | {"fill": "hold"}],
                "--fill hold for telemetry that is sent only when it changes",
            )
        other = np.flatnonzero(_have_other_rate(times, interval))
        # a long step of telemetry that is held is no slower rate
        if len(other) and not by_interval:
            by_interval = True
            usual = f"one every {interval / 1e9:.6g} s, to which they are averaged or filled"
            log.add(
                "other rates",
                rows["row"].to_numpy()[other],
                f"rows in stretches of another rate than {usual}: {{count}}",
            )
        begins = _begins(times, interval, _SHORT, by_interval)[1]
        num_breaks = begins.sum() - (np.round(steps / interval) > _SHORT).sum()
        if not by_interval and (not is_regular or _SHORT * num_breaks > _FEW_BREAKS * len(times)):
            by_interval = True
            interval = float(f"{usual:.6g}")
            log.add(
                "jitter",
                (),
                f"the steps of the clock vary; rows are averaged or filled at the median rate, one "
                f"every {interval / 1e9:.6g} s",
                count=len(times),
            )
    rows, begins = _on_grids(rows, interval, options.longest_gap + 1, by_interval)
    how = "last" if holds else "mean" if by_interval else options.same_time
    return *_build_parts(rows, begins, interval, log, how, options), interval


def find_interval(times: np.ndarray) -> float:
    """Finds the sampling interval, in nanoseconds, that most of at least two rows with different
    times have.
    """
    steps = np.sort(np.diff(times).astype(np.float64))
    different = steps[np.append(True, np.diff(steps) > 0)]
    begins = np.searchsorted(steps, _ALIKE[0] * different, "left")
    ends = np.searchsorted(steps, _ALIKE[1] * different, "right")
    most = np.argmax(ends - begins)  # the step that most others are like
    interval = float(np.median(steps[begins[most] : ends[most]]))
    if regular_step_fraction(times, interval) < 0.9 and steps[-1] < 2 * steps[0]:
        # times that were cut, as 0, 2, 5, 7 of 0, 2.5, 5, 7.5, are never an interval off
        places = np.arange(len(times))
        usual = _slope(places, times - times[0])
        if np.ptp(times - times[0] - usual * places) < usual:
            return usual
    return _refined(times, interval)


def _refined(times: np.ndarray, interval: float) -> float:
    """Refines the interval on the longest run without long gaps: the step that 90 % of the rows
    have, or the slope of a fitted line.
    """
    steps = np.diff(times).astype(np.float64)
    numbers = np.round(steps / interval)
    near = (numbers >= 1) & (numbers <= 3)
    first, last = _longest_run(near)
    # excludes jumps of the clock
    sure = _longest_run(near & (np.abs(steps / interval - numbers) <= 0.25))
    if 2 * (sure[1] - sure[0]) >= last - first:
        first, last = sure
    places = np.concatenate([[0], np.cumsum(numbers[first:last])])
    since = (times[first : last + 1] - times[first]).astype(np.float64)
    common, counts = np.unique(steps[first:last] / numbers[first:last], return_counts=True)
    step = float(common[np.argmax(counts)])
    if counts.max() >= 0.9 * (last - first) and np.ptp(since - places * step) <= 0.5 * step:
        return step
    return _slope(places, since)


def _slope(places: np.ndarray, since: np.ndarray) -> float:
    """Returns the slope of a fitted line, rounded where that moves no time by a twentieth of it."""
    centred = places - places.mean()
    slope = float(centred @ since / (centred @ centred))
    plain = (float(f"{slope:.{digits}e}") for digits in range(15))  # fewest digits that fit as well
    return next(
        (number for number in plain if abs(number - slope) * places[-1] <= 0.05 * slope), slope
    )


def _longest_run(marks: np.ndarray) -> tuple[int, int]:
    return max(runs_of(marks), key=lambda run: run[1] - run[0], default=(0, 0))


def regular_step_fraction(times: np.ndarray, interval: float) -> float:
    """Fraction of the steps that are close to a whole number of intervals; about a quarter for
    random times.
    """
    ratios = np.diff(times) / interval
    numbers = np.round(ratios)
    return float(np.mean((numbers >= 1) & (np.abs(ratios - numbers) <= 0.25)))


def _have_other_rate(times: np.ndarray, interval: float) -> np.ndarray:
    """Marks rows in stretches whose steps are all shorter than the interval, or all longer and
    similar to each other.
    """
    ratios = np.diff(times) / interval
    marks = np.zeros(len(times), bool)
    if len(ratios) < _RUN:
        return marks
    # one row for each step of a stretch
    shifted = np.lib.stride_tricks.sliding_window_view(ratios, len(ratios) - _RUN + 1)
    lowest = shifted.min(axis=0)
    highest = shifted.max(axis=0)
    starts = np.flatnonzero((highest < _ALIKE[0]) | (lowest > _ALIKE[1]) & (highest < 1.3 * lowest))
    marks[(starts[:, None] + np.arange(_RUN + 1)).ravel()] = True
    return marks


def _drop_missing_values(rows: pd.DataFrame, bad: np.ndarray, log: CleaningLog) -> pd.DataFrame:
    """Drops rows without a finite value."""
    has_value = np.isfinite(rows["value"])
    missing = rows["row"][~has_value].to_numpy()
    is_bad = bad[missing]
    text = "values that cannot be read, taken as missing: {count}"
    log.add("bad values", missing[is_bad], text)
    text = "rows without a value (NaN, infinite or empty), taken as gaps: {count}"
    log.add("missing values", missing[~is_bad], text)
    if not has_value.any():
        raise InputError(
            f"Expected values. Received: only missing ones in {log.channel}. Choose another "
            "channel."
        )
    return rows[has_value]


def _drop_duplicate_times(rows: pd.DataFrame, log: CleaningLog, options: Cleaning) -> pd.DataFrame:
    """Keeps one row for each time. A mean that would merge most rows must be asked for, by an
    interval.
    """
    if (np.diff(rows["time"]) > 0).all():
        return rows
    is_copy = rows.duplicated(["time", "value"])
    copies = rows["row"][is_copy].to_numpy()
    log.add("duplicate rows", copies, "rows that repeat the time and value of another: {count}")
    rows = rows[~is_copy]
    kept, left = _merge_groups(rows, ["time"], options.same_time)
    if (
        options.same_time == "mean"
        and options.interval_s is None
        and 4 * len(left) >= len(rows) > 3
    ):
        raise ClockError(
            f"Expected a time for each row. Received: {len(rows):,} rows of {log.channel} with "
            f"{len(kept):,} different times, as of several series, or of a clock that lost digits.",
            [{"interval_s": float(f"{np.median(np.diff(kept['time'])) / 1e9:.6g}")}]
            if len(kept) > 1
            else (),
            "--series-column with the column that tells series apart, or dates with their time of "
            "day as 2024-03-01T12:00:00",
        )
    text = (
        f"rows with another value at the same time, of which the {options.same_time} was taken: "
        f"{{count}}"
    )
    log.add("same time", left, text)
    return kept


def _merge_groups(rows: pd.DataFrame, by: list[str], how: str) -> tuple[pd.DataFrame, np.ndarray]:
    """Merges rows that follow each other and are equal in some columns into one row; also returns
    the source rows that were merged into others.
    """
    is_same = np.all([np.diff(rows[name]) == 0 for name in by], axis=0)
    is_left = np.append(is_same, False) if how == "last" else np.append(False, is_same)
    kept = rows[~is_left]
    if how == "mean" and is_left.any():
        kept = kept.assign(value=rows.groupby(by)["value"].mean().to_numpy())
    return kept, rows["row"][is_left].to_numpy()


def _on_grids(
    rows: pd.DataFrame, interval: float, max_step: int, by_interval: bool
) -> tuple[pd.DataFrame, np.ndarray]:
    """Splits a series at gaps of more than `max_step` intervals and assigns every row to a point of
    a regular grid.

    With `by_interval`, this is the nearest point of one grid that starts at the first row.
    Otherwise each part has a grid of its own, and the series is also split where its times leave
    that grid, as at jumps of the clock.

    Returns:
        The rows with the number of their `part`, their `place` on its grid and their distance from
        that, `off`; the beginning of each part.
    """
    times = rows["time"].to_numpy()
    places, begins = _begins(times, interval, max_step, by_interval)
    part = np.cumsum(begins)
    firsts = np.append(0, np.flatnonzero(begins))
    place = places - places[firsts][part]
    off = times - times[firsts][part] - place * interval
    if by_interval:
        middle = times[0] + places[firsts] * interval - times[firsts]
    else:
        low = np.minimum.reduceat(off, firsts)
        high = np.maximum.reduceat(off, firsts)
        middle = (low + high) / 2
        if (low < high).any():
            median = pd.Series(off).groupby(part, sort=False).median().to_numpy()
            is_near = np.maximum(high - median, median - low) <= _MAX_JITTER * interval
            middle = np.where(is_near, median, middle)
    return rows.assign(part=part, place=place, off=off - middle[part]), times[firsts] + middle


def _begins(
    times: np.ndarray, interval: float, max_step: int, by_interval: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the number of intervals from the first row to each, rounded, and marks the rows with
    which a new part begins; see `_on_grids`.
    """
    steps = (
        (times - times[0]) / interval
        if by_interval
        else np.append(0, np.cumsum(np.round(np.diff(times) / interval)))
    )
    places = np.round(steps).astype(np.int64)
    begins = np.diff(places, prepend=places[0]) > max_step
    if not by_interval:
        _mark_spread(times - places * interval, begins, 2 * _MAX_JITTER * interval + 0.5)
    return places, begins


def _mark_spread(off: np.ndarray, begins: np.ndarray, spread: float) -> None:
    """Marks further beginnings of parts, so that the distances from the grid within each part
    differ by at most `spread`.
    """
    if np.ptp(off) <= spread:
        return
    first = 0
    length = 64
    ends = np.append(np.flatnonzero(begins), len(off))
    for end in ends[ends > 0].tolist():
        while first < end:
            run = off[first : min(end, first + length)]
            is_beyond = np.maximum.accumulate(run) - np.minimum.accumulate(run) > spread
            if is_beyond.any():
                first = first + int(np.argmax(is_beyond))
                length = 64
                begins[first] = True
            elif first + length >= end:
                first = end
                length = 64
            else:
                length *= 2


def _build_parts(
    rows: pd.DataFrame,
    begins: np.ndarray,
    interval: float,
    log: CleaningLog,
    how: str,
    options: Cleaning,
) -> tuple[list[Part], int]:
    """Builds regular parts, fills their short gaps, and counts the rows that they use. Of several
    rows at one grid point, one is kept.
    """
    lengths = rows.groupby("part")["place"].max().to_numpy() + 1
    if (longest := lengths.max()) < options.min_part:
        raise InputError(
            f"Expected regular samples, at least {options.min_part} in a row. Received: {longest} "
            f"at most, every {interval / 1e9:.6g} s, in {log.channel}.",
            [
                {"max_fill": 10 * max(1, options.longest_gap)},
                *(
                    [{"interval_s": float(f"{10 * interval / 1e9:.6g}")}]
                    if log.times is not None
                    else []
                ),
            ],
            "a smaller --window to fit",
        )
    _log_breaks(rows, interval, log, options.longest_gap)
    is_short = lengths < options.min_part
    short = rows["row"][is_short[rows["part"]]].to_numpy()
    rows = rows[~is_short[rows["part"]]]
    _log_jitter(rows, interval, log)
    rows, merged = _merge_groups(rows, ["part", "place"], how)
    text = f"rows that share an interval with another row, of which the {how} was taken: {{count}}"
    log.add("averaged", merged, text)
    text = (
        f"rows in parts of fewer than {options.min_part:,} samples "
        f"({counted(is_short.sum(), 'such part')}): {{count}}"
    )
    log.add("short parts", short, text)
    parts = []
    holds = options.fill == "hold"
    for number, inside in rows.groupby("part"):
        places = inside["place"].to_numpy()
        values = inside["value"].to_numpy()
        measured = np.zeros(lengths[number], bool)
        measured[places] = True
        previous = np.cumsum(measured) - 1
        filled = values[previous]
        if not holds:
            gaps = np.flatnonzero(~measured)
            filled[gaps] = np.interp(gaps, places, values)
        parts.append(Part(begins[number], filled, inside["row"].to_numpy()[previous], measured))
    num_filled = int(lengths[~is_short].sum()) - len(rows)
    is_gap = (np.diff(rows["part"]) == 0) & (np.diff(rows["place"]) > 1)
    filled = "filled with the value before them," if holds else "filled by straight lines with"
    text = (
        f"gaps of up to {counted(options.longest_gap, 'sample')}, {filled} "
        f"{counted(num_filled, 'sample')} in total: {{count}}"
    )
    log.add("gaps filled", rows["row"].to_numpy()[:-1][is_gap], text, samples_filled=num_filled)
    if num_filled > _MOSTLY_FILLED * (share := num_filled + len(rows)):
        text = (
            f"{num_filled / share:.0%} of the samples are filled in and were not measured: give a "
            "longer --interval, or a smaller --max-fill"
        )
        log.add("mostly filled", (), text, count=num_filled)
    return parts, len(rows)


def _log_breaks(rows: pd.DataFrame, interval: float, log: CleaningLog, max_fill: int) -> None:
    before = np.flatnonzero(np.diff(rows["part"]))
    steps = np.diff(rows["time"])[before] / interval
    numbers = rows["row"].to_numpy()[before]
    is_gap = np.round(steps) > max_fill + 1
    unit = 1.0 if log.times is None else interval / 1e9
    longest = steps.max(initial=0) * unit
    what = "samples" if log.times is None else "s"
    text = (
        f"gaps of more than {counted(max_fill, 'sample')}, the longest {longest:.6g} {what}, at "
        f"which the series is split: {{count}}"
    )
    log.add("gaps", numbers[is_gap], text, details={"longest": float(longest)})
    log.add(
        "clock steps", numbers[~is_gap], "jumps of the clock, at which the series is split: {count}"
    )


def _log_jitter(rows: pd.DataFrame, interval: float, log: CleaningLog) -> None:
    share = (rows["off"].abs() / interval).to_numpy()
    snapped = np.flatnonzero(share > 1e-3)  # smaller deviations come from rounded times
    largest = float(share.max()) * interval / 1e9
    worst = rows["row"].to_numpy()[snapped[np.argsort(-share[snapped], kind="stable")]]
    text = (
        f"times off the regular grid, by up to {largest:.4g} s ({share.max():.0%} of an interval), "
        f"snapped to it: {{count}}"
    )
    log.add("jitter", worst, text, details={"largest_s": largest})
