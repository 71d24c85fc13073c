"""Findings of the study of real telemetry: all numbers of its figures and report, computed from the tables of its channels."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common import statistics
from studies.common.tables import KeptTables
from studies.spacecraft.matched import RATES, chance_of
from studies.spacecraft.rates import PRIMARY, Rates, rates_of
from studies.spacecraft.study import ARMS, DEGRADED_ARM, GENERATED_ARM, RIDGE_ARM, TABLES

if TYPE_CHECKING:
    import pandas as pd

NEARER = 2 / 3
"""Largest ratio of the errors of the enhanced and the coarse signal for an error that is lower by a third."""
SATURATED = 0.5
"""A channel is told apart if, for the median noisy arm, detectors alarm on more than this share of its nominal windows; fixed before the run."""
NEARLY_ALL, FEW = 0.99, 0.01
"""Shares of nominal windows from and up to which a detector flags nearly all and few of them; the mean of these two groups describes neither."""
CLEAN_ARMS = ("coarse", "enhanced")
"""Arms without noise. Their detectors alarm on most windows of every channel, so they do not tell channels apart."""
CONTROLS = ("random score", "largest step", "moving deviation", "limit check")
"""Detectors of one line, trained on the channel's own past."""
CONTRASTS = (
    (GENERATED_ARM, "real"),
    (GENERATED_ARM, RIDGE_ARM),
    (GENERATED_ARM, "enhanced + bootstrap"),
    (GENERATED_ARM, "enhanced + AR"),
    (GENERATED_ARM, "enhanced + GAN"),
    (RIDGE_ARM, "real"),
    ("moving deviation", GENERATED_ARM),
    ("largest step", GENERATED_ARM),
)
"""Differences between arms or controls that were declared before the run."""
KEPT = KeptTables(
    TABLES,
    labels=("arm", "detector", "channel", "class", "method", "rule", "dropped"),
    digits=5,
    kind="study",
    command="python -m studies.spacecraft --data FOLDER",
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.
    """
    rates = rates_of(tables)
    channels = {name: _channel(tables, rates, name) for name in rates.names}
    usable = [name for name, about in channels.items() if not about["told_apart"]]
    arms = {arm: _arm(tables, rates, rates.of_arm(arm), usable) for arm in (*ARMS, DEGRADED_ARM) if rates.of_arm(arm).any()}
    for arm, about in arms.items():
        rows = {detector: rates.of_arm(arm) & (rates.cells["detector"] == detector).to_numpy() for detector in rates.detectors(arm)}
        about["by_detector"] = {detector: _short(tables, rates, chosen) for detector, chosen in rows.items()}
    controls = {name: _arm(tables, rates, rates.of_control(name), usable) for name in CONTROLS}
    oracle = tables["ranking"].query("detector == 'oracle'")
    return {
        "channels": channels,
        "told_apart": [name for name in channels if name not in usable],
        "arms": arms,
        "controls": controls,
        "oracle": {"vus_pr": float(oracle["vus_pr"].mean()), "auc_pr": float(oracle["auc_pr"].mean())},
        "contrasts": [_contrast(rates, *pair) for pair in CONTRASTS if {*pair} <= {*arms, *controls}],
        "num_sequences": rates.num_sequences,
        "seeds": rates.seeds,
        "rates": list(RATES),
        "bars": _bars(channels),
    }


def _channel(tables: "Mapping[str, pd.DataFrame]", rates: Rates, name: str) -> dict[str, Any]:
    about = tables["channels"].query("channel == @name").iloc[0]
    enhancement = tables["enhancement"].query("channel == @name").groupby("method", sort=False)
    cells = rates.cells.query("channel == @name")
    there = [arm for arm in ARMS if rates.of_arm(arm)[cells.index].any()]  # an arm that could not be made is missing
    by_arm = {arm: cells[rates.of_arm(arm)[cells.index]]["own"].mean() for arm in there}
    noisy = float(np.median([rate for arm, rate in by_arm.items() if arm not in CLEAN_ARMS]))
    by_detector = {
        arm: cells[rates.of_arm(arm)[cells.index]].groupby("detector", sort=False)["own"].mean().to_dict() for arm in (*there, DEGRADED_ARM)
    }
    dropped = sorted({reason for reason in _of_channel(tables, name).get("dropped", ()) if reason and reason != "nan"})
    return ({"dropped": dropped} if dropped else {}) | {
        "window": int(about["window"]),
        "period": float(about["period"]),
        "num_train_windows": int(about["train_samples"] // about["window"]),
        "num_windows": int(enhancement["windows"].first().iloc[0]),
        "num_scored": rates.num_nominal[name],
        "penalty": float(about["penalty"]),
        "nrmse": {method: float(value) for method, value in enhancement["nrmse"].mean().items()},
        "false_alarms": by_detector,
        "false_alarms_by_arm": {arm: float(rate) for arm, rate in by_arm.items()},
        "median_arm": noisy,
        "told_apart": noisy > SATURATED,
        "found": {arm: rates.found(rates.of_arm(arm), PRIMARY, [name]) for arm in there},
        "sequences": [
            {"sequence": int(row["sequence"]), "class": row["class"], "length": int(row["stop"] - row["start"]), "found": found}
            for row, found in rates.by_sequence(name, [*ARMS, *CONTROLS])
        ],
    }


def _of_channel(tables: "Mapping[str, pd.DataFrame]", name: str) -> "pd.DataFrame":
    return tables["channels"].query("channel == @name")


def _arm(tables: "Mapping[str, pd.DataFrame]", rates: Rates, rows: np.ndarray, usable: list[str]) -> dict[str, Any]:
    """Results of the detectors of one arm, or of one control; `rows` selects them among the cells."""
    cells = rates.cells[rows]
    ranking = _ranking_of(tables, cells)
    return {
        "false_alarms": _crossed(cells, "own"),
        "false_alarms_past": _crossed(cells, "past"),
        "median_false_alarms": float(cells["own"].median()),
        "flag_nearly_all": float((cells["own"] >= NEARLY_ALL).mean()),
        "flag_few": float((cells["own"] <= FEW).mean()),
        "found": _found(rates, rows, "own"),
        "found_past": _found(rates, rows, "past"),
        "matched": [{"rate": rate, **_found(rates, rows, rate)} for rate in RATES],
        "usable": {
            "false_alarms": float(cells[cells["channel"].isin(usable)]["own"].mean()) if cells["channel"].isin(usable).any() else None,
            "found": rates.found(rows, PRIMARY, usable) if cells["channel"].isin(usable).any() else None,
        },
        "median_delay": rates.median_delay(rows),
        "vus_pr": float(ranking["vus_pr"].mean()),
        "auc_pr": float(ranking["auc_pr"].mean()),
    }


def _short(tables: "Mapping[str, pd.DataFrame]", rates: Rates, rows: np.ndarray) -> dict[str, float]:
    cells = rates.cells[rows]
    ranking = _ranking_of(tables, cells)
    return {
        "false_alarms": float(cells["own"].mean()),
        "found": rates.found(rows, PRIMARY),
        "found_by_rate": [rates.found(rows, rate) for rate in RATES],
        "vus_pr": float(ranking["vus_pr"].mean()),
        "auc_pr": float(ranking["auc_pr"].mean()),
    }


def _ranking_of(tables: "Mapping[str, pd.DataFrame]", cells: "pd.DataFrame") -> "pd.DataFrame":
    return tables["ranking"].merge(cells[["channel", "seed", "arm", "detector"]], on=["channel", "seed", "arm", "detector"])


def _crossed(cells: "pd.DataFrame", value: str) -> dict[str, float]:
    """Mean over detectors, channels and seeds, with its interval by the crossed bootstrap over channels and seeds."""
    means = cells.groupby(["channel", "seed"], as_index=False)[value].mean()
    found = statistics.crossed_interval(_with_all_seeds(means), value, ["channel", "seed"])
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def _with_all_seeds(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Returns the channels that have the most seeds. An arm that could not be made with one seed leaves out that channel."""
    counts = rows.groupby("channel")["seed"].transform("count")
    return rows[counts == counts.max()]


def _found(rates: Rates, rows: np.ndarray, rule: float | str) -> dict[str, float]:
    """Share of the labelled sequences that is found, its interval over channels and sequences in them, and chance."""
    interval = statistics.hierarchical_interval(rates.shares(rows, rule), "found", ["channel", "sequence"])
    chance, p_value = chance_of(rates.counts_by_shift(rows, rule))
    sequences = len(rates.shares(rows, rule))
    return {
        "mean": interval.estimate,
        "low": interval.low,
        "high": interval.high,
        "chance": chance / sequences,
        "p_value": p_value,
    }


def _contrast(rates: Rates, first: str, second: str) -> dict[str, Any]:
    """Differences of two arms in false alarms and in finds at the primary matched rate, with the channels as replicates."""
    rows = [rates.of_control(name) if name in CONTROLS else rates.of_arm(name) for name in (first, second)]
    alarms = [rates.cells[each].groupby(["channel", "seed"])["own"].mean() for each in rows]
    difference = (alarms[0] - alarms[1]).dropna().rename("difference").reset_index()  # channels that have both
    interval = statistics.crossed_interval(_with_all_seeds(difference), "difference", ["channel", "seed"])
    shares = [rates.shares(each, PRIMARY).set_index(["channel", "sequence"])["found"] for each in rows]
    finds = (shares[0] - shares[1]).dropna().reset_index()
    found = statistics.hierarchical_interval(finds, "found", ["channel", "sequence"])
    return {
        "first": first,
        "second": second,
        "false_alarms": {"mean": interval.estimate, "low": interval.low, "high": interval.high},
        "false_alarms_p_value": statistics.wilcoxon_signed_rank(difference.groupby("channel")["difference"].mean()),
        "found": {"mean": found.estimate, "low": found.low, "high": found.high},
        "found_p_value": statistics.wilcoxon_signed_rank(finds.groupby("channel")["found"].mean()),
    }


def _bars(channels: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """For each channel, which of the targets for the enhanced signal are reached."""
    errors = {name: about["nrmse"] for name, about in channels.items()}
    return {
        "best": {name: each["enhanced"] < min(each["coarse"], each["ridge"], each["ridge, own clock"]) for name, each in errors.items()},
        "nearer_by_a_third": {name: each["enhanced"] <= NEARER * each["coarse"] for name, each in errors.items()},
    }
