"""The findings of the study: what the uses of the simulator find, and the target for false alarms
that was set before its first run.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.battery.detectors import REAL_120, WITH_RESIDUALS
from studies.common.statistics import mean_interval
from studies.common.tables import KeptTables, seeds_of

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    ("alarms",),
    labels=("fault", "training", "detector", "regime"),
    digits=5,
    command="python -m studies.battery",
)
LARGEST_GAP = 0.02
LEAST_DETECTORS = 5
"""False alarms of detectors trained on enhanced windows with residual windows are within this of
those trained on as many real orbits, for at least so many detectors."""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.
    """
    alarms = tables["alarms"].astype({"alarms": np.float64, "severity": np.float64})
    return {
        "seeds": seeds_of(alarms),
        "regimes": {
            regime: {
                "uses": {
                    name: _use(of_use) for name, of_use in rows.groupby("training", sort=False)
                },
                "targets": {"alarms": _alarm_target(rows)},
            }
            for regime, rows in alarms.groupby("regime", sort=False)
        },
    }


def _use(alarms: "pd.DataFrame") -> dict[str, Any]:
    """Means over seeds and the detectors that ran with every seed; intervals over both."""
    num_seeds = alarms.groupby("detector")["seed"].transform("nunique")
    alarms = alarms[num_seeds == num_seeds.max()]
    rows = ["detector", "seed"]
    nominal = alarms[alarms["fault"] == "nominal"]
    faulty = alarms[alarms["fault"] != "nominal"]
    by_fault = faulty.groupby(["fault", "severity"], sort=False)["alarms"].mean()
    return {
        "false_alarms": mean_interval(nominal.set_index(rows)["alarms"], rows),
        "recall": mean_interval(faulty.groupby(rows)["alarms"].mean(), rows),
        "by_fault": {
            kind: by_fault[kind].sort_index().tolist() for kind in dict.fromkeys(faulty["fault"])
        },
    }


def _alarm_target(alarms: "pd.DataFrame") -> dict[str, Any]:
    rates = alarms[alarms["fault"] == "nominal"].pivot_table("alarms", "detector", "training")
    gaps = (rates[WITH_RESIDUALS] - rates[REAL_120]).dropna().to_dict()
    within = int(np.sum(np.abs(list(gaps.values())) <= LARGEST_GAP))
    return {
        "gaps": gaps,
        "within": within,
        "of": len(gaps),
        "is_reached": within >= LEAST_DETECTORS,
    }
