"""The findings of the study: every number of its README and figure, and the targets that were set before its first run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.battery.detectors import REAL_120, WITH_RESIDUALS
from studies.common.statistics import mean_interval
from studies.common.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    ("errors", "choice", "trust", "speed", "runs", "alarms"),
    labels=("enhancer", "fault", "candidate", "what", "training", "detector", "regime"),
    digits=5,
    command="python -m studies.battery",
    digits_of={"speed": 9},
)
CHOSEN = {"coarse": "coarse itself", "ridge": "ridge, all columns"}
"""For each candidate the enhancer of the table of errors, if it has another name there."""
LARGEST_SHARE = 0.5
"""On nominal orbits, the chosen enhancer has at most this share of the coarse simulator's error."""
LARGEST_LAG = 1.0
"""On nominal orbits, the chosen enhancer is behind ridge regression by at most so many standard errors of the difference."""
TRUSTED = 0.5
"""A fault counts as out of range if the trust score says so of more than this share of its windows."""
LEAST_SPEED = 1_000
"""An enhancer is at least so many times faster than the fine simulator, with the coarse run."""
LARGEST_GAP, LEAST_DETECTORS = 0.02, 5
"""False alarms of detectors trained on enhanced windows with residual windows are within this of those trained on as many real
orbits, for at least so many detectors."""
C9_RATIO = 2.0
"""Claim C9: in every degraded configuration at most so many times the nominal error, and below the coarse simulator's error."""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.
    """
    tables = {name: table.astype(dict.fromkeys(table.select_dtypes("float32"), np.float64)) for name, table in tables.items()}
    regimes = dict.fromkeys(tables["errors"]["regime"])
    found = {regime: _regime({name: table[table["regime"] == regime] for name, table in tables.items()}) for regime in regimes}
    return {"seeds": sorted(set(tables["errors"]["seed"].tolist())), "regimes": found}


def _regime(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    import pandas as pd

    errors, choice, runs, alarms = (tables[name] for name in ("errors", "choice", "runs", "alarms"))
    chosen = choice[choice["is_chosen"]].set_index("seed")["candidate"].replace(CHOSEN)
    picked = errors[errors["enhancer"] == errors["seed"].map(chosen)]
    errors = pd.concat([errors, picked.assign(enhancer="chosen")], ignore_index=True)
    nominal = errors[errors["fault"] == "nominal"].pivot(index="seed", columns="enhancer", values="nrmse")
    faulty = errors[errors["fault"] != "nominal"].pivot_table("nrmse", ["fault", "severity"], "enhancer", sort=False)
    out = tables["trust"].groupby(["fault", "severity"])["out_of_range"].mean()
    seconds = {what: float(value) for what, value in tables["speed"].groupby("what", sort=False)["seconds"].mean().items()}
    times = {str(name): int(number) for name, number in chosen.value_counts().items()}
    return {
        "num_seeds": len(chosen),
        "runs": {"number": int(runs["num_runs"].sum()), "reduced": int(runs["num_reduced"].sum())},
        "chosen": times,
        "nominal": {name: {"mean": float(nominal[name].mean()), "standard_error": _standard_error(nominal[name])} for name in nominal},
        "on_faults": {name: float(faulty[name].mean()) for name in faulty},
        "seconds": seconds,
        "uses": {name: _use(rows) for name, rows in alarms.groupby("training", sort=False)},
        "targets": _error_targets(nominal, faulty, out) | _speed_target(seconds, times) | _alarm_target(alarms),
    }


def _standard_error(values: "pd.Series") -> float:
    """The standard error of a mean over seeds, which is 0 for a single seed."""
    return float(values.sem()) if len(values) > 1 else 0.0


def _use(alarms: "pd.DataFrame") -> dict[str, Any]:
    """Means over seeds and the detectors that ran with every seed; intervals over both."""
    num_seeds = alarms.groupby("detector")["seed"].transform("nunique")
    alarms = alarms[num_seeds == num_seeds.max()]
    rows = ["detector", "seed"]
    nominal, faulty = alarms[alarms["fault"] == "nominal"], alarms[alarms["fault"] != "nominal"]
    by_fault = faulty.groupby(["fault", "severity"], sort=False)["alarms"].mean()
    return {
        "false_alarms": mean_interval(nominal.set_index(rows)["alarms"], rows),
        "recall": mean_interval(faulty.groupby(rows)["alarms"].mean(), rows),
        "by_fault": {kind: by_fault[kind].sort_index().tolist() for kind in dict.fromkeys(faulty["fault"])},
    }


def _error_targets(nominal: "pd.DataFrame", faulty: "pd.DataFrame", out: "pd.Series") -> dict[str, Any]:
    share = float(nominal["chosen"].mean() / nominal["coarse itself"].mean())
    behind = nominal["chosen"] - nominal["ridge, all columns"]
    lag, error = float(behind.mean()), _standard_error(behind)
    worse = faulty[faulty["chosen"] >= faulty["coarse itself"]].index
    unwarned = [case for case in worse if out[case] <= TRUSTED]
    ratio = float(faulty["chosen"].max() / nominal["chosen"].mean())
    return {
        "error": {"share": share, "is_reached": share <= LARGEST_SHARE},
        "ridge": {"behind": lag, "standard_error": error, "is_reached": lag <= LARGEST_LAG * error},
        "faults": {"worse_than_coarse": len(worse), "without_warning": len(unwarned), "of": len(faulty), "is_reached": not unwarned},
        "C9": {"largest_ratio": ratio, "is_reached": ratio <= C9_RATIO and not len(worse)},
    }


def _speed_target(seconds: Mapping[str, float], times: Mapping[str, int]) -> dict[str, Any]:
    slowest = max(seconds[name] for name in times)
    with_coarse = seconds["fine simulator"] / (slowest + seconds["coarse simulator"])
    return {"speed": {"alone": seconds["fine simulator"] / slowest, "with_coarse": with_coarse, "is_reached": with_coarse >= LEAST_SPEED}}


def _alarm_target(alarms: "pd.DataFrame") -> dict[str, Any]:
    rates = alarms[alarms["fault"] == "nominal"].pivot_table("alarms", "detector", "training")
    gaps = (rates[WITH_RESIDUALS] - rates[REAL_120]).dropna().to_dict()
    within = int(np.sum(np.abs(list(gaps.values())) <= LARGEST_GAP))
    return {"alarms": {"gaps": gaps, "within": within, "of": len(gaps), "is_reached": within >= LEAST_DETECTORS}}
