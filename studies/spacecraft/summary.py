"""The findings of the study: every number of its README and figures, computed from its tables."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from studies.common.statistics import crossed_interval
from studies.common.tables import KeptTables
from studies.spacecraft.judging import RATES
from studies.spacecraft.reference import DISCORD, REFERENCE
from studies.spacecraft.run import TABLES
from studies.spacecraft.training_data import REAL, TRAINING

if TYPE_CHECKING:
    import pandas as pd

UNTRAINED = (DISCORD, "largest step", "moving deviation", "random score")
CONTROLS = (*UNTRAINED, "limit check")
"""Detectors that learn nothing but a threshold, and the limit check two limits, from the channel's own past."""
KEPT = KeptTables(
    TABLES,
    labels=("training", "detector", "channel", "method"),
    digits=5,
    kind="study",
    command="python -m studies.spacecraft --data FOLDER",
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.

    Returns:
        `sources`, `references` and `controls` with the results of detectors by the name of their training data or by their own;
        and `channels`, with the errors of the enhancers and the false alarms by training data.
    """
    rows = tables["detectors"]
    trained = {name: rows[(rows["training"] == name) & ~rows["detector"].isin(UNTRAINED)] for name in TRAINING}
    of_real = rows[rows["training"] == REAL]
    references = rows[rows["training"] == REFERENCE].groupby("detector", sort=False)
    return {
        "sources": {name: _results(each) | {"by_detector": _by_detector(each)} for name, each in trained.items() if len(each)},
        "references": {detector: _results(each) for detector, each in references},
        "controls": {name: _results(of_real[of_real["detector"] == name]) for name in CONTROLS},
        "channels": {name: _channel(tables, trained, name) for name in dict.fromkeys(tables["channels"]["channel"])},
        "num_sequences": int(rows.groupby("channel")["sequences"].first().sum()),
        "seeds": sorted(set(rows["seed"].tolist())),
    }


def _results(rows: "pd.DataFrame") -> dict[str, Any]:
    """Means over detectors, channels and seeds; intervals by the crossed bootstrap over channels and seeds."""
    by_channel = rows.groupby("channel")["false_alarms"].mean()
    return {
        "false_alarms": _interval(rows, "false_alarms"),
        "median_false_alarms": float(by_channel.median()),
        "false_alarms_past": float(rows["false_alarms_past"].mean()),
        "found": {f"{rate:g}": float(rows[f"found_at_{rate:g}"].sum() / rows["sequences"].sum()) for rate in RATES},
        "auc_pr": _interval(rows, "auc_pr"),
    }


def _by_detector(rows: "pd.DataFrame") -> dict[str, Any]:
    means = rows.groupby("detector", sort=False)[["false_alarms", "auc_pr"]].mean()
    return {detector: {name: float(value) for name, value in each.items()} for detector, each in means.iterrows()}


def _interval(rows: "pd.DataFrame", value: str) -> dict[str, float]:
    means = rows.groupby(["channel", "seed"], as_index=False)[value].mean()
    counts = means.groupby("channel")["seed"].transform("count")
    whole = means[counts == counts.max()]  # training data that could not be made with one seed leave out that channel
    found = crossed_interval(whole, value, ["channel", "seed"])
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def _channel(tables: "Mapping[str, pd.DataFrame]", trained: "Mapping[str, pd.DataFrame]", name: str) -> dict[str, Any]:
    about = tables["channels"].query("channel == @name").iloc[0]
    errors = tables["enhancement"].query("channel == @name").groupby("method", sort=False)["nrmse"].mean()
    return {
        "num_train_windows": int(about["train_samples"] // about["window"]),
        "num_nominal": int(about["num_nominal"]),
        "nrmse": {method: float(error) for method, error in errors.items()},
        "false_alarms": {
            training: float(each["false_alarms"].mean()) for training, rows in trained.items() if len(each := rows[rows["channel"] == name])
        },
    }
