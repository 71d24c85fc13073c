"""Confidence intervals and tests in which environments, seeds and blocks of time are the replicates.

Windows that are scored by one trained detector share its training, so they are not independent replicates. All functions here
therefore resample or test whole clusters. A table is a pandas DataFrame with one row per observation.
"""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

_BATCH = 1_000_000  # rows drawn at a time


@dataclasses.dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval.

    Args:
        estimate: The statistic of all the data.
        low: Lower end.
        high: Upper end.
        level: Confidence, between 0 and 1.
    """

    estimate: float
    low: float
    high: float
    level: float = 0.95


def hierarchical_interval(
    table: "pd.DataFrame",
    value: str,
    levels: Sequence[str],
    statistic: Callable[[np.ndarray], float] = np.mean,
    num_resamples: int = 2_000,
    level: float = 0.95,
    seed: int = 0,
) -> Interval:
    """Percentile interval by a hierarchical (nested, cluster) bootstrap.

    Each resample draws, with replacement, as many clusters of the first level as there are, within each of them as many
    of the second, and so on; the rows of a cluster of the last level stay together. Drawing on every level counts the
    scatter of the lower ones twice and misses a share 1 / clusters of the highest one's variance: with ten clusters or
    more on top the interval is slightly wide or about right, with four it is narrow.

    Args:
        table: The observations.
        value: Its column of values.
        levels: Columns that name the clusters, the outermost first; a label counts within the cluster above it.
        statistic: From the values of a resample, shape `(rows,)`, to a number.
        num_resamples: Bootstrap resamples.
        level: Confidence, between 0 and 1.
        seed: Seed of the draws.

    Returns:
        The statistic of the table and its interval.

    Raises:
        InputError: If a column is missing, a value is not finite, the table is empty or a number is out of range.
    """
    columns = [value, *levels]
    if not levels or not 0 < level < 1 or num_resamples < 1 or not len(table) or not set(columns) <= set(table.columns):
        raise InputError(
            "Expected rows with a value and at least one level, 0 < level < 1 and num_resamples >= 1. "
            f"Received: {len(table)} rows with columns {list(table.columns)}, columns asked for {columns}, level={level}, num_resamples={num_resamples}."
        )
    values = table[value].to_numpy(np.float64)
    missing = int((~np.isfinite(values)).sum() + table[list(levels)].isna().any(axis=1).sum())
    if missing:
        raise InputError(f"Expected finite values and a label on every level. Received: {missing} rows of column {value!r} without.")
    labels = [table[name].to_numpy() for name in levels]
    found = [statistic(values[rows]) for rows in _resamples(labels, num_resamples, seed)]
    return _percentile_interval(statistic(values), found, level)


def crossed_interval(
    table: "pd.DataFrame",
    value: str,
    factors: Sequence[str],
    statistic: Callable[..., np.ndarray] = np.mean,
    num_resamples: int = 2_000,
    level: float = 0.95,
    seed: int = 0,
) -> Interval:
    """Percentile interval by a bootstrap over crossed factors, such as environments that were all run with the same seeds.

    Each resample draws labels of every factor independently, with replacement. It takes the cells in which the drawn labels meet,
    and draws as many rows of each cell as it has, such as blocks of time (the pigeonhole bootstrap of Owen 2007, with rows). Effects
    that a seed has in all environments are thus preserved, whereas the nested bootstrap would average them out. The interval is
    rather too wide, except for factors with few labels: with four labels it is too narrow.

    Args:
        table: The observations, the same number of rows in each cell.
        value: Its column of values.
        factors: Columns of labels that are crossed.
        statistic: `numpy.mean`, or another that takes an axis.
        num_resamples: Bootstrap resamples.
        level: Confidence, between 0 and 1.
        seed: Seed of the draws.

    Returns:
        The statistic of the table and its interval.

    Raises:
        InputError: If a value is not finite or a cell has fewer rows than another.
    """
    import pandas as pd

    values = table[value].to_numpy(np.float64)
    codes = [pd.factorize(table[name])[0] for name in factors]
    sizes = [int(each.max(initial=-1)) + 1 for each in codes]
    cell = np.ravel_multi_index(codes, sizes) if len(values) else np.zeros(0, int)
    counts = np.bincount(cell, minlength=int(np.prod(sizes)))
    if not len(values) or not np.isfinite(values).all() or np.ptp(counts) or not 0 < level < 1 or num_resamples < 1:
        raise InputError(
            f"Expected finite values, as many in each cell of {' x '.join(factors)}, 0 < level < 1 and num_resamples >= 1. Received: "
            f"{counts.min(initial=0)} to {counts.max(initial=0)} rows a cell, {int((~np.isfinite(values)).sum())} not finite, "
            f"level={level}, num_resamples={num_resamples}."
        )
    cells = values[np.argsort(cell, kind="stable")].reshape(*sizes, counts[0])
    rng, shape = np.random.default_rng(seed), (num_resamples, *cells.shape)
    drawn = []
    for axis, size in enumerate(sizes, 1):
        labels = rng.integers(0, size, (num_resamples, size))
        drawn.append(labels.reshape([size if each == axis else num_resamples if not each else 1 for each in range(len(shape))]))
    found = cells[(*drawn, rng.integers(0, counts[0], shape))].reshape(num_resamples, -1)
    return _percentile_interval(statistic(values), statistic(found, axis=1), level)


def wilcoxon_signed_rank(differences: np.ndarray) -> float:
    """Two-sided p-value of the Wilcoxon signed-rank test that paired differences are symmetric around zero.

    The test is exact with and without ties: it enumerates all signs.

    Args:
        differences: One difference for each replicate, shape `(replicates,)`; zeros are ignored, as in Wilcoxon's original test.

    Returns:
        The p-value; 1 if all differences are zero.

    Raises:
        InputError: If there is no difference or one is not finite.
    """
    from scipy.stats import rankdata

    differences = np.asarray(differences, np.float64)
    if differences.ndim != 1 or not len(differences) or not np.isfinite(differences).all():
        raise InputError(f"Expected finite differences of shape (replicates,). Received: {differences}.")
    differences = differences[differences != 0]
    # scipy.stats.wilcoxon counts ties out up to 13 differences and takes a normal law beyond: of 20 that all are 1 it has a p-value of
    # 7.7e-6 for 2 / 2^20 = 1.9e-6, of 40 one that is 140 times too large. Without ties the two agree.
    ranks = np.rint(2 * rankdata(np.abs(differences))).astype(int)  # doubled: those of ties are halves
    chance = np.zeros(ranks.sum() + 1)  # of each sum of the ranks with a plus
    chance[0] = 1
    for rank in ranks:
        chance = (chance + np.concatenate([np.zeros(rank), chance[:-rank]])) / 2
    found = ranks[differences > 0].sum()
    return float(min(1, 2 * chance[: found + 1].sum(), 2 * chance[found:].sum()))


def holm(p_values: Sequence[float]) -> np.ndarray:
    """P-values adjusted by Holm's step-down method. Below 0.05, the probability of any false positive is at most 5 %.

    Raises:
        InputError: If one is not from 0 to 1.
    """
    p_values = np.asarray(p_values, np.float64)
    if p_values.ndim != 1 or not np.all((p_values >= 0) & (p_values <= 1)):
        raise InputError(f"Expected p-values from 0 to 1, of shape (tests,). Received: {p_values}.")
    order = np.argsort(p_values, kind="stable")
    adjusted = np.empty(len(p_values))
    adjusted[order] = np.minimum(np.maximum.accumulate(p_values[order] * np.arange(len(p_values), 0, -1)), 1)
    return adjusted


def mean_interval(values: "pd.Series", factors: Sequence[str] = ("environment", "seed")) -> dict[str, float]:
    """The mean of a series with its `crossed_interval`, as plain numbers.

    Args:
        values: Values, whose index has the factors among its levels.
        factors: Levels whose labels are resampled.
    """
    found = crossed_interval(values.rename("value").reset_index(), "value", factors)
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def t_interval(values: "pd.Series", level: float = 0.95) -> dict[str, float | None]:
    """The mean of independent values with Student's interval, which has its coverage also for few values if they are normal.

    A percentile bootstrap of five values covers about 84 % instead of 95 %.

    Args:
        values: The values, for example one of each seed. One value alone has no interval: its ends are None.
        level: Confidence, between 0 and 1.
    """
    from scipy.stats import t

    mean = float(values.mean())
    if len(values) == 1:
        return {"mean": mean, "low": None, "high": None}
    half = float(values.sem() * t.ppf((1 + level) / 2, len(values) - 1))
    return {"mean": mean, "low": mean - half, "high": mean + half}


def _percentile_interval(estimate: float, found: list[float], level: float) -> Interval:
    low, high = np.nanquantile(found, [(1 - level) / 2, (1 + level) / 2])
    return Interval(float(estimate), float(low), float(high), level)


def _resamples(labels: list[np.ndarray], num_resamples: int, seed: int) -> Iterator[np.ndarray]:
    """Row numbers of each resample; many resamples are drawn at once, level by level."""
    rng = np.random.default_rng(seed)
    codes = np.stack([np.unique(label, return_inverse=True)[1] for label in labels])
    order = np.lexsort(codes[::-1])  # rows of a cluster are neighbours in this order
    ends = np.logical_or.accumulate(np.diff(codes[:, order]) != 0)  # a cluster ends wherever one above it ends
    clusters = [np.flatnonzero(np.r_[True, end]) for end in ends]  # first row of each cluster, level by level
    batch = max(1, _BATCH // len(order))
    for begin in range(0, num_resamples, batch):
        size = min(batch, num_resamples - begin)
        resample, drawn = np.arange(size), np.zeros(size, int)
        for parents, children in zip([np.zeros(1, int), *clusters], [*clusters, np.arange(len(order))], strict=True):
            first = np.searchsorted(children, parents)
            number = np.diff(first, append=len(children))[drawn]
            if parents is clusters[-1]:  # the rows of a last cluster: all of them, once
                place = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
            else:
                place = rng.integers(0, np.repeat(number, number))
            drawn, resample = np.repeat(first[drawn], number) + place, np.repeat(resample, number)
        yield from np.split(order[drawn], np.searchsorted(resample, np.arange(1, size)))
