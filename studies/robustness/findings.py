"""Findings of the experiment on robustness: all numbers of the report, computed from the tables of all replicates.

The tables are committed, and `summarise` needs nothing else, so that all numbers can be recomputed in a minute.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common import statistics
from studies.common.tables import KeptTables
from studies.robustness import realism_findings, targets
from studies.robustness.averages import REPLICATE, by_block, by_replicate, gap_closed, interval, rates, trained
from studies.robustness.replicate import ARMS, MIXED

if TYPE_CHECKING:
    import pandas as pd

TABLES = (
    "alarms",
    "recall",
    "traces",
    "variations",
    "realism",
    "parameters",
    "controls",
    "degraded",
    "trust",
    "trust_correlation",
)
CONTRASTS = (("enhanced + GAN", "enhanced"), ("enhanced + GAN", "enhanced + AR"), ("enhanced + GAN", "enhanced + bootstrap"))
"""Declared before the runs, for the paper's GAN: compared with no noise, with an autoregression and with extracted noise."""
SECOND_CONTRASTS = (
    ("residual + convolutional GAN", "residual + AR"),
    ("residual + convolutional GAN", "residual + bootstrap"),
    ("residual + convolutional GAN", "real"),
)
"""The same for the convolutional GAN: compared with an autoregression, with extracted noise and with real telemetry."""
EVERYTHING = 0.99
"""Share of real nominal windows above which a detector counts as alarming on every window."""
KEPT = KeptTables(
    TABLES,
    labels=("environment", "arm", "detector", "kind", "noise", "measure", "section", "method", "mode", "parameter", "control"),
    digits=4,
    kind="experiment",
    command="python -m studies.robustness",
    digits_of={"recall": 3, "parameters": 6},  # recall: shares of 150 windows, in the largest table; parameters: rates of about 1 %
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers about the experiment that appear in the report, the README and the HTML page.

    Args:
        tables: As `KEPT.read` gives them.

    Returns:
        Plain JSON types: what was run, and one entry for each question.
    """
    rate, realism = rates(trained(tables["alarms"])), tables["realism"]
    environments = [name for name in targets.BARS if name in set(rate["environment"])]
    return {
        "environments": environments,
        "seeds": sorted(int(seed) for seed in rate["seed"].unique()),
        "num_replicates": int(rate.groupby(["environment", "seed"]).ngroups),
        "num_windows": int(rate.groupby(["environment", "seed", "arm", "detector"])["windows"].sum().median()),
        "arms": _arms(rate, tables, environments),
        "alarms_on_everything": _alarms_on_everything(rate, environments),
        "recall_curves": _recall_curves(tables["recall"]),
        "recall_by_severity": _recall_by_severity(tables["recall"]),
        "controls": _controls(tables),
        "contrasts": _contrasts(tables["alarms"]),
        "bars": targets.bars(tables["alarms"], tables["recall"], realism_findings.floor_ratios(realism), environments),
        "not_inferior": targets.not_inferior(tables["alarms"]),
        "measures": realism_findings.measures(by_replicate(rate, "rate"), realism),
        "beside_floors": realism_findings.beside_floors(realism, "residual + convolutional GAN", environments),
        "parameters": realism_findings.parameters(tables["parameters"], environments),
        "negative_controls": realism_findings.negative_controls(tables["controls"]),
        "variations": _variations(tables["variations"]),
        "modes": _modes(tables),
        "trust_curves": _trust_curves(tables["trust"]),
    }


def _arms(rate: "pd.DataFrame", tables: "Mapping[str, pd.DataFrame]", environments: Sequence[str]) -> dict[str, Any]:
    mean_rate, blocks = by_replicate(rate, "rate"), by_block(tables["alarms"])
    others = {
        "recall": by_replicate(tables["recall"], "recall"),
        "recall_at_real_rate": by_replicate(tables["recall"], "recall_at_real_rate"),
        "auc_roc": by_replicate(tables["recall"], "auc_roc"),
        "auc_pr": by_replicate(tables["recall"], "auc_pr"),
        "vus_pr": by_replicate(tables["traces"], "vus_pr"),
    }
    cells = [*REPLICATE, "arm", "detector"]
    all_recalls = trained(tables["recall"]).groupby(cells)[["recall", "recall_at_real_rate"]].mean()
    recall, at_real_rate = all_recalls["recall"], all_recalls["recall_at_real_rate"].groupby(["arm", "detector"]).mean()
    per_replicate = rate.set_index(cells)["rate"]
    per_detector, recalls = (table.groupby(["arm", "environment", "detector"]).mean() for table in (per_replicate, recall))
    keeps = [keeps_the_rule(*each) for each in ((per_detector, recalls), (per_replicate, recall))]
    arms = {}
    for arm in (name for name in ARMS if name in mean_rate):
        arms[arm] = {
            "false_alarms": _share(interval(blocks[arm])),
            "gap_closed": float(gap_closed(mean_rate, arm).mean()),
            **{name: float(table[arm].mean()) for name, table in others.items()},
            "recalls_at_real_rate": {key: float(value) for key, value in at_real_rate[arm].items()},
            "by_environment": {
                name: {
                    "false_alarms": _share(interval(blocks[arm], name)),
                    "recall": float(others["recall"][arm].loc[name].mean()),
                    "recall_at_real_rate": float(others["recall_at_real_rate"][arm].loc[name].mean()),
                    "detectors": {key: float(value) for key, value in per_detector[arm, name].items()},
                    "recalls": {key: float(value) for key, value in recalls[arm, name].items()},
                }
                for name in environments
            },
        }
        pairs, each = (table[arm] for table in keeps)
        arms[arm]["c8"] = {
            "kept": [list(pair) for pair in pairs[pairs].index],
            "of": int(len(pairs)),
            "replicates": int(each.sum()),
            "of_replicates": int(len(each)),
            "missed": {name: int((~each.xs(name, level="environment")).sum()) for name in environments},
        }
    return arms


def _share(found: Mapping[str, float]) -> dict[str, float]:
    """The interval of a share, limited to 1: a bootstrap sample of the larger blocks can exceed it."""
    return {name: min(value, 1.0) for name, value in found.items()}


def keeps_the_rule(rate: "pd.Series", recall: "pd.Series") -> "pd.DataFrame":
    """Whether each row meets the criterion of claim C8; one column per arm.

    The false-alarm rate has to be at most twice that of training on real telemetry plus one percentage point, and recall at most
    five points lower.

    Args:
        rate: False-alarm rates, indexed by `arm` and more.
        recall: Recall, indexed likewise.
    """
    rates, recalls = rate.unstack("arm"), recall.unstack("arm")
    return rates.le(2 * rates["real"] + 0.01, axis=0) & recalls.ge(recalls["real"] - 0.05, axis=0)


def _alarms_on_everything(rate: "pd.DataFrame", environments: Sequence[str]) -> dict[str, Any]:
    """The finding of a first trial on one seed: the PCA residual, trained with noise of the paper's GAN, flags every real window."""
    chosen = rate[(rate["arm"] == "enhanced + GAN") & (rate["detector"] == "PCA residual")].groupby("environment")["rate"]
    return {
        name: {
            "replicates": int((chosen.get_group(name) >= EVERYTHING).sum()),
            "of": int(chosen.size()[name]),
            "low": float(chosen.min()[name]),
            "high": float(chosen.max()[name]),
        }
        for name in environments
    }


def _recall_curves(recall: "pd.DataFrame") -> dict[str, Any]:
    """Recall by kind, arm and severity: means over detectors, environments and seeds."""
    values = ["recall", "recall_at_real_rate"]
    means = trained(recall).groupby(["kind", "arm", "severity"], sort=False)[values].mean().reset_index()
    curves: dict[str, Any] = {}
    for (kind, arm), group in means.groupby(["kind", "arm"], sort=False):
        group = group.sort_values("severity")
        curves.setdefault(kind, {})[arm] = {name: [float(each) for each in group[name]] for name in ("severity", *values)}
    return curves


def _recall_by_severity(recall: "pd.DataFrame") -> dict[str, Any]:
    """Recall by arm and severity at the arm's own threshold: means over kinds, detectors, environments and seeds."""
    means = trained(recall).groupby(["arm", "severity"])["recall"].mean()
    return {
        arm: {f"{severity:g}": float(value) for severity, value in means[arm].items()} for arm in ARMS if arm in means.index.unique("arm")
    }


def _trust_curves(trust: "pd.DataFrame") -> dict[str, Any]:
    """Error by tenths of the out-of-range score, means over seeds."""
    columns = ["score", "low", "median", "high"]
    means = trust.groupby(["method", "tenth"])[columns].mean()
    return {method: {name: [float(each) for each in group[name]] for name in columns} for method, group in means.groupby(level="method")}


def _controls(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    from enhsim_tf.detection.registry import CONTROLS

    recall, traces = (table[table["arm"] == "real"].groupby("detector") for table in (tables["recall"], tables["traces"]))
    alarms = rates(tables["alarms"]).query("arm == 'real'").groupby("detector")["rate"].mean()
    found = {
        name: {
            "false_alarms": float(alarms[name]),
            "recall": float(recall["recall"].mean()[name]),
            "recall_at_real_rate": float(recall["recall_at_real_rate"].mean()[name]),
            "auc_roc": float(recall["auc_roc"].mean()[name]),
            "auc_pr": float(recall["auc_pr"].mean()[name]),
            "vus_pr": float(traces["vus_pr"].mean()[name]),
        }
        for name in CONTROLS
    }
    return found | {"oracle": {"vus_pr": float(traces["vus_pr"].mean()["oracle"])}}


def _contrasts(alarms: "pd.DataFrame") -> dict[str, list[dict[str, Any]]]:
    counts = trained(alarms).rename(columns={"windows": "trials"})
    families = {
        "paper": (CONTRASTS, tuple(targets.BARS)),
        "second": (SECOND_CONTRASTS, tuple(targets.BARS)),
        **{f"second, {name}": (SECOND_CONTRASTS[:1], environments) for name, environments in targets.KINDS_OF_NOISE.items()},
    }
    found = {}
    for name, (pairs, environments) in families.items():
        chosen = counts[counts["environment"].isin(environments)]
        if len(chosen):
            found[name] = [dataclasses.asdict(contrast) for contrast in statistics.declared_contrasts(chosen, pairs)]
    return found


def _variations(variations: "pd.DataFrame") -> list[dict[str, Any]]:
    """Means by arm, noise scale, share of real windows, and whether real windows also set the threshold.

    A share of 1 is the same for all arms.
    """
    import pandas as pd

    real = variations[variations["arm"] == "real"]
    every = pd.concat([variations[variations["arm"] != "real"], *(real.assign(arm=arm) for arm in MIXED)])
    every = every.assign(rate=every["alarms"] / every["windows"])
    keys = ["arm", "scale", "real_share", "real_threshold"]
    return [
        {
            "arm": arm,
            "scale": round(float(scale), 4),
            "real_share": round(float(share), 4),
            "real_threshold": bool(both),
            "false_alarms": float(group["rate"].mean()),
            "recall": float(group["recall"].mean()),
            "by_detector": {
                name: {value: float(rows[value].mean()) for value in ("rate", "recall")} for name, rows in group.groupby("detector")
            },
            "by_environment": {key: float(value) for key, value in group.groupby("environment")["rate"].mean().items()},
        }
        for (arm, scale, share, both), group in every.groupby(keys)
    ]


def _modes(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    from studies.robustness.degraded_modes import LARGEST_TRAINED

    degraded, correlation = tables["degraded"], tables["trust_correlation"]
    where = np.select([degraded["mode"] == "nominal", degraded["severity"] <= LARGEST_TRAINED], ["nominal", "inside"], default="outside")
    by_range = degraded.assign(where=where).groupby(["method", "where"])["nrmse"].mean()
    by_mode = degraded.groupby(["method", "mode", "severity"])["nrmse"].mean()
    columns = ["rank_correlation", "low", "high", "trusted", "error_trusted", "error_flagged"]
    return {
        "seeds": sorted(int(seed) for seed in degraded["seed"].unique()),
        "largest_trained": LARGEST_TRAINED,
        "nrmse": {method: {key: float(value) for key, value in group.droplevel(0).items()} for method, group in by_range.groupby(level=0)},
        "by_mode": [
            {"method": method, "mode": mode, "severity": round(float(severity), 4), "nrmse": float(value)}
            for (method, mode, severity), value in by_mode.items()
        ],
        "trust": {
            method: {name: float(group[name].mean()) for name in columns}
            | {f"{name}_range": [float(group[name].min()), float(group[name].max())] for name in columns[:1]}
            for method, group in correlation.groupby("method")
        },
    }
