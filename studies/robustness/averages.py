"""Averages for the findings on robustness: means over replicates and blocks of time, with confidence intervals."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from enhsim_tf.detection import metrics
from studies.common import statistics

if TYPE_CHECKING:
    import pandas as pd

REPLICATE = ["environment", "seed"]


def rates(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """False-alarm rate of each environment, seed, arm and detector, over all blocks of time: column `rate`."""
    counts = alarms.groupby([*REPLICATE, "arm", "detector"], as_index=False)[["alarms", "windows"]].sum()
    return counts.assign(rate=counts["alarms"] / counts["windows"])


def trained(table: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of detectors that are trained on an arm, without the controls and the oracle."""
    from enhsim_tf.detection.registry import DETECTORS

    return table[table["detector"].isin(list(DETECTORS))]


def by_replicate(table: "pd.DataFrame", value: str) -> "pd.DataFrame":
    """Mean of a value over the trained detectors and all other columns, for each replicate; one column per arm."""
    return trained(table).groupby([*REPLICATE, "arm"])[value].mean().unstack("arm")


def by_block(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """Mean false-alarm rate of the trained detectors in each block of time; one column per arm.

    Blocks can differ in size by one window. The alarms of each block are divided by the mean number of windows per block, so that
    the mean over blocks is the rate of the replicate.
    """
    blocks = trained(alarms)
    groups = blocks.groupby([*REPLICATE, "arm", "detector"])["windows"]
    share = blocks["alarms"] * groups.transform("size") / groups.transform("sum")
    return blocks.assign(share=share).groupby([*REPLICATE, "block", "arm"])["share"].mean().unstack("arm")


def interval(values: "pd.Series", environment: str | None = None) -> dict[str, float]:
    """Mean of a series and its bootstrap interval over crossed factors.

    The series is indexed by replicates, and by their blocks of time if it has any.

    Args:
        values: The series.
        environment: The environment, whose seeds and blocks are resampled; None for all, which are resampled too.
    """
    chosen = values if environment is None else values.loc[[environment]]
    factors: Sequence[str] = REPLICATE if environment is None else REPLICATE[1:]
    found = statistics.crossed_interval(chosen.rename("value").reset_index(), "value", factors)
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def gap_closed(mean_rate: "pd.DataFrame", arm: str) -> "pd.Series":
    """Share of the difference in false-alarm rate between the arms `coarse` and `real` that an arm removes, for each replicate.

    Args:
        mean_rate: False-alarm rate of each replicate (rows) and arm (columns).
        arm: The arm.
    """
    import pandas as pd

    ends = zip(mean_rate[arm], mean_rate["coarse"], mean_rate["real"], strict=True)
    return pd.Series([metrics.gap_closed(*rates) for rates in ends], mean_rate.index)
