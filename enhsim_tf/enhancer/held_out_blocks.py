"""Contiguous blocks of time on which an enhancer is evaluated (an addition to section 2.2 of the paper).

Windows that overlap share samples, so a random split would evaluate an enhancer on samples that it was trained on.
"""

import numpy as np

from enhsim_tf.common.errors import InputError

NUM_FOLDS = 3  # folds of interleaved blocks, so that each fold covers the beginning, the middle and the end of the time
_MOST_BLOCKS = 9
_WINDOWS_IN_BLOCK = 3  # preferred minimum length of a block, in windows


def block_edges(begin: int, end: int, window: int) -> np.ndarray:
    """Cuts a stretch of time into contiguous blocks of about equal length.

    Args:
        begin: First sample.
        end: End of the stretch in samples (exclusive).
        window: Length of a window in samples.

    Returns:
        The edges in samples, in ascending order; block `b` covers the samples from `edges[b]` to before `edges[b + 1]`.

    Raises:
        InputError: If a block would be shorter than a window.
    """
    num_blocks = int(np.clip((end - begin) // (_WINDOWS_IN_BLOCK * window), NUM_FOLDS, _MOST_BLOCKS))
    edges = np.linspace(begin, end, num_blocks + 1).round().astype(np.int64)
    if np.diff(edges).min() < window:
        raise InputError(
            f"Expected at least {NUM_FOLDS} windows of {window} samples, one after another. Received: {end - begin} samples. "
            "Give longer telemetry or a smaller window."
        )
    return edges


def split_fold(starts: np.ndarray, window: int, edges: np.ndarray, fold: int) -> tuple[np.ndarray, np.ndarray]:
    """Splits windows into training windows and held-out windows that share no sample.

    Block `b` is held out if `b % NUM_FOLDS == fold`. A window that lies across the edge of a held-out block is in neither set.

    Args:
        starts: First sample of each window, shape `(windows,)`, in any order.
        window: Length of a window in samples.
        edges: Edges of the blocks, as returned by `block_edges`.
        fold: Number of the fold, from 0.

    Returns:
        The indices of the training windows, and the indices of the held-out windows.
    """
    starts = np.asarray(starts)
    inside, touched = np.zeros((2, len(starts)), bool)
    for block in range(fold, len(edges) - 1, NUM_FOLDS):
        low, high = edges[block], edges[block + 1]
        inside |= (starts >= low) & (starts + window <= high)
        touched |= (starts < high) & (starts + window > low)
    return np.flatnonzero(~touched), np.flatnonzero(inside)
