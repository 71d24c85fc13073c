"""Windows of a series: the starts of windows, where they lie, and splitting them by time.

The start of a window is the index of its first sample. In a series of several parts, starts are counted over the samples at which a
complete window can start, part after part, so that they are the sample numbers if there is one part. In all functions, `parts` are
contiguous parts of one series, `window` is the number of samples in a window, and `starts` has the shape `(windows,)`.
"""

from collections.abc import Sequence, Sized

import numpy as np

from enhsim_tf.common.errors import InputError

_LEAST_SHARE = 0.25  # of the windows outside a block that must remain where those that overlap the block are left out


def num_window_starts(parts: Sequence[Sized], window: int) -> int:
    """Returns the number of samples at which a complete window can start."""
    return sum(max(0, len(part) - window + 1) for part in parts)


def random_window_starts(
    parts: Sequence[Sized], window: int, num_windows: int, rng: np.random.Generator
) -> np.ndarray:
    """Draws window starts uniformly from all samples at which a complete window can start, with replacement.

    In the paper, the "beginning and end" of windows "are offset by a random amount" (section 2.2).

    Raises:
        InputError: If every part is shorter than a window.
    """
    num_starts = num_window_starts(parts, window)
    if not num_starts:
        longest = max((len(part) for part in parts), default=0)
        raise InputError(
            f"Expected a contiguous part of at least {window} samples. Received: {longest}. Use a longer series or a shorter window."
        )
    return rng.integers(0, num_starts, num_windows)


def evenly_spaced_starts(parts: Sequence[Sized], window: int, num_windows: int) -> np.ndarray:
    """Returns window starts that are evenly spaced over the series, in the order of time; if fewer than `num_windows` are possible, all."""
    num_starts = num_window_starts(parts, window)
    return np.unique(np.linspace(0, num_starts - 1, min(num_windows, num_starts)).astype(np.int64))


def places_in_parts(
    parts: Sequence[Sized], starts: np.ndarray, window: int
) -> tuple[np.ndarray, np.ndarray]:
    """Returns where each window lies: the number of its part, among those that are long enough, and its first sample there."""
    firsts = np.cumsum([0] + [len(part) - window + 1 for part in parts if len(part) >= window])
    which = np.searchsorted(firsts, starts, "right") - 1
    return which, np.asarray(starts) - firsts[which]


def time_blocks(
    starts: np.ndarray, num_blocks: int, window: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Splits windows into blocks of time for cross-validation.

    Training windows that overlap the time of the held-out block are left out, if at least a quarter of the windows outside
    the block remains.

    Returns:
        `(training, held_out)` for each of `num_blocks` blocks, or of as many as there are windows: indices of windows in the order of
        time. Empty for a single window.
    """
    order = np.argsort(starts, kind="stable")
    if len(order) < 2:
        return []
    blocks = []
    for held_out in np.array_split(order, max(2, min(num_blocks, len(order)))):
        rest = order[~np.isin(order, held_out)]
        first, last = starts[held_out[0]], starts[held_out[-1]]
        apart = rest[(starts[rest] <= first - window) | (starts[rest] >= last + window)]
        blocks.append((apart if len(apart) >= max(1, _LEAST_SHARE * len(rest)) else rest, held_out))
    return blocks


def runs_of(marks: np.ndarray) -> list[tuple[int, int]]:
    """Returns the first sample and the end (exclusive) of each run of true samples, of marks of shape `(samples,)`."""
    edges = np.flatnonzero(np.diff(np.asarray(marks, bool), prepend=False, append=False))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def mean_over_windows(
    scores: np.ndarray, begins: np.ndarray, window: int, num_samples: int
) -> np.ndarray:
    """Converts scores of windows to scores of samples: the mean score of the windows that contain a sample.

    Samples after the end of the last window receive the score of the last window. Windows begin at `begins`, in ascending order from 0,
    with steps of at most `window`.
    """
    steps = np.zeros((2, num_samples + 1))
    for sign, places in ((1, begins), (-1, begins + window)):
        np.add.at(steps[0], places, sign * scores)
        np.add.at(steps[1], places, sign)
    end = begins[-1] + window
    total, number = np.cumsum(steps[:, :end], axis=1)
    return np.append(total / number, np.full(num_samples - end, scores[-1]))
