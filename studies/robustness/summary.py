"""Findings of the study of robustness, computed from its published tables alone."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common.detectors import CONTROLS, DETECTORS
from studies.common.noise_processes import NOISES
from studies.common.statistics import t_interval
from studies.common.tables import KeptTables, seeds_of
from studies.robustness.degraded_modes import LARGEST_TRAINED, METHODS
from studies.robustness.replicate import ARMS

if TYPE_CHECKING:
    import pandas as pd

REPLICATE = ["environment", "seed"]
CONTRASTS = (
    ("enhanced + GAN", "enhanced"),
    ("enhanced + GAN", "ridge + residual windows"),
    ("ridge + residual windows", "real"),
)
"""Declared before the runs: the paper's noise against none and against drawn residuals, and these
against real telemetry.
"""
KEPT = KeptTables(
    ("alarms", "recall", "degraded"),
    labels=("environment", "arm", "detector", "kind", "method", "mode"),
    digits=4,
    command="python -m studies.robustness",
    digits_of={"recall": 3},  # shares of 150 windows, in the largest table
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the README and the figures.

    Args:
        tables: As `KEPT.read` gives them.

    Returns:
        Plain JSON types: what was run, and an entry for each question.
    """
    rate = rates(tables["alarms"])
    environments = [name for name in NOISES if name in set(rate["environment"])]
    return {
        "environments": environments,
        "seeds": seeds_of(rate),
        "num_replicates": int(rate.groupby(REPLICATE).ngroups),
        "num_windows": int(rate["windows"].median()),
        "arms": arms(tables["alarms"], tables["recall"], environments),
        "controls": controls(tables["alarms"], tables["recall"]),
        "contrasts": contrasts(tables["alarms"]),
        "modes": modes(tables["degraded"]),
    }


def rates(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """False-alarm rate of each environment, seed, arm and detector, over all blocks of time: column
    `rate`.
    """
    counts = alarms.groupby([*REPLICATE, "arm", "detector"], as_index=False)[
        ["alarms", "windows"]
    ].sum()
    return counts.assign(rate=counts["alarms"] / counts["windows"])


def trained(table: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of detectors that are trained on an arm, without scores of one line."""
    return table[table["detector"].isin(list(DETECTORS))]


def by_block(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """Mean false-alarm rate of the trained detectors in each block of time; one column per arm.

    Blocks can differ in size by one window. The alarms of each block are divided by the mean number
    of windows per block, so that the mean over blocks is the rate of the replicate.
    """
    blocks = trained(alarms)
    groups = blocks.groupby([*REPLICATE, "arm", "detector"])["windows"]
    share = blocks["alarms"] * groups.transform("size") / groups.transform("sum")
    return (
        blocks.assign(share=share)
        .groupby([*REPLICATE, "block", "arm"])["share"]
        .mean()
        .unstack("arm")
    )


def arms(
    alarms: "pd.DataFrame", recall: "pd.DataFrame", environments: Sequence[str]
) -> dict[str, Any]:
    """False alarms, recall and the criterion of claim C8 for each arm."""
    cells = [*REPLICATE, "arm", "detector"]
    rate = trained(rates(alarms)).set_index(cells)["rate"]
    found = trained(recall).groupby(cells)[["recall", "recall_at_real_rate"]].mean()
    per_detector, recalls = (
        each.groupby(["arm", "environment", "detector"]).mean() for each in (rate, found)
    )
    blocks = by_block(alarms)
    kept = keeps_the_rule(per_detector, recalls["recall"])
    return {
        arm: {
            "false_alarms": _share(over_seeds(blocks[arm])),
            **{name: float(recalls.loc[arm, name].mean()) for name in recalls},
            "recalls_at_real_rate": recalls.loc[arm, "recall_at_real_rate"]
            .groupby("detector")
            .mean()
            .to_dict(),
            "criterion": {"met": int(kept[arm].sum()), "of": len(kept)},
            "by_environment": {
                name: {
                    "false_alarms": _share(over_seeds(blocks[arm].xs(name))),
                    "recall_at_real_rate": float(
                        recalls.loc[(arm, name), "recall_at_real_rate"].mean()
                    ),
                    "detectors": per_detector[arm, name].to_dict(),
                }
                for name in environments
            },
        }
        for arm in ARMS
    }


def over_seeds(values: "pd.Series") -> dict[str, float | None]:
    """The mean of a series with Student's interval over its seeds; kinds of noise are fixed."""
    return t_interval(values.groupby("seed").mean())


def _share(found: Mapping[str, float | None]) -> dict[str, float | None]:
    """The interval of a share, limited to 0 and 1."""
    return {
        name: None if value is None else min(max(value, 0.0), 1.0) for name, value in found.items()
    }


def keeps_the_rule(rate: "pd.Series", recall: "pd.Series") -> "pd.DataFrame":
    """Whether each row of rates and recalls, indexed by `arm` and more, meets the criterion of
    claim C8; one column per arm.

    The false-alarm rate has to be at most twice that of training on real telemetry plus one
    percentage point, and recall at most five points lower.
    """
    rates = rate.unstack("arm")
    recalls = recall.unstack("arm")
    return rates.le(2 * rates["real"] + 0.01, axis=0) & recalls.ge(recalls["real"] - 0.05, axis=0)


def controls(alarms: "pd.DataFrame", recall: "pd.DataFrame") -> dict[str, Any]:
    """False alarms and recall of scores of one line of code, with thresholds set on real
    windows.
    """
    rate = rates(alarms).groupby("detector")["rate"].mean()
    found = recall.groupby("detector")[["recall", "recall_at_real_rate"]].mean()
    return {
        name: {"false_alarms": float(rate[name]), **found.loc[name].astype(float).to_dict()}
        for name in CONTROLS
    }


def contrasts(alarms: "pd.DataFrame") -> list[dict[str, Any]]:
    """Differences in false alarms between arms, means over detectors: over all kinds of noise, and
    for each.
    """
    blocks = by_block(alarms)
    return [
        {
            "first": first,
            "second": second,
            "difference": over_seeds(difference),
            "by_environment": {
                name: over_seeds(difference.xs(name))
                for name in difference.index.unique("environment")
            },
        }
        for first, second in CONTRASTS
        for difference in [blocks[first] - blocks[second]]
    ]


def modes(degraded: "pd.DataFrame") -> dict[str, Any]:
    """Error of each method on nominal windows, inside and outside the severities of training, and
    by mode and severity.
    """
    where = np.select(
        [degraded["mode"] == "nominal", degraded["severity"] <= LARGEST_TRAINED],
        ["nominal", "inside"],
        default="outside",
    )
    by_range = degraded.assign(where=where).groupby(["method", "where"])["nrmse"].mean()
    by_mode = degraded.groupby(["method", "mode", "severity"])["nrmse"].mean()
    return {
        "seeds": seeds_of(degraded),
        "nrmse": {method: by_range[method].to_dict() for method in METHODS},
        "by_mode": {
            method: {
                mode: [
                    [round(float(severity), 4), float(value)]
                    for severity, value in values.droplevel(0).items()
                ]
                for mode, values in by_mode[method].groupby(level="mode")
            }
            for method in METHODS
        },
    }
