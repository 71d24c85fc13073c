"""What the tables of the study say: false alarms, recall and realism of each noise model on each
family, and whether a choice pays.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common.noise_processes import LOOKED_AT
from studies.common.tables import KeptTables, seeds_of

if TYPE_CHECKING:
    import pandas as pd

REAL = "real"
KEPT = KeptTables(
    names=("detectors", "realism"),
    labels=("family", "model", "detector", "measure"),
    digits=4,
    command="python -m studies.noise_models",
    former=("choice",),
)
# by which the false-alarm rate may exceed that of detectors trained on real windows
MAX_ALARM_EXCESS = 0.01
# by which the recall may be below that of detectors trained on real windows, at their own
# thresholds
MAX_RECALL_LOSS = 0.03
# by which the AUC of a classifier may exceed that of real windows against other real windows
_MAX_AUC_EXCESS = 0.05
MAX_REALISM_RATIO = 3.0  # of a measure to its value between two samples of real noise
OFFERED = ("gaussian", "autoregression", "residual windows", "matched residual windows")
"""The models among which the choice is followed. Without noise, detectors flag nearly every window,
and `none` was tried on one seed.
"""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """Computes the findings from the tables.

    Args:
        tables: As `KEPT` names them.

    Returns:
        `families`: for each family whether it was looked at in the design, and for each model its
            results there; `models`: for each model
        on how many families it keeps the tolerances; `seeds`; and `choice`, from a published table:
        how well a rule chooses among the models.
    """
    models = list(dict.fromkeys(tables["detectors"]["model"]))
    families = {}
    for family in dict.fromkeys(tables["detectors"]["family"]):
        of_family = {name: table[table["family"] == family] for name, table in tables.items()}
        found = {
            name: _on_family(of_family, name)
            for name in models
            if name in set(of_family["detectors"]["model"])
        }
        families[family] = {"looked_at": family in LOOKED_AT, "models": found}
    return {
        "seeds": seeds_of(tables["detectors"]),
        "families": families,
        "models": {
            name: _over_families(
                [about["models"][name] for about in families.values() if name in about["models"]]
            )
            for name in models
        },
    } | ({"choice": _choices(tables)} if "choice" in tables else {})


def _by_seed(detectors: "pd.DataFrame", model: str) -> "pd.DataFrame":
    """False-alarm rate and recall at own thresholds, means over the detectors, a row for each
    seed.
    """
    rows = detectors[detectors["model"] == model]
    return (
        rows.assign(alarms=rows["alarms"] / rows["windows"])
        .groupby("seed")[["alarms", "recall"]]
        .mean()
    )


def _on_family(tables: "Mapping[str, pd.DataFrame]", model: str) -> dict[str, Any]:
    """Results of a model on a family, means over its seeds; differences are from detectors trained
    on real windows with the same seeds.
    """
    own, real = (_by_seed(tables["detectors"], name) for name in (model, REAL))
    realism = tables["realism"][tables["realism"]["model"] == model]
    difference = own - real.loc[own.index]
    return {
        "seeds": [int(seed) for seed in own.index],
        "alarms": float(own["alarms"].mean()),
        "excess": float(difference["alarms"].mean()),
        "lost": float(-difference["recall"].mean()),
        "realism": float(np.mean(realism["ratio"] <= MAX_REALISM_RATIO)),
    }


def _over_families(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """On how many families a model keeps the tolerances, and means over the families."""
    alarms, recall = (
        [about[key] <= limit for about in found]
        for key, limit in (("excess", MAX_ALARM_EXCESS), ("lost", MAX_RECALL_LOSS))
    )
    return {
        "families": len(found),
        "seeds": len({seed for about in found for seed in about["seeds"]}),
        "within_alarms": sum(alarms),
        "within_recall": sum(recall),
        "within_both": sum(first and second for first, second in zip(alarms, recall, strict=True)),
        **{
            f"mean_{key}": float(np.mean([about[key] for about in found]))
            for key in ("alarms", "lost", "realism")
        },
    }


def _choices(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """How well a rule chooses on each family and seed, beside always the same model: cases in which
    detectors keep both tolerances.

    The rule takes the simplest model that passes: by a classifier, and by false alarms and recall
    of two fast detectors on held-out noise. If none passes, it takes that with the smallest sum of
    the three excesses.
    """
    rows = tables["choice"]
    detectors = tables["detectors"]
    rows = rows.assign(
        order=rows["model"].map({name: number for number, name in enumerate(OFFERED)})
    ).dropna(subset="order")
    excess = np.stack(
        [
            rows["auc"] - rows["real_auc"].clip(lower=0.5),
            rows["alarms"] - rows["real_alarms"],
            rows["real_recall"] - rows["recall"],
        ]
    )
    rows["passes"] = (
        excess <= np.array([_MAX_AUC_EXCESS, MAX_ALARM_EXCESS, MAX_RECALL_LOSS])[:, None]
    ).all(axis=0)
    rows["departure"] = np.where(
        rows["passes"], rows["order"] - len(OFFERED), excess.clip(min=0).sum(axis=0)
    )
    chosen = dict.fromkeys(OFFERED, 0)
    within = dict.fromkeys(("the rule", *OFFERED), 0)
    passing = judgements = 0
    for (family, seed), own in rows.groupby(["family", "seed"]):
        if len(own) < len(OFFERED):
            continue
        best = own.loc[own["departure"].idxmin(), "model"]
        chosen[best] += 1
        judgements += 1
        passing += bool(own["passes"].any())
        here = detectors[detectors["family"] == family]
        real = _by_seed(here, REAL).loc[seed]
        for name in OFFERED:
            apart = _by_seed(here, name).loc[seed] - real
            keeps = bool(
                apart["alarms"] <= MAX_ALARM_EXCESS and -apart["recall"] <= MAX_RECALL_LOSS
            )
            within[name] += keeps
            within["the rule"] += keeps and name == best
    return {
        "judgements": judgements,
        "chosen": chosen,
        "with_a_passing_model": passing,
        "within_both": within,
    }
