"""The findings of the study: every number of its README and figure."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from studies.common.statistics import mean_interval
from studies.common.tables import KeptTables
from studies.reference_or_source.cells import MAIN, NOMINAL
from studies.reference_or_source.recordings import COMMANDS
from studies.reference_or_source.uses import REFERENCE_FAULTS, SOURCE_FAULTS, USES

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    ("alarms",),
    labels=("axis", "level", "simulator", "use", "detector", "kind", "system"),
    digits=4,
    kind="study",
    command="python -m studies.reference_or_source",
)
DETECTOR = {
    use: "boosted trees" if use in (SOURCE_FAULTS, REFERENCE_FAULTS) else "joint size"
    for use in USES
}
"""The detector of each use that figure and sentences show, one for all uses that learn nominal windows."""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.

    Returns:
        For each system, a list of points with axis, level, simulator, known units and errors, and for each use what the chosen detector and
        the mean over all detectors find: recall, false alarms and events a day, each with an interval over seeds, kinds of faults and detectors.
    """
    table = tables["alarms"]
    found: dict[str, Any] = {"seeds": sorted(set(table["seed"].tolist())), "systems": {}}
    for system, rows in table.groupby("system", sort=False):
        points = []
        for (axis, level, simulator, units), each in rows.groupby(
            ["axis", "level", "simulator", "units"], sort=False
        ):
            errors = {
                name: float(each.groupby("seed")[name].first().mean())
                for name in ("error", "coarse_error")
            }
            uses = {use: _use(use, some) for use, some in each.groupby("use", sort=False)}
            points.append(
                {
                    "axis": axis,
                    "level": level,
                    "simulator": simulator,
                    "units": int(units),
                    **errors,
                    "uses": uses,
                }
            )
        found["systems"][system] = {"points": points, "severities": _severities(rows)}
    return found


def _use(use: str, rows: "pd.DataFrame") -> dict[str, Any]:
    rows = rows.astype({"alarms": float, "events": float})
    nominal, faulty = rows[rows["kind"] == NOMINAL], rows[rows["kind"] != NOMINAL]
    nominal = nominal.groupby(["detector", "seed"], as_index=False)[["alarms", "events"]].mean()
    faulty = faulty.groupby(["detector", "seed", "kind"], as_index=False, sort=False)[
        "alarms"
    ].mean()
    chosen = DETECTOR[use]
    best = faulty.groupby("detector", sort=False)["alarms"].mean()
    return {
        "recall": _interval(faulty[faulty["detector"] == chosen], "alarms", ["seed", "kind"]),
        "false_alarms": _interval(nominal[nominal["detector"] == chosen], "alarms", ["seed"]),
        "events": _interval(nominal[nominal["detector"] == chosen], "events", ["seed"]),
        "by_kind": {
            str(kind): float(each.mean())
            for kind, each in faulty[faulty["detector"] == chosen].groupby("kind", sort=False)[
                "alarms"
            ]
        },
        "mean_recall": _interval(faulty, "alarms", ["detector", "seed", "kind"]),
        "mean_false_alarms": _interval(nominal, "alarms", ["detector", "seed"]),
        "best": {"detector": str(best.idxmax()), "recall": float(best.max())},
    }


def _interval(rows: "pd.DataFrame", value: str, factors: list[str]) -> dict[str, float]:
    return mean_interval(rows.set_index(factors)[value], factors)


def _severities(rows: "pd.DataFrame") -> dict[str, dict[str, list[float]]]:
    """Recall of the chosen detector of each use at each severity, by use and kind."""
    rows = rows[
        (rows["axis"] == MAIN)
        & (rows["severity"] > 0)
        & (rows["detector"] == rows["use"].map(DETECTOR))
        & (rows["simulator"] != COMMANDS)
    ]
    found: dict[str, dict[str, list[float]]] = {}
    for (use, kind), each in rows.groupby(["use", "kind"], sort=False):
        found.setdefault(use, {})[kind] = (
            each.groupby("severity")["alarms"].mean().astype(float).tolist()
        )
    return found
