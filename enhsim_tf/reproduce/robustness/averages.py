"""What the findings on robustness are averages of: rates of replicates and of blocks of time, with their intervals."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from enhsim_tf.detection import metrics as detection
from enhsim_tf.reproduce import statistics as inference

if TYPE_CHECKING:
    import pandas as pd

REPLICATE = ["environment", "seed"]


def rates(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """False-alarm rate of each environment, seed, arm and detector, blocks of time added up: column `rate`."""
    counts = alarms.groupby([*REPLICATE, "arm", "detector"], as_index=False)[["alarms", "windows"]].sum()
    return counts.assign(rate=counts["alarms"] / counts["windows"])


def trained(table: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of detectors that learn from an arm: without the controls and the oracle."""
    from enhsim_tf.detection.registry import DETECTORS

    return table[table["detector"].isin(list(DETECTORS))]


def by_replicate(table: "pd.DataFrame", value: str) -> "pd.DataFrame":
    """Mean of a value over the detectors that learn, and over all else, of each replicate: arms in columns."""
    return trained(table).groupby([*REPLICATE, "arm"])[value].mean().unstack("arm")


def by_block(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """False alarms of each block of time, mean over the detectors that learn: arms in columns.

    Blocks may differ by a window. Each counts its alarms against an equal share of the windows, so that the mean over
    blocks is the rate of the replicate.
    """
    blocks = trained(alarms)
    groups = blocks.groupby([*REPLICATE, "arm", "detector"])["windows"]
    share = blocks["alarms"] * groups.transform("size") / groups.transform("sum")
    return blocks.assign(share=share).groupby([*REPLICATE, "block", "arm"])["share"].mean().unstack("arm")


def interval(values: "pd.Series", environment: str | None = None) -> dict[str, float]:
    """Mean and crossed interval of a series that is indexed by replicates, and by their blocks of time where it has any.

    Args:
        values: The series.
        environment: The one that is meant, whose seeds and blocks are drawn; None for all, which are drawn too.
    """
    chosen = values if environment is None else values.loc[[environment]]
    factors: Sequence[str] = REPLICATE if environment is None else REPLICATE[1:]
    found = inference.crossed_interval(chosen.rename("value").reset_index(), "value", factors)
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def gap_closed(mean_rate: "pd.DataFrame", arm: str) -> "pd.Series":
    """Share of the gap in false alarms between the coarse and the real-trained arm that an arm closes, replicate by replicate.

    Args:
        mean_rate: False-alarm rate of each replicate (rows) and arm (columns).
        arm: The arm.
    """
    import pandas as pd

    ends = zip(mean_rate[arm], mean_rate["coarse"], mean_rate["real"], strict=True)
    return pd.Series([detection.gap_closed(*rates) for rates in ends], mean_rate.index)
