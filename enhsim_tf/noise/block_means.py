"""How far chance moves a mean over blocks of time (used by the noise models of section 2.3).

Noise is often correlated over many samples, so that neighbouring samples, and windows that overlap, are not independent observations. A
difference between two models is therefore computed for each of ten blocks of held-out time. It counts only if its mean is above two standard
errors, which are estimated from the blocks; with fewer blocks, above as many as are exceeded equally rarely. A gain that comes from less
than four of ten blocks does not count, however large it is.

References:
    Student, "The probable error of a mean", 1908.
    Breiman, Friedman, Olshen and Stone, "Classification and regression trees", 1984: the simplest model within one standard error.
"""

from collections.abc import Sequence

import numpy as np

NUM_BLOCKS = 10
_STANDARD_ERRORS = 2.0  # for ten blocks


def block_slices(number: int) -> list[slice]:
    """Divides a number of rows, which are in the order of time, into blocks of nearly equal size; fewer than ten if there are fewer rows."""
    edges = np.linspace(0, number, 1 + min(NUM_BLOCKS, number)).astype(int)
    return [slice(begin, end) for begin, end in zip(edges[:-1], edges[1:], strict=True)]


def margin(differences: Sequence[float] | np.ndarray) -> float:
    """Returns what the mean of the differences of blocks exceeds by chance with a probability of 4 %: two standard errors for ten blocks.

    Args:
        differences: One number for each block. From a single one, chance cannot be estimated, and the margin is infinite.
    """
    from scipy.special import stdtr, stdtrit

    number = len(differences)
    if number < 2:
        return np.inf
    times = stdtrit(number - 1, stdtr(NUM_BLOCKS - 1, _STANDARD_ERRORS))  # exceeded equally rarely, by Student's t distribution
    return float(times * np.std(differences, ddof=1) / np.sqrt(number))
