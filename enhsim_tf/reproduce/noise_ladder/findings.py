"""What the experiment on noise found: false alarms, recall and realism of each rung on each family, and the rungs that are chosen."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.enhanced_simulator.noise_choice import RungJudgement, choose
from enhsim_tf.noise.ladder import RUNGS
from enhsim_tf.reproduce.noise_gallery import GALLERY, LOOKED_AT
from enhsim_tf.reproduce.tables import KeptTables

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    names=("detectors", "realism", "choice"),
    labels=("family", "rung", "detector", "measure"),
    digits=4,
    kind="experiment",
    command="python -m enhsim_tf.reproduce --experiment noise",
)
REAL = "real"
"""The arm of real windows, with which every rung is compared."""
# Limits that were fixed before the run. All are in shares; excess is that over detectors trained on as many real windows.
MAX_EXCESS = {"looked at": 0.01, "unseen": 0.03}
REVISED = ("quantised",)  # unseen families for which a model was changed after its first result: the second one is reported apart
MAX_RECALL_DIFFERENCE = 0.03
MAX_REALISM_RATIO = 3.0
MAX_REGRET = 0.005  # by which the excess of the chosen rung may be above that of the best rung


def summarise(tables: "dict[str, pd.DataFrame]") -> dict[str, Any]:
    """Summarises the tables.

    Args:
        tables: The tables of `KEPT`.

    Returns:
        For each family, its half, its seeds, each rung's false-alarm rate, excess, recall, share of realism measures within
        `MAX_REALISM_RATIO` times their floor and those beyond it (mean over seeds), the chosen rung, those that pass the rule, and the best one; and whether each limit is kept.
    """
    detectors, realism, choice = (tables[name] for name in ("detectors", "realism", "choice"))
    families = {}
    for family in (name for name in GALLERY if name in set(detectors["family"])):
        rungs = {}
        own = detectors[detectors["family"] == family]
        for rung in (REAL, *RUNGS):
            rows = own[own["rung"] == rung]
            if rows.empty:
                continue
            rate = (rows["alarms"] / rows["windows"]).groupby(rows["seed"]).mean()
            measured = realism[(realism["family"] == family) & (realism["rung"] == rung)]
            ratios, by_measure = measured["ratio"], measured.groupby("measure")["ratio"].mean()
            rungs[rung] = {
                "alarms": float(rate.mean()),
                "alarms_range": [float(rate.min()), float(rate.max())],
                "recall": float(rows["recall"].mean()),
                "recall_at_real_rate": float(rows["recall_at_real_rate"].mean()),
                "realism_within": float(np.mean(ratios <= MAX_REALISM_RATIO)),
                "beyond": {
                    name: float(ratio)
                    if np.isfinite(ratio)
                    else None  # None: the noise has no such measure, for example because it is zero
                    for name, ratio in by_measure.items()
                    if not ratio <= MAX_REALISM_RATIO
                },
            }
        for values in rungs.values():
            values["excess"] = values["alarms"] - rungs[REAL]["alarms"]
            values["recall_difference"] = values["recall_at_real_rate"] - rungs[REAL]["recall_at_real_rate"]
        learnt = {name: values for name, values in rungs.items() if name != REAL}
        best = min(learnt, key=lambda name: learnt[name]["excess"])
        judged = [_judgements(choice[(choice["family"] == family) & (choice["seed"] == seed)]) for seed in sorted(set(own["seed"]))]
        chosen = [choose(each) for each in judged]
        families[family] = {
            "half": "looked at" if family in LOOKED_AT else "revised" if family in REVISED else "unseen",
            "seeds": sorted(int(seed) for seed in set(own["seed"])),
            "rungs": rungs,
            "chosen": chosen,
            "passing": [[rung.rung for rung in each if rung.passes] for each in judged],  # none: the smallest departure decides
            "best": best,
            "regret": float(np.mean([learnt[name]["excess"] for name in chosen]) - learnt[best]["excess"]),
        }
    seeds = sorted({seed for about in families.values() for seed in about["seeds"]})
    return {"families": families, "limits": _limits(families), "seeds": seeds}


def _judgements(rows: "pd.DataFrame") -> list[RungJudgement]:
    """The judgements of one family and seed, the simplest rung first, in whatever order they were computed."""
    names = [field for field in RungJudgement.__dataclass_fields__ if field != "rung"]
    judged = [RungJudgement(row["rung"], *(float(row[name]) for name in names)) for row in rows.to_dict("records")]
    return sorted(judged, key=lambda each: list(RUNGS).index(each.rung))


def _limits(families: dict[str, Any], rung: str = "autoregressive network") -> dict[str, Any]:
    """Whether the learnt rung and the choice keep the limits, and by how much."""
    found: dict[str, Any] = {"rung": rung}
    for half, limit in MAX_EXCESS.items():
        excess = {
            name: about["rungs"][rung]["excess"] for name, about in families.items() if about["half"] == half and rung in about["rungs"]
        }
        found[half] = {
            "limit": limit,
            "excess": excess,
            "kept": sum(value <= limit for value in excess.values()),
            "of": len(excess),
        }
    found["revised"] = {
        name: about["rungs"][rung]["excess"] for name, about in families.items() if about["half"] == "revised" and rung in about["rungs"]
    }
    found["within"] = {name: _within(name, families, MAX_EXCESS) for name in RUNGS}
    strict = dict.fromkeys(MAX_EXCESS, MAX_EXCESS["looked at"])  # who looked at what concerns the learnt rung alone
    found["within_strict"] = {name: _within(name, families, strict) for name in RUNGS}
    learnt = {name: about["rungs"][rung] for name, about in families.items() if rung in about["rungs"]}
    found["recall"] = {
        "limit": MAX_RECALL_DIFFERENCE,
        "kept": sum(abs(about["recall_difference"]) <= MAX_RECALL_DIFFERENCE for about in learnt.values()),
        "missed": {
            name: about["recall_difference"] for name, about in learnt.items() if abs(about["recall_difference"]) > MAX_RECALL_DIFFERENCE
        },
        # few false alarms are no success where thresholds are so high that anomalies are missed
        "lost": {
            name: loss
            for name, about in learnt.items()
            if (loss := families[name]["rungs"][REAL]["recall"] - about["recall"]) > MAX_RECALL_DIFFERENCE
        },
        "of": len(learnt),
    }
    found["realism"] = {
        "limit": MAX_REALISM_RATIO,
        "families_with_all": sum(about["realism_within"] == 1 for about in learnt.values()),
        "mean_share": float(np.mean([about["realism_within"] for about in learnt.values()])) if learnt else None,
        "of": len(learnt),
        "by_model": {name: _realism_of(name, families) for name in (REAL, *RUNGS)},
    }
    found["choice"] = {
        "limit": MAX_REGRET,
        "kept": sum(about["regret"] <= MAX_REGRET for about in families.values()),
        "of": len(families),
        "missed": {name: about["regret"] for name, about in families.items() if about["regret"] > MAX_REGRET},
        "none_passes": [name for name, about in families.items() if not all(about["passing"])],
        "learnt_passes": sum(all(rung in names for names in about["passing"]) for about in families.values()),
    }
    return found


def _within(rung: str, families: dict[str, Any], limits: Mapping[str, float]) -> dict[str, int]:
    """On how many families the excess of a rung keeps the limit of their half; revised families are held to that of the unseen ones."""
    kept = [
        about["rungs"][rung]["excess"] <= limits.get(about["half"], limits["unseen"])
        for about in families.values()
        if rung in about["rungs"]
    ]
    return {"kept": sum(kept), "of": len(kept)}


def _realism_of(rung: str, families: dict[str, Any]) -> dict[str, Any]:
    """On how many families a rung keeps the limit of realism. Fresh real noise is a rung here: it says how strict the limit is."""
    shares = [about["rungs"][rung]["realism_within"] for about in families.values() if rung in about["rungs"]]
    return {
        "families_with_all": sum(share == 1 for share in shares),
        "of": len(shares),
        "mean_share": float(np.mean(shares)) if shares else None,
    }
