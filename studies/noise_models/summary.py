"""What the tables of the study say: false alarms, recall and realism of each noise model on each family, and what `fit` would choose."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.simulator.noise_choice import MAX_ALARM_EXCESS, MAX_RECALL_LOSS, CandidateJudgement, choose
from studies.common.noise_gallery import LOOKED_AT
from studies.common.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

REAL = "real"
KEPT = KeptTables(
    names=("detectors", "realism", "choice"),
    labels=("family", "model", "detector", "measure"),
    digits=4,
    kind="study",
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
    families = {
        family: {
            "looked_at": family in LOOKED_AT,
            "models": {name: found for name in models if (found := _on_family(tables, family, name))},
        }
        for family in dict.fromkeys(tables["detectors"]["family"])
    }
    return {
        "seeds": sorted({int(seed) for seed in tables["detectors"]["seed"]}),
        "families": families,
        "models": {
            name: _over_families([about["models"][name] for about in families.values() if name in about["models"]]) for name in models
        },
        "choice": _choices(tables),
    }


def _by_seed(detectors: "pd.DataFrame", family: str, model: str) -> "pd.DataFrame":
    """False-alarm rate and recall at own thresholds, means over the detectors, a row for each seed."""
    rows = detectors[(detectors["family"] == family) & (detectors["model"] == model)]
    return rows.assign(alarms=rows["alarms"] / rows["windows"]).groupby("seed")[["alarms", "recall"]].mean()


def _on_family(tables: "Mapping[str, pd.DataFrame]", family: str, model: str) -> dict[str, Any]:
    """Results of a model on a family, means over its seeds; differences are from detectors trained on real windows with the same seeds."""
    own, real = (_by_seed(tables["detectors"], family, name) for name in (model, REAL))
    if own.empty:
        return {}
    realism, choice = (table[(table["family"] == family) & (table["model"] == model)] for table in (tables["realism"], tables["choice"]))
    difference = own - real.loc[own.index]
    found = {
        "seeds": [int(seed) for seed in own.index],
        "alarms": float(own["alarms"].mean()),
        "excess": float(difference["alarms"].mean()),
        "lost": float(-difference["recall"].mean()),
        "realism": float(np.mean(realism["ratio"] <= MAX_REALISM_RATIO)),
    }
    judged = _judgements(choice)
    return found | (
        {"auc": float(choice["auc"].mean()), "passes": sum(each.passes for each in judged), "judged": len(judged)} if judged else {}
    )


def _over_families(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """On how many families a model keeps the tolerances with which `fit` chooses, and means over the families."""
    alarms, recall = ([about[key] <= limit for about in found] for key, limit in (("excess", MAX_ALARM_EXCESS), ("lost", MAX_RECALL_LOSS)))
    return {
        "families": len(found),
        "seeds": len({seed for about in found for seed in about["seeds"]}),
        "within_alarms": sum(alarms),
        "within_recall": sum(recall),
        "within_both": sum(first and second for first, second in zip(alarms, recall, strict=True)),
        "mean_alarms": float(np.mean([about["alarms"] for about in found])),
        "mean_lost": float(np.mean([about["lost"] for about in found])),
        "mean_realism": float(np.mean([about["realism"] for about in found])),
        "passes": sum(about.get("passes", 0) for about in found),
        "judged": sum(about.get("judged", 0) for about in found),
    }


def _judgements(rows: "pd.DataFrame") -> list[CandidateJudgement]:
    fields = [name for name in CandidateJudgement.__dataclass_fields__ if name != "name"]
    return [CandidateJudgement(row["model"], *(float(row[name]) for name in fields)) for row in rows.to_dict("records")]


def _choices(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """What the rule of `fit` chooses on each family and seed with judgements of all offered models."""
    counts, excess, lost, num_passing = dict.fromkeys(OFFERED, 0), [], [], 0
    rows = tables["choice"][tables["choice"]["model"].isin(OFFERED)]
    for (family, seed), own in rows.groupby(["family", "seed"]):
        judged = sorted(_judgements(own), key=lambda each: OFFERED.index(each.name))
        if len(judged) < len(OFFERED):
            continue
        chosen = choose(judged)
        counts[chosen] += 1
        num_passing += any(each.passes for each in judged)
        difference = _by_seed(tables["detectors"], family, chosen).loc[seed] - _by_seed(tables["detectors"], family, REAL).loc[seed]
        excess.append(float(difference["alarms"]))
        lost.append(float(-difference["recall"]))
    return {
        "judgements": len(excess),
        "chosen": counts,
        "with_a_passing_model": num_passing,
        "within_alarms": sum(each <= MAX_ALARM_EXCESS for each in excess),
        "within_recall": sum(each <= MAX_RECALL_LOSS for each in lost),
        "mean_excess": float(np.mean(excess)) if excess else None,
        "mean_lost": float(np.mean(lost)) if lost else None,
    }
