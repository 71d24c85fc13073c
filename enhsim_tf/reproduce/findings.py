"""What the experiment on robustness found: tables of all replicates, and every number that the report states, from them.

The tables are what is committed; `summarise` needs nothing else, so whoever doubts a sentence recomputes it in a second.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf import inference
from enhsim_tf.reproduce.kept_tables import KeptTables
from enhsim_tf.reproduce.replicates import ARMS

if TYPE_CHECKING:
    import pandas as pd

TABLES = ("alarms", "recall", "traces", "variations", "realism", "iterations", "degraded", "trust", "trust_correlation")
CONTRASTS = (("enhanced + GAN", "enhanced"), ("enhanced + GAN", "enhanced + AR"), ("enhanced + GAN", "enhanced + bootstrap"))
"""Declared before the runs, for the paper's GAN: does noise help, does the GAN help over an autoregression, how far from real noise."""
SECOND_CONTRASTS = (("ours + GAN", "ours + AR"), ("ours + GAN", "ours + bootstrap"), ("ours + GAN", "real"))
"""The same for the second generator, in whose place the third asks how far from real telemetry."""
KINDS_OF_NOISE = {"Gaussian": ("white", "autoregressive"), "not Gaussian": ("heteroscedastic", "shot")}
BARS = {"white": (0.01, 0.02), "autoregressive": (0.01, 0.02), "heteroscedastic": (0.01, 0.02), "shot": (0.03, None)}
"""Largest excess of the second generator's false-alarm rate over the real-trained arm's, and of its upper 95 % bound."""
EVERYTHING = 0.99
"""Share of real nominal windows above which a detector alarms on everything."""
LARGEST_RECALL_LOSS, LARGEST_RATIO, LARGEST_TIME = 0.02, 2.0, 2.0
KEPT = KeptTables(
    TABLES,
    labels=("environment", "arm", "detector", "kind", "noise", "measure", "section", "method", "mode"),
    digits=4,
    kind="experiment",
    command="python -m enhsim_tf.reproduce --experiment robustness",
    digits_of={"recall": 3},  # shares of 150 windows, in by far the largest table
)


def rates(alarms: "pd.DataFrame") -> "pd.DataFrame":
    """False-alarm rate of each environment, seed, arm and detector, blocks of time added up: column `rate`."""
    counts = alarms.groupby(["environment", "seed", "arm", "detector"], as_index=False)[["alarms", "windows"]].sum()
    return counts.assign(rate=counts["alarms"] / counts["windows"])


def trained(table: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of detectors that learn from an arm: without the controls and the oracle."""
    from enhsim_tf.detectors import DETECTORS

    return table[table["detector"].isin(list(DETECTORS))]


def by_replicate(table: "pd.DataFrame", value: str) -> "pd.DataFrame":
    """Mean of a value over the detectors that learn, and over all else, of each replicate: arms in columns."""
    return trained(table).groupby(["environment", "seed", "arm"])[value].mean().unstack("arm")


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """Every number that the report, the README and the page state about the experiment.

    Args:
        tables: As `KEPT.read` gives them.

    Returns:
        Plain JSON types: what ran, `arms`, `alarms_on_everything`, `contrasts`, `bars`, `measures`, `variations`, `modes`, `iterations`.
    """
    rate = rates(trained(tables["alarms"]))
    environments = [name for name in BARS if name in set(rate["environment"])]
    return {
        "environments": environments,
        "seeds": sorted(int(seed) for seed in rate["seed"].unique()),
        "num_replicates": int(rate.groupby(["environment", "seed"]).ngroups),
        "num_windows": int(rate.groupby(["environment", "seed", "arm", "detector"])["windows"].sum().median()),
        "arms": _arms(rate, tables, environments),
        "alarms_on_everything": _alarms_on_everything(rate, environments),
        "recall_curves": _recall_curves(tables["recall"]),
        "controls": _controls(tables),
        "contrasts": _contrasts(tables["alarms"]),
        "bars": _bars(rate, tables, environments),
        "measures": _measures(rate, tables["realism"]),
        "variations": _variations(rate, tables),
        "modes": _modes(tables),
        "trust_curves": _trust_curves(tables["trust"]),
        "iterations": _iterations(tables["iterations"]),
    }


def _interval(values: "pd.Series", levels: Sequence[str]) -> dict[str, float]:
    """Mean and hierarchical interval of a series that is indexed by replicates."""
    table = values.rename("value").reset_index()
    found = inference.hierarchical_interval(table, "value", levels)
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def _arms(rate: "pd.DataFrame", tables: "Mapping[str, pd.DataFrame]", environments: Sequence[str]) -> dict[str, Any]:
    mean_rate = by_replicate(rate, "rate")
    others = {
        "recall": by_replicate(tables["recall"], "recall"),
        "recall_at_real_rate": by_replicate(tables["recall"], "recall_at_real_rate"),
        "auc_roc": by_replicate(tables["recall"], "auc_roc"),
        "auc_pr": by_replicate(tables["recall"], "auc_pr"),
        "vus_pr": by_replicate(tables["traces"], "vus_pr"),
    }
    keys = ["arm", "environment", "detector"]
    per_detector, recalls = rate.groupby(keys)["rate"].mean(), trained(tables["recall"]).groupby(keys)["recall"].mean()
    arms = {}
    for arm in (name for name in ARMS if name in mean_rate):
        closed = gap_closed(mean_rate, arm)
        arms[arm] = {
            "false_alarms": _interval(mean_rate[arm], ["environment", "seed"]),
            "gap_closed": None if closed is None else float(closed.mean()),
            **{name: float(table[arm].mean()) for name, table in others.items()},
            "by_environment": {
                name: {
                    "false_alarms": _interval(mean_rate[arm].loc[[name]], ["seed"]),
                    "recall": float(others["recall"][arm].loc[name].mean()),
                    "detectors": {key: float(value) for key, value in per_detector[arm, name].items()},
                    "recalls": {key: float(value) for key, value in recalls[arm, name].items()},
                }
                for name in environments
            },
        }
    return arms


def _alarms_on_everything(rate: "pd.DataFrame", environments: Sequence[str]) -> dict[str, Any]:
    """What a first trial found on one seed: the principal components of the paper's generated noise tell every real window."""
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


def gap_closed(mean_rate: "pd.DataFrame", arm: str, worst: str = "enhanced", best: str = "real") -> "pd.Series | None":
    """Share of the gap in false alarms between the clean enhanced arm and the real-trained one that an arm closes.

    The coarse arm is no zero point here: its detectors are often too blind to alarm at all.

    Args:
        mean_rate: False-alarm rate of each replicate (rows) and arm (columns).
        arm: The arm.
        worst: The arm that closes none of the gap.
        best: The arm that closes all of it.

    Returns:
        A share for each replicate, or None if one of the ends is not there.
    """
    if worst not in mean_rate or best not in mean_rate:
        return None
    return (mean_rate[worst] - mean_rate[arm]) / (mean_rate[worst] - mean_rate[best])


def _recall_curves(recall: "pd.DataFrame") -> dict[str, Any]:
    """Recall by kind, arm and severity: means over detectors, environments and seeds."""
    values = ["recall", "recall_at_real_rate"]
    means = trained(recall).groupby(["kind", "arm", "severity"], sort=False)[values].mean().reset_index()
    curves: dict[str, Any] = {}
    for (kind, arm), group in means.groupby(["kind", "arm"], sort=False):
        group = group.sort_values("severity")
        curves.setdefault(kind, {})[arm] = {name: [float(each) for each in group[name]] for name in ("severity", *values)}
    return curves


def _trust_curves(trust: "pd.DataFrame") -> dict[str, Any]:
    """Error by tenths of the out-of-range score, means over seeds."""
    columns = ["score", "low", "median", "high"]
    means = trust.groupby(["method", "tenth"])[columns].mean()
    return {method: {name: [float(each) for each in group[name]] for name in columns} for method, group in means.groupby(level="method")}


def _controls(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    from enhsim_tf.detectors import CONTROLS

    recall, traces = (table[table["arm"] == "real"].groupby("detector") for table in (tables["recall"], tables["traces"]))
    alarms = rates(tables["alarms"]).query("arm == 'real'").groupby("detector")["rate"].mean()
    found = {
        name: {
            "false_alarms": float(alarms[name]),
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
        "paper": (CONTRASTS, tuple(BARS)),
        "second": (SECOND_CONTRASTS, tuple(BARS)),
        **{f"second, {name}": (SECOND_CONTRASTS[:1], environments) for name, environments in KINDS_OF_NOISE.items()},
    }
    found = {}
    for name, (pairs, environments) in families.items():
        chosen = counts[counts["environment"].isin(environments)]
        if len(chosen):
            found[name] = [dataclasses.asdict(contrast) for contrast in inference.declared_contrasts(chosen, pairs)]
    return found


def _bars(rate: "pd.DataFrame", tables: "Mapping[str, pd.DataFrame]", environments: Sequence[str]) -> dict[str, Any]:
    """The second generator against what it was asked for, environment by environment; fixed before the runs."""
    alarms, recall = by_replicate(rate, "rate"), by_replicate(tables["recall"], "recall")
    ratios = floor_ratios(tables["realism"])
    excess, lost = alarms["ours + GAN"] - alarms["real"], recall["real"] - recall["ours + GAN"]
    bars = {}
    for name in environments:
        largest, bound = BARS[name]
        over, less = _interval(excess.loc[[name]], ["seed"]), _interval(lost.loc[[name]], ["seed"])
        ratio = ratios.loc["ours + GAN", name]
        bars[name] = {
            "excess": over,
            "largest_excess": largest,
            "largest_bound": bound,
            "excess_reached": bool(over["mean"] <= largest and (bound is None or over["high"] <= bound)),
            "recall_lost": less,
            "recall_reached": bool(less["mean"] <= LARGEST_RECALL_LOSS),
            "ratios": {measure: float(value) for measure, value in ratio.items()},
            "measures_within": int((ratio <= LARGEST_RATIO).sum()),
            "num_measures": int(len(ratio)),
        }
    return bars


def floor_ratios(realism: "pd.DataFrame") -> "pd.DataFrame":
    """Departure from real noise in units of the floor, each a mean over seeds: a row a noise and environment, a column a measure.

    Args:
        realism: The table of that name.
    """
    means = realism.groupby(["noise", "environment", "measure"])[["departure", "floor_mean"]].mean()
    return (means["departure"] / means["floor_mean"]).unstack("measure")


def _measures(rate: "pd.DataFrame", realism: "pd.DataFrame") -> dict[str, Any]:
    """Which measure of realism predicts what a noise is worth to a detector: rank correlation with the gap closed."""
    import pandas as pd

    mean_rate = by_replicate(rate, "rate")
    closed = {arm: gap_closed(mean_rate, arm) for arm in mean_rate.columns if " + " in arm}
    value = pd.concat(closed, names=["noise"]).rename("closed").reset_index()
    joined = realism.merge(value, on=["noise", "environment", "seed"])
    cluster = joined["environment"] + joined["seed"].astype(str)
    found = {}
    for measure, rows in joined.groupby("measure", sort=False):
        correlation = inference.rank_correlation(rows["departure"], rows["closed"], cluster[rows.index], num_resamples=500)
        found[measure] = {"section": rows["section"].iloc[0], "rho": correlation.estimate, "low": correlation.low, "high": correlation.high}
    medians = realism.groupby(["noise", "environment", "measure"])["ratio"].median()
    by_noise: dict[str, Any] = {}
    for (noise, environment, measure), ratio in medians.items():
        by_noise.setdefault(noise, {}).setdefault(environment, {})[measure] = float(ratio)
    counts = (floor_ratios(realism) <= LARGEST_RATIO).sum(axis=1)
    is_all = realism.groupby(["noise", "environment", "seed"])["is_within"].all()
    within = {
        noise: {"twice": {key: int(value) for key, value in counts.loc[noise].items()}, "all_below_95": int(is_all.loc[noise].sum())}
        for noise in counts.index.unique("noise")
    }
    return {"predicts": found, "num_rows": int(len(joined) / max(len(found), 1)), "median_ratios": by_noise, "within": within}


def _variations(rate: "pd.DataFrame", tables: "Mapping[str, pd.DataFrame]") -> list[dict[str, Any]]:
    """Means by arm, noise scale and real share; the arms themselves are scale 1 and share 0, the real-trained one share 1."""
    import pandas as pd

    variations = tables["variations"]
    chosen = list(variations["detector"].unique())
    of_arms = rate.merge(
        tables["recall"].groupby(["environment", "seed", "arm", "detector"], as_index=False)["recall"].mean(),
        on=["environment", "seed", "arm", "detector"],
    )
    of_arms = of_arms[of_arms["detector"].isin(chosen)]
    parts = [variations.assign(rate=variations["alarms"] / variations["windows"])]
    for arm in variations["arm"].unique():
        parts.append(of_arms[of_arms["arm"] == arm].assign(scale=1.0, real_share=0.0))
        parts.append(of_arms[of_arms["arm"] == "real"].assign(arm=arm, scale=1.0, real_share=1.0))
    means = pd.concat(parts).groupby(["arm", "scale", "real_share"], as_index=False)[["rate", "recall"]].mean()
    return [
        {
            "arm": row.arm,
            "scale": round(float(row.scale), 4),
            "real_share": round(float(row.real_share), 4),
            "false_alarms": float(row.rate),
            "recall": float(row.recall),
        }
        for row in means.itertuples()
    ]


def _modes(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    from enhsim_tf.reproduce.degraded_modes import LARGEST_TRAINED

    degraded, correlation = tables["degraded"], tables["trust_correlation"]
    where = np.select([degraded["mode"] == "nominal", degraded["severity"] <= LARGEST_TRAINED], ["nominal", "inside"], default="outside")
    by_range = degraded.assign(where=where).groupby(["method", "where"])["nrmse"].mean()
    by_mode = degraded.groupby(["method", "mode", "severity"])["nrmse"].mean()
    columns = ["rank_correlation", "trusted", "error_trusted", "error_flagged"]
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


def _iterations(iterations: "pd.DataFrame") -> dict[str, Any]:
    seconds = iterations.pivot_table("seconds", ["environment", "seed", "round"], "noise")
    ratio = (seconds["convolutional"] / seconds["paper"]).groupby(["environment", "seed"]).median()
    found = {"median": float(ratio.median()), "low": float(ratio.min()), "high": float(ratio.max()), "largest": LARGEST_TIME}
    return found | {"reached": bool(ratio.median() <= LARGEST_TIME)}
