"""Windows of a series: the starts of windows, where they lie, and splitting them by time.

The start of a window is the index of its first sample. In a series of several parts, starts are
counted over the samples at which a complete window can start, part after part, so that they are the
sample numbers if there is one part. In all functions, `parts` are contiguous parts of one series,
`window` is the number of samples in a window, and `starts` has the shape `(windows,)`.
"""

from collections.abc import Callable, Sequence, Sized
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    from enhsim_tf.telemetry.series import Telemetry

# of the windows outside a block that must remain where those that overlap the block are left out
_LEAST_SHARE = 0.25
_AVERAGED = 512  # overlapping windows that are averaged at a time


def num_window_starts(parts: Sequence[Sized], window: int) -> int:
    """Returns the number of samples at which a complete window can start."""
    return sum(max(0, len(part) - window + 1) for part in parts)


def longest_window(parts: Sequence[Sized], most: int, least: int, number: int) -> int | None:
    """Returns the longest window, of at most `most` and at least `least` samples, of which the
    parts hold so many; None if there is none. Parts shorter than a window do not count.
    """
    lengths = np.array([len(part) for part in parts])
    windows = range(most, least - 1, -1)
    enough = (window for window in windows if lengths[lengths >= window].sum() >= number * window)
    return next(enough, None)


def random_window_starts(
    parts: Sequence[Sized], window: int, num_windows: int, rng: np.random.Generator
) -> np.ndarray:
    """Draws window starts uniformly from all samples at which a complete window can start, with
    replacement.

    In the paper, the "beginning and end" of windows "are offset by a random amount" (section 2.2).

    Raises:
        InputError: If every part is shorter than a window.
    """
    num_starts = num_window_starts(parts, window)
    if not num_starts:
        longest = max((len(part) for part in parts), default=0)
        raise InputError(
            f"Expected a contiguous part of at least {window} samples. Received: {longest}. Use a "
            "longer series or a shorter window."
        )
    return rng.integers(0, num_starts, num_windows)


def evenly_spaced_starts(parts: Sequence[Sized], window: int, num_windows: int) -> np.ndarray:
    """Returns window starts that are evenly spaced over the series, in the order of time; if fewer
    than `num_windows` are possible, all.
    """
    num_starts = num_window_starts(parts, window)
    return np.unique(np.linspace(0, num_starts - 1, min(num_windows, num_starts)).astype(np.int64))


def places_in_parts(
    parts: Sequence[Sized], starts: np.ndarray, window: int
) -> tuple[list[Sized], np.ndarray, np.ndarray]:
    """Returns the parts that are long enough and where each window lies: the number of its part
    among these, and its first sample there.
    """
    usable = [part for part in parts if len(part) >= window]
    firsts = np.cumsum([0] + [len(part) - window + 1 for part in usable])
    which = np.searchsorted(firsts, starts, "right") - 1
    return usable, which, np.asarray(starts) - firsts[which]


def time_blocks(
    starts: np.ndarray, num_blocks: int, window: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Splits windows into blocks of time for cross-validation.

    Training windows that overlap the time of the held-out block are left out, if at least a quarter
    of the windows outside the block remains.

    Returns:
        `(training, held_out)` for each of `num_blocks` blocks, or of as many as there are windows:
        indices of windows in the order of time. Empty for a single window.
    """
    order = np.argsort(starts, kind="stable")
    if len(order) < 2:
        return []
    blocks = []
    for held_out in np.array_split(order, max(2, min(num_blocks, len(order)))):
        rest = order[~np.isin(order, held_out)]
        first = starts[held_out[0]]
        last = starts[held_out[-1]]
        apart = rest[(starts[rest] <= first - window) | (starts[rest] >= last + window)]
        blocks.append((apart if len(apart) >= max(1, _LEAST_SHARE * len(rest)) else rest, held_out))
    return blocks


def runs_of(marks: np.ndarray) -> list[tuple[int, int]]:
    """Returns the first sample and the end (exclusive) of each run of true samples, of marks of
    shape `(samples,)`.
    """
    edges = np.flatnonzero(np.diff(np.asarray(marks, bool), prepend=False, append=False))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def mean_over_windows(
    scores: np.ndarray, begins: np.ndarray, window: int, num_samples: int
) -> np.ndarray:
    """Converts scores of windows to scores of samples: the mean score of the windows that contain a
    sample.

    Samples after the end of the last window receive the score of the last window. Windows begin at
    `begins`, in ascending order from 0, with steps of at most `window`.
    """
    end = begins[-1] + window
    samples = np.arange(end)
    first = np.searchsorted(begins, samples - window, "right")
    number = np.searchsorted(begins, samples, "right") - first
    # no difference of running sums: after one very large score, it would keep its rounding error
    total = np.zeros(end)
    for place in range(number.max()):
        holds = place < number
        total[holds] += scores[first[holds] + place]
    return np.append(total / number, np.full(num_samples - end, scores[-1]))


def run_starts(num_samples: int, window: int, hop: int | None = None) -> np.ndarray:
    """Returns the starts of windows that cover a run, one each `hop` samples (None: a quarter of a
    window) and the last one at its end.
    """
    return np.unique(
        np.append(
            np.arange(0, num_samples - window + 1, hop or max(1, window // 4)), num_samples - window
        )
    )


def average_windows(
    windows_at: Callable[[slice], np.ndarray], starts: np.ndarray, window: int, num_samples: int
) -> np.ndarray:
    """Averages overlapping windows into one series `(num_samples, channels)`, with weights that
    fall to zero at both ends of a window.

    `windows_at` returns some of the windows, given by a slice of their numbers, and `starts` are
    their first samples.
    """
    fade = (np.sin(np.pi * (np.arange(window) + 0.5) / window) ** 2)[:, None]
    series = None
    total = np.zeros((num_samples, 1))
    for first in range(0, len(starts), _AVERAGED):
        rows = slice(first, min(first + _AVERAGED, len(starts)))
        windows = windows_at(rows)
        series = np.zeros((num_samples, windows.shape[2])) if series is None else series
        for start, values in zip(starts[rows], windows, strict=True):
            series[start : start + window] += fade * values
            total[start : start + window] += fade
    return (series / total).astype(np.float32)


def cut(series: Sequence[np.ndarray], starts: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows out of series `(samples, columns)`, float32 of shape `(windows, samples,
    columns)`; starts as in this module.
    """
    usable, which, places = places_in_parts(series, starts, window)
    windows = np.empty((len(starts), window, series[0].shape[1]), np.float32)
    for number in np.unique(which):
        rows = which == number if len(usable) > 1 else slice(None)
        view = np.lib.stride_tricks.sliding_window_view(usable[number], window, axis=0)
        windows[rows] = view[places[rows]].transpose(0, 2, 1)
    return windows


def windows_of(telemetry: "Telemetry", starts: np.ndarray, window: int) -> np.ndarray:
    """Cuts windows out of the parts of a telemetry, see `cut`."""
    return cut([part.values for part in telemetry.parts], starts, window)


def times_of(telemetry: "Telemetry", starts: np.ndarray, window: int) -> np.ndarray:
    """Returns the first sample of each window on the clock of the telemetry, integers of shape
    `(windows,)`.
    """
    usable, which, places = places_in_parts(telemetry.parts, starts, window)
    begins = np.array([round(part.offset_s / telemetry.interval_s) for part in usable])
    return begins[which] + places
