"""Means over blocks of time, and how far chance moves them (used by the noise models of section 2.3).

Noise is often correlated over many samples, so that samples and overlapping windows are no independent observations. A difference between
two models is therefore computed for each of ten blocks of held-out time, and counts if its mean is above two standard errors, which are
estimated from the blocks.

References:
    Breiman, Friedman, Olshen and Stone, "Classification and regression trees", 1984: the simplest model within one standard error.
"""

import numpy as np

NUM_BLOCKS = 10
_STANDARD_ERRORS = 2.0  # one lets chance decide too often where the best of several models is compared


def block_slices(number: int) -> list[slice]:
    """Divides a number of rows, which are in the order of time, into blocks of nearly equal size; fewer than ten if there are fewer rows."""
    edges = np.linspace(0, number, 1 + min(NUM_BLOCKS, number)).astype(int)
    return [slice(begin, end) for begin, end in zip(edges[:-1], edges[1:], strict=True)]


def margin(differences: np.ndarray) -> float:
    """Returns two standard errors of the mean of differences, one for each block; of a single block nothing is known, and it is 0."""
    if len(differences) < 2:
        return 0.0
    return float(_STANDARD_ERRORS * np.std(differences, ddof=1) / np.sqrt(len(differences)))
