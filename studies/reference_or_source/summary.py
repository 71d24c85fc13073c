"""The findings of the study: every number of its README and figure."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common.statistics import mean_interval
from studies.common.tables import KeptTables
from studies.reference_or_source.ageing import FITTED as CELL_FITTED
from studies.reference_or_source.detectors import MAIN
from studies.reference_or_source.judging import NOMINAL
from studies.reference_or_source.real_cells import JUDGED, KNOWN, ODD
from studies.reference_or_source.recordings import CRUDE, FITTED
from studies.reference_or_source.uses import (
    COARSE_REFERENCE,
    COMMANDS,
    NO_SIMULATOR,
    OF_SIMULATOR,
    ONE_STEP,
    REFERENCE,
    SOURCE,
)

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    ("found",),
    labels=(
        "axis",
        "level",
        "simulator",
        "use",
        "detector",
        "kind",
        "system",
        "group",
        "cell",
    ),
    digits=4,
    command="python -m studies.reference_or_source",
    former=("alarms",),
)
REAL = ("cells", "families")
"""The systems of real cells."""
PHYSICS = "single particle"
"""The simulator of the cells that the contrasts are about."""
FITTED_AND_ENHANCED = "fitted and enhanced"
ENHANCED = "enhanced"
FITTED_ALONE = "fitted"
COARSE = "coarse"
LABELS = {
    (FITTED, REFERENCE): FITTED_AND_ENHANCED,
    (CRUDE, REFERENCE): ENHANCED,
    (FITTED, COARSE_REFERENCE): FITTED_ALONE,
    (CRUDE, COARSE_REFERENCE): COARSE,
    (CRUDE, SOURCE): SOURCE,
}
"""What a use of a simulator is called."""
CONTRASTS = (
    (FITTED_AND_ENHANCED, COMMANDS),
    (COMMANDS, COARSE),
    (ENHANCED, COARSE),
    (FITTED_AND_ENHANCED, NO_SIMULATOR),
    (SOURCE, NO_SIMULATOR),
)
"""What was to be compared, written down before any result on the cells."""
SHOWN_TOO = (
    (ENHANCED, NO_SIMULATOR),
    (COARSE, NO_SIMULATOR),
    (FITTED_ALONE, NO_SIMULATOR),
    (COMMANDS, NO_SIMULATOR),
    (ONE_STEP, NO_SIMULATOR),
)
"""Differences from the telemetry alone that decide nothing."""
FAMILY_CONTRAST = ("alone and 2", "sisters and 0")
LEAST_LOSS = 0.05
"""Discharges that lost so much capacity are to be found."""
FRESH = 0.02
"""Later discharges that lost less are as good as new; what is flagged of them is a false alarm."""
PARITY = 0.1
LEAST_BETTER = 0.05
"""Limits of the answers: parity if the interval lies within the first, better or worse if it leaves
out 0 and the mean is at least the second."""
_NUM_RESAMPLES = 2_000


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: As `KEPT.read` returns them.

    Returns:
        For each system and use what the detector `MAIN` finds, at which severity half is found, and
        false alarms; the contrasts with intervals and answers; the same of the other detectors;
        and, if its table is there, `systems`: the earlier map over known telemetry.
    """
    table = tables["found"].astype({"severity": float, "found": float, "found_alike": float})
    # a run of the simulated systems alone has no columns of cells
    missing = {name: "" for name in ("group", "cell", "level") if name not in table}
    table = table.assign(**missing)
    table = table.assign(label=_labels(table))
    by_detector = {
        detector: _of_detector(rows) for detector, rows in table.groupby("detector", sort=False)
    }
    found = {"seeds": sorted(set(table["seed"].tolist()) - {0}), **by_detector.pop(MAIN)}
    found["other_detectors"] = by_detector
    return found | ({"systems": _map(tables["alarms"])} if "alarms" in tables else {})


def _of_detector(table: "pd.DataFrame") -> dict[str, Any]:
    """What one detector finds in each system and use, and the contrasts."""
    found: dict[str, Any] = {"uses": {}, "contrasts": {}}
    for system, rows in table.groupby("system", sort=False):
        factors = ["group", "cell"] if system in REAL else ["seed", "kind"]
        by_label = dict(iter(rows.groupby("label", sort=False)))
        values = {label: _by_unit(each, factors) for label, each in by_label.items()}
        found["uses"][system] = {
            label: {
                "found": _interval(values[label]["found"], factors),
                "found_alike": _interval(values[label]["found_alike"], factors),
                "false_alarms": float(_nominal(each)["found"].mean()),
                "half": _half(each, factors),
                "course": _course(each, factors),
                "fresh": _fresh(each),
                "odd": {
                    str(cell): float(odd["found"].mean())
                    for cell, odd in each[each["kind"] == ODD].groupby("cell", sort=False)
                },
            }
            for label, each in by_label.items()
        }
        pairs = CONTRASTS + SHOWN_TOO
        if system == "families":
            pairs = (tuple(f"{ENHANCED}, {level}" for level in FAMILY_CONTRAST),)
        found["contrasts"][system] = {
            f"{first} - {second}": _contrast(values[first], values[second], factors)
            for first, second in pairs
        }
    return found


def _labels(table: "pd.DataFrame") -> list[str]:
    """What the use of each row is called."""
    labels = []
    for system, simulator, use, level in zip(
        table["system"], table["simulator"], table["use"], table["level"], strict=True
    ):
        name = simulator
        if system in REAL:
            name = FITTED if simulator.endswith(CELL_FITTED) else CRUDE
        label = LABELS.get((name, use), use if use not in OF_SIMULATOR else f"{use}, fitted")
        physics = simulator.removesuffix(CELL_FITTED)
        if system == "cells" and use in OF_SIMULATOR and physics != PHYSICS:
            label = f"{label}, {physics}"
        labels.append(f"{label}, {level}" if system == "families" else label)
    return labels


def _nominal(rows: "pd.DataFrame") -> "pd.DataFrame":
    return rows[rows["kind"].isin([NOMINAL, KNOWN])]


def _judged(rows: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of faults, and of later discharges."""
    return rows[~rows["kind"].isin([NOMINAL, KNOWN, ODD])]


def _by_unit(rows: "pd.DataFrame", factors: list[str]) -> "pd.DataFrame":
    """The shares of what is to be found, of each cell, or of each seed and kind of fault."""
    judged = _judged(rows)
    chosen = judged[(judged["kind"] != JUDGED) | (judged["severity"] >= LEAST_LOSS)]
    return chosen.groupby(factors, sort=False)[["found", "found_alike"]].mean()


def _interval(values: "pd.Series", factors: list[str]) -> dict[str, float]:
    return nested_interval(values) if factors[0] == "group" else mean_interval(values, factors)


def nested_interval(values: "pd.Series") -> dict[str, float]:
    """The mean over cells, and its 95 % percentile interval by resampling groups, and then the
    cells of each.

    Args:
        values: One value a cell, with the levels `group` and `cell` in its index.
    """
    groups = [each.to_numpy() for _, each in values.groupby("group", sort=False)]
    sizes = np.array([len(each) for each in groups])
    rng = np.random.default_rng(0)
    total, number = np.zeros((2, _NUM_RESAMPLES))
    for _ in groups:
        chosen = rng.integers(0, len(groups), _NUM_RESAMPLES)
        sums = [
            each[rng.integers(0, len(each), (_NUM_RESAMPLES, len(each)))].sum(axis=1)
            for each in groups
        ]
        total += np.stack(sums)[chosen, np.arange(_NUM_RESAMPLES)]
        number += sizes[chosen]
    means = total / number
    low, high = np.quantile(means, [0.025, 0.975]).tolist()
    return {"mean": float(values.mean()), "low": low, "high": high}


def _contrast(first: "pd.DataFrame", second: "pd.DataFrame", factors: list[str]) -> dict[str, Any]:
    """The difference of two uses at equal false alarms, and at the thresholds that were set."""
    alike = _interval(first["found_alike"] - second["found_alike"], factors)
    as_set = _interval(first["found"] - second["found"], factors)
    return {"alike": alike, "as_set": as_set, "answer": answer(alike)}


def answer(interval: Mapping[str, float]) -> str:
    """The answer that an interval of a difference gives: better, worse, parity or undecided."""
    if interval["low"] > 0 and interval["mean"] >= LEAST_BETTER:
        return "better"
    if interval["high"] < 0 and interval["mean"] <= -LEAST_BETTER:
        return "worse"
    if -PARITY <= interval["low"] and interval["high"] <= PARITY:
        return "parity"
    return "undecided"


def _fresh(rows: "pd.DataFrame") -> float | None:
    """The share of windows flagged of later discharges that lost less than `FRESH`, a mean over
    cells; None for other systems.
    """
    fresh = rows[(rows["kind"] == JUDGED) & (rows["severity"] < FRESH)]
    return float(fresh.groupby("cell")["found"].mean().mean()) if len(fresh) else None


def _half(rows: "pd.DataFrame", factors: list[str]) -> dict[str, float | None]:
    """The severity or loss at which half of the windows are found, of each cell or kind of fault;
    None where it is never reached.
    """
    return {
        str(name): severity_at_half(each["severity"].to_numpy(), each["found_alike"].to_numpy())
        for name, each in _judged(rows).groupby(factors[1], sort=False)
    }


def severity_at_half(severities: np.ndarray, shares: np.ndarray) -> float | None:
    """Where an isotonic regression of shares over severities first reaches one half; None: never.

    Between two severities it is interpolated.
    """
    from sklearn.isotonic import IsotonicRegression

    fitted = IsotonicRegression(increasing=True).fit(severities, shares)
    grid = np.linspace(severities.min(), severities.max(), 1_001)
    reached = np.flatnonzero(fitted.predict(grid) >= 0.5)
    return float(grid[reached[0]]) if len(reached) else None


def _course(rows: "pd.DataFrame", factors: list[str]) -> dict[str, list[float]]:
    """Share of windows found over severity, at equal false alarms, and the number of cells or kinds
    in each; cells in steps of 2.5 % of their capacity.
    """
    judged = _judged(rows)
    severity = judged["severity"]
    if factors[0] == "group":
        severity = np.round(severity / 0.025) * 0.025
    by_unit = judged.groupby([severity.rename("at"), factors[1]])["found_alike"].mean()
    means = by_unit.groupby("at").agg(["mean", "size"])
    return {
        "severity": [round(float(at), 4) for at in means.index],
        "found": means["mean"].astype(float).tolist(),
        "number": means["size"].astype(int).tolist(),
    }


def _map(table: "pd.DataFrame") -> dict[str, Any]:
    """The earlier map of battery and aircraft over known telemetry, with wrong physics."""
    main = table[(table["axis"] == "main") & (table["simulator"] == CRUDE)]
    systems: dict[str, Any] = {}
    for (system, units), rows in main.groupby(["system", "units"], sort=False):
        uses = {use: _use_of_map(each) for use, each in rows.groupby("use", sort=False)}
        point = {"axis": "main", "simulator": CRUDE, "units": int(units), "uses": uses}
        systems.setdefault(system, {"points": []})["points"].append(point)
    return systems


def _use_of_map(rows: "pd.DataFrame") -> dict[str, Any]:
    detector = "boosted trees" if "boosted trees" in set(rows["detector"]) else "joint size"
    rows = rows[rows["detector"] == detector].astype({"alarms": float})
    nominal = rows[rows["kind"] == NOMINAL]
    faulty = rows[rows["kind"] != NOMINAL]
    nominal = nominal.groupby(["seed"])["alarms"].mean()
    faulty = faulty.groupby(["seed", "kind"], sort=False)["alarms"].mean()
    by_kind = faulty.groupby("kind", sort=False).mean()
    return {
        "recall": mean_interval(faulty, ["seed", "kind"]),
        "false_alarms": mean_interval(nominal, ["seed"]),
        "by_kind": {str(kind): float(share) for kind, share in by_kind.items()},
    }
