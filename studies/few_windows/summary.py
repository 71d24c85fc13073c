"""What the table of the study says: from how few real windows a simulator pays, and from how many real windows suffice.

The rules below were fixed before the first run. False-alarm rates and recalls are means over the detectors of a kind of training data; excess is the
false-alarm rate above the one that thresholds were set for. Recall is compared at the matched rate, with a threshold from other real
windows.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common.tables import KeptTables
from studies.few_windows.record import ADVERSARIAL, CLASSIFIER, CLASSIFIER_ON_REAL, REAL, SIMULATOR

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    names=("rows",),
    labels=("environment", "arm", "detector"),
    digits=4,
    kind="study",
    command="python -m studies.few_windows",
)
RATE = 0.01
PAYS_SHARE = 0.5  # a simulator pays where its excess is at most this share of that of training on the real windows alone
MAX_RECALL_LOSS = 0.03  # and its recall at the matched rate is at most this much lower
SUFFICES = 0.005  # real windows suffice where the excess of training on them is at most this


def summarise(tables: "dict[str, pd.DataFrame]") -> dict[str, Any]:
    """Computes the findings from the table of `KEPT`.

    Args:
        tables: The table `rows`.

    Returns:
        For each environment the curves of all training data (`arms`) over the number of real windows, the numbers at which each simulator
        `pays`, and those at which other methods do, compared with the real windows of the same seeds; the smallest number from which the
        real windows suffice; by how much a classifier of injected anomalies finds more if it learns from the simulator instead of the real
        windows; and the detector of nominal windows that finds most on the seeds and numbers of the classifiers.
    """
    rows = tables["rows"].assign(rate=lambda table: table["alarms"] / table["windows"])
    numbers = sorted({int(number) for number in rows["num_real"]})
    environments = {}
    for environment in dict.fromkeys(rows["environment"]):
        own = rows[rows["environment"] == environment]
        curves = {arm: _curve(own[own["arm"] == arm], numbers) for arm in dict.fromkeys(own["arm"])}
        excess = curves[REAL]["excess"]
        suffices = [number for number in numbers if all(excess[str(n)] <= SUFFICES for n in numbers if n >= number)]
        environments[environment] = {
            "arms": curves,
            "pays": {arm: _pays(own, arm, numbers) for arm in curves if arm.startswith(SIMULATOR)},
            "others_pay": {arm: _pays(own, arm, numbers) for arm in curves if arm != REAL and not arm.startswith(SIMULATOR)},
            "real_suffices_from": suffices[0] if suffices else None,
            "classifiers": {arm: _gain(own, arm, numbers) for arm in (CLASSIFIER, ADVERSARIAL) if arm in curves},
            "best_detector": _best_detector(own, numbers),
        }
    return {"environments": environments, "numbers": numbers, "seeds": sorted({int(seed) for seed in rows["seed"]})}


def _curve(rows: "pd.DataFrame", numbers: Sequence[int]) -> dict[str, Any]:
    """Means over seeds, and the 10 % and 90 % quantiles of the false-alarm rate over seeds, by the number of real windows."""
    found: dict[str, Any] = {"rate": {}, "low": {}, "high": {}, "excess": {}, "recall": {}, "recall_at_real_rate": {}, "seeds": {}}
    for number in numbers:
        here = rows[rows["num_real"] == number]
        if here.empty:
            continue
        by_seed = here.groupby("seed")[["rate", "recall", "recall_at_real_rate"]].mean()
        low, high = np.quantile(by_seed["rate"], [0.1, 0.9])
        means = {name: float(by_seed[name].mean()) for name in by_seed}
        for name, value in (
            means | {"low": float(low), "high": float(high), "excess": means["rate"] - RATE, "seeds": len(by_seed)}
        ).items():
            found[name][str(number)] = value
    return found


def _pays(rows: "pd.DataFrame", arm: str, numbers: Sequence[int]) -> list[int]:
    """The numbers of real windows at which training data pay, compared with the real windows of the same seeds."""
    own = rows[rows["arm"] == arm]
    real = _curve(rows[(rows["arm"] == REAL) & rows["seed"].isin(own["seed"].unique())], numbers)
    its, found = _curve(own, numbers), []
    for number in numbers:
        at = str(number)
        if at in its["excess"] and real["excess"][at] > SUFFICES:
            loss = real["recall_at_real_rate"][at] - its["recall_at_real_rate"][at]
            if max(its["excess"][at], 0) <= PAYS_SHARE * real["excess"][at] and loss <= MAX_RECALL_LOSS:
                found.append(number)
    return found


def _gain(rows: "pd.DataFrame", arm: str, numbers: Sequence[int]) -> dict[str, float]:
    """Recall at the matched rate of a classifier with the simulator minus that without, mean over the same seeds."""
    recall = rows.pivot_table("recall_at_real_rate", ["num_real", "seed"], "arm")
    gain = (recall[arm] - recall[CLASSIFIER_ON_REAL]).dropna().groupby("num_real").mean()
    return {str(number): float(gain[number]) for number in numbers if number in gain.index}


def _best_detector(rows: "pd.DataFrame", numbers: Sequence[int]) -> dict[str, dict[str, Any]]:
    """The detector that finds most after training on the real windows, where there are classifiers, and its recall at the matched rate."""
    same = rows[rows["arm"] == CLASSIFIER][["num_real", "seed"]].drop_duplicates()
    recall = rows[rows["arm"] == REAL].merge(same).groupby(["num_real", "detector"])["recall_at_real_rate"].mean()
    found = {}
    for number in numbers:
        if number in set(same["num_real"]):
            name = recall.loc[number].idxmax()
            found[str(number)] = {"name": name, "recall_at_real_rate": float(recall.loc[number, name])}
    return found
