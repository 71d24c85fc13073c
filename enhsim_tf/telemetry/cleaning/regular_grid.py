"""The sampling of a series, told from its times: the interval, stretches of another rate, and the regular grid.

Pure functions of arrays; times are int64 nanoseconds, sorted. What becomes of the rows is `cleaning`'s business.
"""

import dataclasses

import numpy as np

_ALIKE = (0.8, 1.25)  # steps within these factors of each other are of one rate; jitter of a quarter keeps means of four inside
_RUN = 4  # steps in a row that make a stretch of another rate


def find_interval(times: np.ndarray) -> float:
    """The sampling interval that most rows have.

    Args:
        times: Different times of at least two rows.

    Returns:
        The interval in nanoseconds.
    """
    steps = np.sort(np.diff(times).astype(np.float64))
    near = np.searchsorted(steps, _ALIKE[1] * steps, "right") - np.searchsorted(steps, _ALIKE[0] * steps, "left")
    most = steps[np.argmax(near)]
    interval = float(np.median(steps[(_ALIKE[0] * most <= steps) & (steps <= _ALIKE[1] * most)]))
    return _refined(times, interval)


def _refined(times: np.ndarray, interval: float) -> float:
    """The interval over the longest stretch without long gaps: the step that nearly all rows have, or else a line's slope."""
    steps = np.diff(times).astype(np.float64)
    numbers = np.round(steps / interval)
    near = (numbers >= 1) & (numbers <= 3)
    first, last = _longest_run(near)
    sure = _longest_run(near & (np.abs(steps / interval - numbers) <= 0.25))  # leaves jumps of the clock out
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
    plain = (float(f"{slope:.{digits}e}") for digits in range(15))  # the plainest number that does as well
    return next((number for number in plain if abs(number - slope) * places[-1] <= 0.05 * slope), slope)


def _longest_run(marks: np.ndarray) -> tuple[int, int]:
    """First index of the longest run of marks, and the one after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marks.view(np.int8), [0]]))).reshape(-1, 2)
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])] if len(edges) else (0, 0)
    return int(first), int(last)


def regular_step_fraction(times: np.ndarray, interval: float) -> float:
    """Share of the steps that are about a whole number of intervals; a quarter or so where times fall at random."""
    ratios = np.diff(times) / interval
    numbers = np.round(ratios)
    return float(np.mean((numbers >= 1) & (np.abs(ratios - numbers) <= 0.25)))


@dataclasses.dataclass(frozen=True)
class OtherRateSegment:
    """A stretch of rows of another rate than the rest, from row `first` to row `last`, both in it.

    Args:
        first: Its first row.
        last: Its last row.
        ratio: Its median step, in intervals of the rest.
        longest: Its longest step, in intervals of the rest.
    """

    first: int
    last: int
    ratio: float
    longest: float


def find_other_rates(times: np.ndarray, interval: float) -> list[OtherRateSegment]:
    """Stretches whose steps are all shorter, or all longer and alike, than the interval."""
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
    """Rows on one regular grid.

    Args:
        rows: The rows, from the first to before the last.
        places: Place of each row on the grid, from 0; never falling, and equal where rows share a place.
        begin: Time of the grid's place 0, nanoseconds (a float: grids need not fall on whole ones).
        off: Distance of each row from its place, nanoseconds.
    """

    rows: slice
    places: np.ndarray
    begin: float
    off: np.ndarray


def find_regular_segments(times: np.ndarray, interval: float, max_jitter: float, max_step: int) -> list[Segment]:
    """Parts a series into stretches whose rows lie on regular grids of one interval, each with its own beginning.

    Args:
        times: Times of the rows.
        interval: The interval in nanoseconds.
        max_jitter: How far a row may lie off its place, in intervals, at most 0.5.
        max_step: Longest step inside a segment, in intervals.
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
    """How many of the first values lie within `spread` of each other."""
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
    """Parts a series at its long gaps and puts every row on the nearest place of the one grid that begins with the first row.

    Args:
        times: Times of the rows.
        interval: The interval in nanoseconds.
        max_step: Longest step inside a segment, in intervals.
    """
    places = np.round((times - times[0]) / interval).astype(np.int64)
    breaks = [0, *(np.flatnonzero(np.diff(places) > max_step) + 1).tolist(), len(times)]
    segments = []
    for start, stop in zip(breaks[:-1], breaks[1:], strict=True):
        begin = float(times[0]) + places[start] * interval
        inside = places[start:stop] - places[start]
        segments.append(Segment(slice(start, stop), inside, begin, times[start:stop] - begin - inside * interval))
    return segments
