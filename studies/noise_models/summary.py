"""What the tables of the study say: false alarms, recall and realism of each noise model on each family, and what `fit` would choose."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.simulator.noise_choice import MAX_ALARM_EXCESS, MAX_RECALL_LOSS, CandidateJudgement, choose
from studies.common.noise_processes import LOOKED_AT
from studies.common.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

REAL = "real"
KEPT = KeptTables(
    names=("detectors", "realism", "choice"),
    labels=("family", "model", "detector", "measure"),
    digits=4,
    command="python -m studies.noise_models",
)
MAX_REALISM_RATIO = 3.0  # of a measure to its value between two samples of real noise
OFFERED = ("gaussian", "autoregression", "residual windows", "matched residual windows")
"""The models among which the choice is followed. Without noise, detectors flag nearly every window, and `none` was tried on one seed."""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """Computes the findings from the tables.

    Args:
        tables: As `KEPT` names them.

    Returns:
        `families`: for each family whether it was looked at in the design, and for each model its results there; `models`: for each model
        on how many families it keeps the tolerances of `fit`; `choice`: what `fit` would choose, and how well that does; `seeds`.
    """
    models = list(dict.fromkeys(tables["detectors"]["model"]))
    families = {}
    for family in dict.fromkeys(tables["detectors"]["family"]):
        of_family = {name: table[table["family"] == family] for name, table in tables.items()}
        found = {name: _on_family(of_family, name) for name in models if name in set(of_family["detectors"]["model"])}
        families[family] = {"looked_at": family in LOOKED_AT, "models": found}
    return {
        "seeds": sorted({int(seed) for seed in tables["detectors"]["seed"]}),
        "families": families,
        "models": {
            name: _over_families([about["models"][name] for about in families.values() if name in about["models"]]) for name in models
        },
        "choice": _choices(tables),
    }


def _by_seed(detectors: "pd.DataFrame", model: str) -> "pd.DataFrame":
    """False-alarm rate and recall at own thresholds, means over the detectors, a row for each seed."""
    rows = detectors[detectors["model"] == model]
    return rows.assign(alarms=rows["alarms"] / rows["windows"]).groupby("seed")[["alarms", "recall"]].mean()


def _on_family(tables: "Mapping[str, pd.DataFrame]", model: str) -> dict[str, Any]:
    """Results of a model on a family, means over its seeds; differences are from detectors trained on real windows with the same seeds."""
    own, real = (_by_seed(tables["detectors"], name) for name in (model, REAL))
    realism, choice = (tables[name][tables[name]["model"] == model] for name in ("realism", "choice"))
    difference, judged = own - real.loc[own.index], _judgements(choice)
    found = {
        "seeds": [int(seed) for seed in own.index],
        "alarms": float(own["alarms"].mean()),
        "excess": float(difference["alarms"].mean()),
        "lost": float(-difference["recall"].mean()),
        "realism": float(np.mean(realism["ratio"] <= MAX_REALISM_RATIO)),
    }
    if judged:
        found |= {"auc": float(choice["auc"].mean()), "passes": sum(each.passes for each in judged), "judged": len(judged)}
    return found


def _over_families(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """On how many families a model keeps the tolerances with which `fit` chooses, and means over the families."""
    alarms, recall = ([about[key] <= limit for about in found] for key, limit in (("excess", MAX_ALARM_EXCESS), ("lost", MAX_RECALL_LOSS)))
    return {
        "families": len(found),
        "seeds": len({seed for about in found for seed in about["seeds"]}),
        "within_alarms": sum(alarms),
        "within_recall": sum(recall),
        "within_both": sum(first and second for first, second in zip(alarms, recall, strict=True)),
        **{f"mean_{key}": float(np.mean([about[key] for about in found])) for key in ("alarms", "lost", "realism")},
        **{key: sum(about.get(key, 0) for about in found) for key in ("passes", "judged")},
    }


def _judgements(rows: "pd.DataFrame") -> list[CandidateJudgement]:
    fields = [name for name in CandidateJudgement.__dataclass_fields__ if name != "name"]
    return [CandidateJudgement(row["model"], *(float(row[name]) for name in fields)) for row in rows.to_dict("records")]


def _choices(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """What the rule of `fit` chooses on each family and seed with judgements of all offered models."""
    counts, differences, num_passing = dict.fromkeys(OFFERED, 0), [], 0
    rows, detectors = tables["choice"][tables["choice"]["model"].isin(OFFERED)], tables["detectors"]
    for (family, seed), own in rows.groupby(["family", "seed"]):
        judged = sorted(_judgements(own), key=lambda each: OFFERED.index(each.name))
        if len(judged) < len(OFFERED):
            continue
        chosen = choose(judged)
        counts[chosen] += 1
        num_passing += any(each.passes for each in judged)
        here = detectors[detectors["family"] == family]
        differences.append(_by_seed(here, chosen).loc[seed] - _by_seed(here, REAL).loc[seed])
    return {
        "judgements": len(differences),
        "chosen": counts,
        "with_a_passing_model": num_passing,
        "within_alarms": sum(bool(each["alarms"] <= MAX_ALARM_EXCESS) for each in differences),
        "within_recall": sum(bool(-each["recall"] <= MAX_RECALL_LOSS) for each in differences),
    }
