"""The author's code beside the networks of this project in his configuration."""

import numpy as np
import pandas as pd
from scipy.stats import mannwhitneyu

from studies.author_code.run import EXTRACTED, KEYS, WHITE
from studies.readings.run import AUTHOR, CONTROLS, ROUNDINGS

_WHITE, _DEMO, _LONG = CONTROLS
READING_OF = {
    (EXTRACTED, "4", 1_000): AUTHOR,
    (WHITE, "4", 1_000): _WHITE,
    (EXTRACTED, "2 pi", 1_000): _DEMO,
    (EXTRACTED, "4", 5_000): _LONG,
}
"""The reading of `studies.readings` with which each kind of run is compared."""
MEASURED = {
    ("C5", "early_accuracy"): "share classified correctly, first half",
    ("C5", "late_accuracy"): "share classified correctly, second half",
    ("C5", "late_least"): "the same of the kind with the smaller share",
    ("C6", "auc_over_floor"): "AUC over its floor",
    ("C6", "scale_difference"): "log ratio of standard deviations",
    ("C6", "lag_one_error"): "error of the lag-1 correlation",
    ("C6", "marginal_distance"): "distance of the distributions",
    ("C6", "rank_ratio"): "share of the effective rank",
}
"""The measurements that are compared, in words."""


def pairs(his: pd.DataFrame, ours: pd.DataFrame) -> pd.DataFrame:
    """The values of both, one row for each kind of run, measurement and seed. Of several roundings
    of ours, it is the first one: runs of one seed are not independent.

    Args:
        his: The table of `run.collect`.
        ours: The table of `studies.readings.run.collect`.

    Returns:
        Columns `kind`, `claim`, `name`, `whose` (`his` or `ours`), `seed` and `value`.
    """
    kinds = {reading: kind for kind, reading in READING_OF.items()}
    ours = ours[ours["reading"].isin(kinds)]
    first = ours.groupby(["reading", "seed"])["rounding"].transform(
        lambda given: min(given, key=list(ROUNDINGS).index)
    )
    ours = ours[ours["rounding"] == first]
    both = {
        "his": his.assign(kind=list(zip(*(his[key] for key in KEYS[:3]), strict=True))),
        "ours": ours.assign(kind=ours["reading"].map(kinds)),
    }
    columns = ["kind", "claim", "name", "whose", "seed", "value"]
    return pd.concat(
        [table.assign(whose=whose)[columns] for whose, table in both.items()], ignore_index=True
    )


def words_of(kind: tuple[str, str, int]) -> str:
    """A kind of run in words."""
    noise, span, iterations = kind
    return f"{noise}, span {span}, {iterations:,}"


def beside(his: pd.DataFrame, ours: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """The table of the README: median and range of each measurement over seeds, his and ours, and
    the p-value of the exact Mann-Whitney test where both have three seeds.

    Returns:
        Header and rows.
    """
    rows = []
    groups = pairs(his, ours).groupby(["kind", "claim", "name", "whose"], sort=False)["value"]
    values = {key: group.to_numpy() for key, group in groups}
    for kind in READING_OF:
        for measured, words in MEASURED.items():
            both = [values.get((kind, *measured, whose), ()) for whose in ("his", "ours")]
            if not len(both[0]):
                continue
            is_tested = min(map(len, both)) >= 3
            p = f"{mannwhitneyu(*both, method='exact').pvalue:.2g}" if is_tested else ""
            rows.append([words_of(kind), words, *map(_range, both), p])
    return ["run", "measurement", "his code (seeds)", "ours (seeds)", "p"], rows


def _range(values: np.ndarray) -> str:
    if not len(values):
        return "not run yet"
    low, middle, high = np.quantile(values, [0, 0.5, 1])
    return f"{middle:.3g} ({low:.3g} to {high:.3g}; {len(values)})"
