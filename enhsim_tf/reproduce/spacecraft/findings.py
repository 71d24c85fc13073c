"""Findings of the study of real telemetry: all numbers of its figures and report, computed from the tables of its channels."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.reproduce import statistics
from enhsim_tf.reproduce.spacecraft.study import ARMS, DEGRADED_ARM, GENERATED_ARM, TABLES
from enhsim_tf.reproduce.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

LARGEST_RATIO = 1.5
"""Largest ratio of false alarms, trained on generated to trained on real telemetry; fixed before the first run."""
NEARER = 2 / 3
"""Largest ratio of the errors of the enhanced and the coarse signal for an error that is lower by a third."""
SATURATED = 0.9
"""If detectors of both trainings alarm on more than this share of nominal windows, their ratio is not informative."""
_CONTROLS = ("random score", "largest step", "moving deviation", "oracle")
KEPT = KeptTables(
    TABLES,
    labels=("arm", "detector", "channel", "class", "method"),
    digits=5,
    kind="study",
    command="python -m enhsim_tf.reproduce --experiment labelled --data FOLDER",
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.
    """
    channels = {name: _channel(tables, name) for name in dict.fromkeys(tables["alarms"]["channel"])}
    arms = {arm: _arm(tables, arm) for arm in (*ARMS, DEGRADED_ARM)}
    both = [
        min(about["false_alarms"][GENERATED_ARM][detector], about["false_alarms"]["real"][detector])
        for about in channels.values()
        for detector in about["ratios"]
    ]
    return {
        "channels": channels,
        "pairs": {"number": len(both), "saturated": sum(rate > SATURATED for rate in both), "above": SATURATED},
        "arms": arms,
        "controls": {name: _control(tables, name) for name in _CONTROLS},
        "num_sequences": sum(len(about["sequences"]) for about in channels.values()),
        "seeds": sorted(set(tables["alarms"]["seed"].tolist())),
        "bars": _bars(channels),
    }


def _rates(tables: "Mapping[str, pd.DataFrame]") -> "pd.DataFrame":
    by = ["channel", "arm", "detector"]
    counts = tables["alarms"].groupby(by, as_index=False, sort=False)[["alarms", "windows"]].sum()
    return counts.assign(rate=counts["alarms"] / counts["windows"])


def _channel(tables: "Mapping[str, pd.DataFrame]", name: str) -> dict[str, Any]:
    enhancement = tables["enhancement"].query("channel == @name").set_index("method")
    rates = _rates(tables).query("channel == @name and detector not in @_CONTROLS")
    false_alarms = {arm: dict(zip(rows["detector"], rows["rate"], strict=True)) for arm, rows in rates.groupby("arm", sort=False)}
    counts = rates.set_index(["arm", "detector"])
    ratios = {
        detector: float(
            # half an alarm is added on both sides, because zero alarms do not prove a rate of zero
            (counts.loc[(GENERATED_ARM, detector), "alarms"] + 0.5) / (counts.loc[("real", detector), "alarms"] + 0.5)
        )
        for detector in false_alarms["real"]
    }
    found = tables["sequences"].query("channel == @name and detector not in @_CONTROLS")
    sequences = []
    for number, rows in found.groupby("sequence"):
        by_arm = {arm: dict(zip(each["detector"], map(bool, each["found"]), strict=True)) for arm, each in rows.groupby("arm", sort=False)}
        delays = rows.query("arm == @GENERATED_ARM and found")["delay"]
        about = {"sequence": int(number), "class": rows["class"].iloc[0], "length": int(rows["length"].iloc[0]), "found": by_arm}
        sequences.append(about | {"median_delay": float(delays.median()) if len(delays) else None})
    return {
        "window": int(enhancement["window"].iloc[0]),
        "period": float(enhancement["period"].iloc[0]),
        "num_windows": int(enhancement["windows"].iloc[0]),
        "num_scored": int(rates["windows"].iloc[0]),
        "nrmse": {method: float(value) for method, value in enhancement["nrmse"].items()},
        "false_alarms": false_alarms,
        "ratios": ratios,
        "median_ratio": float(np.median(list(ratios.values()))),
        "sequences": sequences,
    }


def _arm(tables: "Mapping[str, pd.DataFrame]", arm: str) -> dict[str, Any]:
    rates = _rates(tables).query("arm == @arm and detector not in @_CONTROLS")
    sequences = tables["sequences"].query("arm == @arm and detector not in @_CONTROLS")
    ranking = tables["ranking"].query("arm == @arm and detector not in @_CONTROLS")
    by_sequence = sequences.assign(found=sequences["found"].astype(float))
    delays = sequences[sequences["found"]]["delay"]
    return {
        "false_alarms": _interval(rates, "rate", ["channel"]),
        "median_false_alarms": float(rates["rate"].median()),
        "found": _interval(by_sequence, "found", ["channel", "sequence"]),
        "median_delay": float(delays.median()) if len(delays) else None,
        "vus_pr": float(ranking["vus_pr"].mean()),
        "auc_pr": float(ranking["auc_pr"].mean()),
        "by_detector": {
            detector: {
                "false_alarms": float(rows["rate"].mean()),
                "found": float(by_sequence.query("detector == @detector")["found"].mean()),
                "vus_pr": float(ranking.query("detector == @detector")["vus_pr"].mean()),
                "auc_pr": float(ranking.query("detector == @detector")["auc_pr"].mean()),
            }
            for detector, rows in rates.groupby("detector", sort=False)
        },
    }


def _control(tables: "Mapping[str, pd.DataFrame]", name: str) -> dict[str, Any]:
    ranking = tables["ranking"].query("detector == @name")
    rates, sequences = _rates(tables).query("detector == @name"), tables["sequences"].query("detector == @name")
    about: dict[str, Any] = {"vus_pr": float(ranking["vus_pr"].mean()), "auc_pr": float(ranking["auc_pr"].mean())}
    if len(rates):
        about |= {"false_alarms": float(rates["rate"].mean()), "found": float(sequences["found"].astype(float).mean())}
    return about


def _interval(table: "pd.DataFrame", value: str, levels: list[str]) -> dict[str, float]:
    """Mean with its bootstrap interval over channels, or over sequences within channels; detectors stay together."""
    found = statistics.hierarchical_interval(table, value, levels)
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def _bars(channels: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """For each channel, which of the targets that were set before the first run are reached."""
    errors = {name: about["nrmse"] for name, about in channels.items()}
    found_by = {name: [_found_by(sequence) for sequence in about["sequences"]] for name, about in channels.items()}
    return {
        "best_of_three": {name: each["enhanced"] < min(each["coarse"], each["ridge"]) for name, each in errors.items()},
        "nearer_by_a_third": {name: each["enhanced"] <= NEARER * each["coarse"] for name, each in errors.items()},
        "false_alarms": {name: about["median_ratio"] <= LARGEST_RATIO for name, about in channels.items()},
        "found": found_by,
    }


def _found_by(sequence: Mapping[str, Any]) -> list[str]:
    """Detectors trained on generated telemetry that find a sequence."""
    return [detector for detector, is_found in sequence["found"][GENERATED_ARM].items() if is_found]
