"""The findings of the study: every number of its README and figures, computed from its tables."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from studies.common.statistics import mean_interval
from studies.common.tables import KeptTables
from studies.spacecraft.judging import RATES
from studies.spacecraft.reference import DISCORD, REFERENCE
from studies.spacecraft.training_data import REAL

if TYPE_CHECKING:
    import pandas as pd

UNTRAINED = (DISCORD, "largest step", "moving deviation", "random score")
CONTROLS = (*UNTRAINED, "limit check")
"""Detectors that learn nothing but a threshold, and the limit check two limits, from the channel's own past."""
KEPT = KeptTables(
    ("channels", "enhancement", "detectors"),
    labels=("training", "detector", "channel", "method"),
    digits=5,
    command="python -m studies.spacecraft --data FOLDER",
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.

    Returns:
        `sources`, `references` and `controls` with the results of detectors by the name of their training data or by their own;
        and `channels`, with the errors of the enhancers.
    """
    rows = tables["detectors"]
    trained = rows[(rows["training"] != REFERENCE) & ~rows["detector"].isin(UNTRAINED)]
    references = rows[rows["training"] == REFERENCE]
    controls = rows[(rows["training"] == REAL) & rows["detector"].isin(CONTROLS)]
    return {
        "sources": {
            name: _results(each) | {"by_detector": _by_detector(each)}
            for name, each in trained.groupby("training", sort=False)
        },
        "references": {
            name: _results(each) for name, each in references.groupby("detector", sort=False)
        },
        "controls": {
            name: _results(each) for name, each in controls.groupby("detector", sort=False)
        },
        "channels": {
            name: _channel(tables, name) for name in dict.fromkeys(tables["channels"]["channel"])
        },
        "num_sequences": int(rows.groupby("channel")["sequences"].first().sum()),
        "seeds": sorted(set(rows["seed"].tolist())),
    }


def _results(rows: "pd.DataFrame") -> dict[str, Any]:
    """Means over detectors, channels and seeds; intervals by the crossed bootstrap over channels and seeds."""
    levels = ["channel", "seed"]
    means = rows.groupby(levels)[["false_alarms", "auc_pr"]].mean()
    return {
        "false_alarms": mean_interval(means["false_alarms"], levels),
        "false_alarms_past": float(rows["false_alarms_past"].mean()),
        "found": {
            f"{rate:g}": float(rows[f"found_at_{rate:g}"].sum() / rows["sequences"].sum())
            for rate in RATES
        },
        "auc_pr": mean_interval(means["auc_pr"], levels),
    }


def _by_detector(rows: "pd.DataFrame") -> dict[str, Any]:
    means = rows.groupby("detector", sort=False)[["false_alarms", "auc_pr"]].mean()
    return {
        detector: {name: float(value) for name, value in each.items()}
        for detector, each in means.iterrows()
    }


def _channel(tables: "Mapping[str, pd.DataFrame]", name: str) -> dict[str, Any]:
    about = tables["channels"].query("channel == @name").iloc[0]
    errors = (
        tables["enhancement"]
        .query("channel == @name")
        .groupby("method", sort=False)["nrmse"]
        .mean()
    )
    return {
        "num_train_windows": int(about["train_samples"] // about["window"]),
        "num_nominal": int(about["num_nominal"]),
        "nrmse": {method: float(error) for method, error in errors.items()},
    }
