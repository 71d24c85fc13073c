"""Findings on realism: measures compared with their real-vs-real baselines, parameters of the noise, and their relation to false alarms."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common import statistics
from studies.common.noise_processes import NOISES
from studies.robustness.averages import REPLICATE, gap_closed
from studies.robustness.targets import LARGEST_RATIO

if TYPE_CHECKING:
    import pandas as pd


def floor_ratios(realism: "pd.DataFrame") -> "pd.DataFrame":
    """Departure from real noise divided by the mean baseline, as means over seeds.

    There is one row for each noise and environment, and one column for each measure.

    Args:
        realism: The table `realism`.
    """
    means = realism.groupby(["noise", "environment", "measure"])[["departure", "floor_mean"]].mean()
    return (means["departure"] / means["floor_mean"]).unstack("measure")


def measures(mean_rate: "pd.DataFrame", realism: "pd.DataFrame") -> dict[str, Any]:
    """Correlation of each measure of realism with the false-alarm gap closed, and the noises that are within their baselines.

    Args:
        mean_rate: False-alarm rate of each replicate (rows) and arm (columns).
        realism: The table `realism`.
    """
    import pandas as pd

    closed = {arm: gap_closed(mean_rate, arm) for arm in mean_rate.columns if " + " in arm}
    value = pd.concat(closed, names=["noise"]).rename("closed").reset_index()
    joined = realism.merge(value, on=["noise", *REPLICATE])
    found = {}
    for measure, rows in joined.groupby("measure", sort=False):
        correlation = statistics.rank_correlation(rows["departure"], rows["closed"], rows["seed"], num_resamples=500)
        inside = [
            statistics.rank_correlation(each["departure"], each["closed"], num_resamples=1).estimate
            for _, each in rows.groupby("environment")
        ]
        found[measure] = {
            "section": rows["section"].iloc[0],
            "rho": correlation.estimate,
            "low": correlation.low,
            "high": correlation.high,
            "within": float(np.mean(inside)),
            "within_low": float(np.min(inside)),
            "within_high": float(np.max(inside)),
        }
    counts = (floor_ratios(realism) <= LARGEST_RATIO).sum(axis=1)
    is_all = realism.groupby(["noise", *REPLICATE])["is_within"].all()
    within = {
        noise: {"twice": {key: int(value) for key, value in counts.loc[noise].items()}, "all_below_95": int(is_all.loc[noise].sum())}
        for noise in counts.index.unique("noise")
    }
    return {
        "predicts": found,
        "num_rows": int(len(joined) / max(len(found), 1)),
        "within": within,
        "resplits": {measure: int(number) for measure, number in realism.groupby("measure", sort=False)["num_resplits"].max().items()},
    }


def beside_floors(realism: "pd.DataFrame", noise: str, environments: Sequence[str]) -> dict[str, Any]:
    """Value of every measure of a noise with the mean and 95th percentile of its baseline, as means over seeds.

    The result is indexed by measure and environment.

    Args:
        realism: The table `realism`.
        noise: Name of the noise.
        environments: Names of the environments.
    """
    columns = ["value", "departure", "floor_mean", "floor_95"]
    means = realism[realism["noise"] == noise].groupby(["measure", "environment"], sort=False)[columns].mean()
    return {
        measure: {name: {column: float(group.loc[(measure, name), column]) for column in columns} for name in environments}
        for measure, group in means.groupby(level="measure", sort=False)
    }


def negative_controls(table: "pd.DataFrame") -> dict[str, Any]:
    """Departure of each control divided by the mean baseline, by control and measure."""
    return {
        "num_windows": int(table["num_windows"].max()),
        "ratios": {
            control: dict(zip(rows["measure"], rows["ratio"].astype(float), strict=True))
            for control, rows in table.groupby("control", sort=False)
        },
    }


def parameters(table: "pd.DataFrame", environments: Sequence[str]) -> list[dict[str, Any]]:
    """Parameters of each process, estimated from real noise and from the noises of the pipelines.

    Args:
        table: The table `parameters`, with an estimate for each block of windows.
        environments: Names of the environments.

    Returns:
        One row for each parameter: its `true` value, and for each noise the `mean` estimate and the `distance`: the Wasserstein
        distance of its blocks' estimates to those of held-out real noise in units of their mean, mean over seeds.
    """
    from scipy.stats import wasserstein_distance

    rows = []
    for environment in environments:
        chosen = table[table["environment"] == environment]
        for parameter, estimates in chosen.groupby("parameter", sort=False):
            by_seed = {key: group["value"].to_numpy() for key, group in estimates.groupby(["noise", "seed"])}
            found = {}
            for noise in estimates["noise"].unique():
                seeds = [seed for each, seed in by_seed if each == noise]
                real = {seed: by_seed["real", seed] for seed in seeds}
                distances = [wasserstein_distance(by_seed[noise, seed], real[seed]) / np.mean(real[seed]) for seed in seeds]
                values = np.concatenate([by_seed[noise, seed] for seed in seeds])
                found[noise] = {"mean": float(values.mean()), "distance": float(np.mean(distances))}
            rows.append(
                {
                    "environment": environment,
                    "parameter": parameter,
                    "true": float(getattr(NOISES[environment], parameter)),
                    "noises": found,
                }
            )
    return rows
