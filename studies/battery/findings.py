"""The numbers of the study of the battery, and the targets that were set before its first run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.detection.registry import DETECTORS
from studies.battery.detectors import REAL_120, RESAMPLED
from studies.battery.errors import ENHANCERS, FLOOR
from studies.common.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    ("errors", "choice", "trust", "speed", "runs", "alarms"),
    labels=("enhancer", "fault", "target", "rung", "what", "arm", "detector", "regime"),
    digits=5,
    kind="study",
    command="python -m studies.battery",
    digits_of={"speed": 9},
)
CHOSEN = {
    "coarse": "coarse itself",
    "level and gain": "level and gain",
    "ridge": "ridge, all columns",
    "ridge and network": "ridge and network",
}
"""For each rung that may be chosen the enhancer of the table of errors."""
LARGEST_SHARE = 0.5
"""On nominal orbits, the chosen enhancer has at most this share of the coarse simulator's error."""
LARGEST_LAG = 1.0
"""On nominal orbits, the chosen enhancer is behind ridge regression by at most so many standard errors of the difference."""
TRUSTED = 0.5
"""A fault counts as out of range if the trust score says so of more than this share of its windows."""
LEAST_SPEED = 1_000
"""An enhancer is at least so many times faster than the fine simulator."""
LARGEST_GAP, LEAST_DETECTORS = 0.02, 5
"""False alarms of detectors trained on enhanced windows with residuals drawn again are within this of those trained on as many
real orbits, for at least so many detectors."""
C9_RATIO = 2.0
"""Claim C9: in every degraded configuration at most so many times the nominal error, and below the coarse simulator's error."""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.
    """
    regimes = list(dict.fromkeys(tables["errors"]["regime"]))
    found = {regime: _regime({name: table[table["regime"] == regime] for name, table in tables.items()}) for regime in regimes}
    return {"seeds": sorted(set(tables["errors"]["seed"].tolist())), "regimes": found}


def _regime(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    errors, trust, choice = tables["errors"], tables["trust"], tables["choice"]
    chosen = choice[choice["is_chosen"]].set_index("seed")["rung"].map(CHOSEN)
    volts = _with_chosen(errors[errors["target"] == "volts"], chosen)
    celsius = errors[errors["target"] == "celsius"]
    runs = tables["runs"]
    about = {
        "num_seeds": len(chosen),
        "runs": {
            "number": int(runs["num_runs"].sum()),
            "reduced": int(runs["num_reduced"].sum()),
            "most_reductions": int(runs["most_reductions"].max()),
        },
        "chosen": {str(name): int(number) for name, number in chosen.value_counts().items()},
        "nominal": {name: _mean(_nominal(volts, name)) for name in (*ENHANCERS, "chosen", FLOOR)},
        "nominal_true": {name: _mean(_nominal(volts, name, "nrmse_true")) for name in (*ENHANCERS, "chosen")},
        "temperature": {name: _mean(_nominal(celsius, name)) for name in dict.fromkeys(celsius["enhancer"])},
        "faults": {
            kind: {
                "severities": sorted(set(rows["severity"].tolist())),
                **{name: _by_severity(rows[rows["enhancer"] == name], "nrmse") for name in (*ENHANCERS, "chosen", FLOOR)},
                "out_of_range": _by_severity(trust[trust["fault"] == kind], "out_of_range"),
            }
            for kind, rows in volts[volts["fault"] != "nominal"].groupby("fault", sort=False)
        },
        "out_of_range": float(trust[trust["fault"] == "nominal"]["out_of_range"].mean()),
        "seconds": {what: float(value) for what, value in tables["speed"].groupby("what", sort=False)["seconds"].mean().items()},
        "detectors": _detectors(tables["alarms"]),
    }
    return about | {"bars": _bars(about, volts)}


def _with_chosen(errors: "pd.DataFrame", chosen: "pd.Series") -> "pd.DataFrame":
    """Adds the rows of the chosen enhancer of each seed under the name `chosen`."""
    import pandas as pd

    picked = errors[errors["enhancer"] == errors["seed"].map(chosen)]
    return pd.concat([errors, picked.assign(enhancer="chosen")], ignore_index=True)


def _nominal(errors: "pd.DataFrame", name: str, value: str = "nrmse") -> np.ndarray:
    """Errors on nominal orbits, one for each seed in the order of the seeds."""
    rows = errors[(errors["enhancer"] == name) & (errors["fault"] == "nominal")].sort_values("seed")
    return rows[value].to_numpy(np.float64)


def _mean(values: np.ndarray) -> dict[str, float]:
    """Mean over seeds and its standard error, which is 0 for a single seed."""
    return {"mean": float(np.mean(values)), "standard_error": _standard_error(values)}


def _standard_error(values: np.ndarray) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0


def _by_severity(rows: "pd.DataFrame", value: str) -> list[float]:
    return [float(mean) for mean in rows.groupby("severity")[value].mean()]


def _detectors(alarms: "pd.DataFrame") -> dict[str, Any]:
    """For each arm and detector: false alarms, recall by fault and severity, and runs found; means over seeds."""
    found: dict[str, Any] = {}
    for (arm, detector), rows in alarms.groupby(["arm", "detector"], sort=False):
        nominal, faulty = rows[rows["fault"] == "nominal"], rows[rows["fault"] != "nominal"]
        found.setdefault(arm, {})[detector] = {
            "num_seeds": int(nominal["seed"].nunique()),
            "false_alarms": _mean(nominal["alarms"].to_numpy(np.float64)),
            "recall": float(faulty["alarms"].mean()),
            "recall_at_real_rate": float(faulty["alarms_at_real_rate"].mean()),
            "found": float(faulty["is_found"].mean()),
            "found_by_chance": float(nominal["is_found"].mean()),
            "by_fault": {kind: _by_severity(each, "alarms") for kind, each in faulty.groupby("fault", sort=False)},
            "by_fault_at_real_rate": {
                kind: _by_severity(each, "alarms_at_real_rate") for kind, each in faulty.groupby("fault", sort=False)
            },
        }
    return found


def _bars(about: Mapping[str, Any], volts: "pd.DataFrame") -> dict[str, Any]:
    """Which of the targets are reached, with the numbers behind each."""
    nominal, faults, seconds = about["nominal"], about["faults"], about["seconds"]
    share = nominal["chosen"]["mean"] / nominal["coarse itself"]["mean"]
    behind = _nominal(volts, "chosen") - _nominal(volts, "ridge, all columns")
    worse = [
        {"fault": kind, "severity": severity, "chosen": chosen, "coarse": coarse, "out_of_range": out, "is_warned": out > TRUSTED}
        for kind, each in faults.items()
        for severity, chosen, coarse, out in zip(
            each["severities"], each["chosen"], each["coarse itself"], each["out_of_range"], strict=True
        )
        if chosen >= coarse
    ]
    slowest = max(seconds[name] for name in CHOSEN.values() if name in about["chosen"])
    ratios = {
        "alone": seconds["fine simulator"] / slowest,
        "with_coarse": seconds["fine simulator"] / (slowest + seconds["coarse simulator"]),
    }
    largest = max(value for each in faults.values() for value in each["chosen"]) / nominal["chosen"]["mean"]
    below = all(chosen < coarse for each in faults.values() for chosen, coarse in zip(each["chosen"], each["coarse itself"], strict=True))
    gaps = _gaps(about["detectors"])
    return {
        "error": {"share": share, "is_reached": share <= LARGEST_SHARE},
        "ridge": {
            "behind": float(np.mean(behind)),
            "standard_error": _standard_error(behind),
            "is_reached": bool(np.mean(behind) <= LARGEST_LAG * _standard_error(behind)),
        },
        "faults": {"worse_than_coarse": worse, "is_reached": all(each["is_warned"] for each in worse)},
        "speed": ratios | {"is_reached": ratios["with_coarse"] >= LEAST_SPEED, "is_reached_alone": ratios["alone"] >= LEAST_SPEED},
        "alarms": {
            "gaps": gaps,
            "within": sum(abs(gap) <= LARGEST_GAP for gap in gaps.values()),
            "of": len(DETECTORS),
            "is_reached": sum(abs(gap) <= LARGEST_GAP for gap in gaps.values()) >= LEAST_DETECTORS,
        },
        "C9": {"largest_ratio": largest, "is_below_coarse": below, "is_reached": largest <= C9_RATIO and below},
    }


def _gaps(detectors: Mapping[str, Any]) -> dict[str, float]:
    """For each detector, false alarms trained on generated windows minus those trained on as many real orbits."""
    real, generated = detectors.get(REAL_120, {}), detectors.get(RESAMPLED, {})
    return {
        name: generated[name]["false_alarms"]["mean"] - real[name]["false_alarms"]["mean"]
        for name in DETECTORS
        if name in real and name in generated
    }
