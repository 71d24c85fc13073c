"""Infers the sampling of a series from its times: the interval, stretches with another rate, and the regular grid.

All functions are pure functions of arrays. Times are sorted int64 nanoseconds. `resampling` decides what happens to the rows.
"""

import dataclasses

import numpy as np

_ALIKE = (0.8, 1.25)  # steps within these factors have the same rate; with jitter of a quarter, means of four steps stay inside
_RUN = 4  # smallest number of consecutive steps that form a stretch with another rate


def find_interval(times: np.ndarray) -> float:
    """Finds the sampling interval that most rows have.

    Args:
        times: Times of at least two rows, all different.

    Returns:
        The interval in nanoseconds.
    """
    steps = np.sort(np.diff(times).astype(np.float64))
    near = np.searchsorted(steps, _ALIKE[1] * steps, "right") - np.searchsorted(steps, _ALIKE[0] * steps, "left")
    most = steps[np.argmax(near)]
    interval = float(np.median(steps[(_ALIKE[0] * most <= steps) & (steps <= _ALIKE[1] * most)]))
    return _refined(times, interval)


def _refined(times: np.ndarray, interval: float) -> float:
    """Refines the interval on the longest run without long gaps.

    The result is the step that at least 90 % of the rows have, or otherwise the slope of a line fitted to the times.
    """
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
    """Start and end index (exclusive) of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marks.view(np.int8), [0]]))).reshape(-1, 2)
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])] if len(edges) else (0, 0)
    return int(first), int(last)


def regular_step_fraction(times: np.ndarray, interval: float) -> float:
    """Fraction of the steps that are close to a whole number of intervals; about a quarter for random times."""
    ratios = np.diff(times) / interval
    numbers = np.round(ratios)
    return float(np.mean((numbers >= 1) & (np.abs(ratios - numbers) <= 0.25)))


@dataclasses.dataclass(frozen=True)
class OtherRateSegment:
    """A segment of rows whose sampling rate differs from the common one.

    Args:
        first: First row of the segment.
        last: Last row of the segment (inclusive).
        ratio: Median step of the segment, in common intervals.
        longest: Longest step of the segment, in common intervals.
    """

    first: int
    last: int
    ratio: float
    longest: float


def find_other_rates(times: np.ndarray, interval: float) -> list[OtherRateSegment]:
    """Finds segments whose steps are all shorter than the interval, or all longer and similar to each other."""
    ratios = np.diff(times) / interval
    if len(ratios) < _RUN:
        return []
    windows = np.lib.stride_tricks.sliding_window_view(ratios, _RUN)
    lowest, highest = windows.min(axis=1), windows.max(axis=1)
    segments = []
    for is_other in (highest < _ALIKE[0], (lowest > _ALIKE[1]) & (highest < 1.3 * lowest)):
        covered = np.convolve(is_other, np.ones(_RUN)) > 0.5
        edges = np.flatnonzero(np.diff(np.concatenate([[0], covered.view(np.int8), [0]])))
        for first, last in edges.reshape(-1, 2).tolist():
            inside = ratios[first:last]
            segments.append(OtherRateSegment(first, last, float(np.median(inside)), float(inside.max())))
    return sorted(segments, key=lambda segment: segment.first)


@dataclasses.dataclass(frozen=True)
class Segment:
    """A segment of rows that lie on one regular grid.

    Args:
        rows: Slice of the rows.
        places: Index of the grid point of each row, from 0, in ascending order. Rows may share a grid point.
        begin: Time of grid point 0 in nanoseconds, a float because the grid need not lie on whole nanoseconds.
        off: Distance of each row from its grid point in nanoseconds.
    """

    rows: slice
    places: np.ndarray
    begin: float
    off: np.ndarray


def find_regular_segments(times: np.ndarray, interval: float, max_jitter: float, max_step: int) -> list[Segment]:
    """Splits a series into segments whose rows lie on regular grids with the same interval and individual start times.

    Args:
        times: Times of the rows.
        interval: The interval in nanoseconds.
        max_jitter: Largest distance of a row from its grid point, in intervals, at most 0.5.
        max_step: Longest step inside a segment, in intervals.

    Returns:
        The segments in chronological order.
    """
    ratios = np.diff(times) / interval
    numbers = np.round(ratios)
    whole = (numbers <= max_step) & (np.abs(ratios - numbers) <= 2 * max_jitter + 1e-9)
    breaks = [0, *(np.flatnonzero(~whole) + 1).tolist(), len(times)]
    segments = []
    for start, stop in zip(breaks[:-1], breaks[1:], strict=True):
        all_places = np.concatenate([[0], np.cumsum(numbers[start : stop - 1])]).astype(np.int64)
        all_off = (times[start:stop] - times[start]) - all_places * interval
        first = 0
        while first < stop - start:
            end = first + _end_of_spread(all_off[first:], 2 * max_jitter * interval + 0.5)
            places, off = all_places[first:end] - all_places[first], all_off[first:end] - all_off[first]
            middle = float(np.median(off))
            if np.abs(off - middle).max() > max_jitter * interval:
                middle = float(off.max() + off.min()) / 2
            segments.append(Segment(slice(start + first, start + end), places, float(times[start + first]) + middle, off - middle))
            first = end
    return segments


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


def find_binned_segments(times: np.ndarray, interval: float, max_step: int) -> list[Segment]:
    """Splits a series at its long gaps and assigns every row to the nearest point of one grid that starts at the first row.

    Args:
        times: Times of the rows.
        interval: The interval in nanoseconds.
        max_step: Longest step inside a segment, in intervals.

    Returns:
        The segments in chronological order.
    """
    places = np.round((times - times[0]) / interval).astype(np.int64)
    breaks = [0, *(np.flatnonzero(np.diff(places) > max_step) + 1).tolist(), len(times)]
    segments = []
    for start, stop in zip(breaks[:-1], breaks[1:], strict=True):
        begin = float(times[0]) + places[start] * interval
        inside = places[start:stop] - places[start]
        segments.append(Segment(slice(start, stop), inside, begin, times[start:stop] - begin - inside * interval))
    return segments
