"""What the learning curve found: from how few real windows a simulator pays, and when it stops paying.

The rules below were fixed before the first run. False-alarm rates and recalls are means over the detectors of an arm; excess is the
false-alarm rate above the one that thresholds were set for. Recall is compared at the matched rate, with a threshold from other real
windows.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.common.tables import KeptTables
from studies.few_windows.arms import (
    ADVERSARIAL,
    BOTH,
    CLASSIFIER,
    CLASSIFIER_ON_REAL,
    CORAL,
    ONE_LINE,
    REAL,
    SIMULATOR,
    THRESHOLD_ON_REAL,
)

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    names=("rows",),
    labels=("environment", "arm", "detector"),
    digits=4,
    kind="experiment",
    command="python -m studies.few_windows",
)
RATE = 0.01
PAYS_SHARE = 0.5  # a simulator pays where its excess is at most this share of that of training on the real windows alone
MAX_RECALL_LOSS = 0.03  # and its recall at the matched rate is at most this much lower
SUFFICES = 0.005  # real windows suffice where the excess of training on them is at most this
OTHERS = (BOTH, THRESHOLD_ON_REAL, CORAL, ONE_LINE)  # to which the rule, which was written for simulators, is also applied
JUDGED_AT = 20  # windows at which the best simulator arm must have at most half of the excess of the real ones


def summarise(tables: "dict[str, pd.DataFrame]") -> dict[str, Any]:
    """Summarises the table of `KEPT`.

    Args:
        tables: The table `rows`.

    Returns:
        For each environment and arm its curves over the number of real windows; for each environment the numbers of real windows at
        which each simulator arm pays, those at which other methods do by the same rule, and the smallest number from which the real
        windows suffice. With classifiers, also by how much a classifier of injected anomalies finds more if it learns from the
        simulator instead of the real windows. Arms with fewer seeds than the others also stand beside the others on the same seeds, in a
        group for each set of seeds.
    """
    rows = tables["rows"].assign(rate=lambda table: table["alarms"] / table["windows"])
    numbers = sorted({int(number) for number in rows["num_real"]})
    environments = {}
    for environment in dict.fromkeys(rows["environment"]):
        own = rows[rows["environment"] == environment]
        arms = {arm: _curves(own[own["arm"] == arm], numbers) for arm in dict.fromkeys(own["arm"])}
        real = arms[REAL]
        # noise networks may have fewer seeds than the other arms: they decide nothing, and are compared on their own seeds
        simulators = [arm for arm in arms if arm.startswith(SIMULATOR) and most_seeds(arms[arm]) == most_seeds(real)]
        others = [arm for arm in arms if arm in OTHERS or (arm.startswith(SIMULATOR) and arm not in simulators)]
        pays = {arm: [number for number in numbers if _pays(arms[arm], real, number)] for arm in simulators}
        suffices = [number for number in numbers if all(real["excess"][str(n)] <= SUFFICES for n in numbers if n >= number)]
        at = str(JUDGED_AT if JUDGED_AT in numbers else numbers[-1])
        best = min((arm for arm in simulators if at in arms[arm]["excess"]), key=lambda arm: max(arms[arm]["excess"][at], 0))
        environments[environment] = {
            "arms": arms,
            "pays": pays,
            "others_pay": {arm: _other(own, arm, numbers) for arm in others},
            "real_suffices_from": suffices[0] if suffices else None,
            "bar": {
                "num_real": int(at),
                "best": best,
                "excess": arms[best]["excess"][at],
                "real_excess": real["excess"][at],
                "is_kept": bool(max(arms[best]["excess"][at], 0) <= PAYS_SHARE * real["excess"][at]),
            },
        }
        if {CLASSIFIER, CLASSIFIER_ON_REAL} <= set(arms):
            gains = {arm: _gain(own, arm, numbers) for arm in (CLASSIFIER, ADVERSARIAL) if arm in arms}
            environments[environment]["classifiers"] = gains
        few: dict[tuple[int, ...], list[str]] = {}
        for arm, curve in arms.items():
            if most_seeds(curve) < most_seeds(real):
                few.setdefault(tuple(sorted({int(seed) for seed in own[own["arm"] == arm]["seed"]})), []).append(arm)
        groups = [_few_seeds(own, seeds, names, [REAL, *simulators], numbers) for seeds, names in few.items()]
        environments[environment]["few_seeds"] = groups
    return {"environments": environments, "numbers": numbers, "seeds": sorted({int(seed) for seed in rows["seed"]})}


def most_seeds(curve: Mapping[str, Any]) -> int:
    """Returns the largest number of seeds that an arm has at any number of real windows.

    Args:
        curve: The curves of the arm.
    """
    return max(curve["seeds"].values(), default=0)


def _other(rows: "pd.DataFrame", arm: str, numbers: list[int]) -> dict[str, Any]:
    """The numbers of real windows at which an arm pays, compared with the real windows of the seeds that the arm has, and its recall there."""
    its = rows[rows["arm"] == arm]
    real = rows[(rows["arm"] == REAL) & rows["seed"].isin(its["seed"].unique())]
    curve, compared = _curves(its, numbers), _curves(real, numbers)
    pays = [number for number in numbers if _pays(curve, compared, number)]
    tried = [number for number in numbers if str(number) in curve["excess"]]
    return {
        "pays": pays,
        "tried": tried,
        "cannot": [number for number in tried if compared["excess"][str(number)] <= SUFFICES],
        "seeds": most_seeds(curve),
        "recall": {str(number): [curve["recall"][str(number)], compared["recall"][str(number)]] for number in pays},
    }


def _curves(rows: "pd.DataFrame", numbers: list[int]) -> dict[str, Any]:
    """Mean over seeds, and the range over seeds of the false-alarm rate, by the number of real windows."""
    found: dict[str, Any] = {"rate": {}, "low": {}, "high": {}, "excess": {}, "recall": {}, "recall_at_real_rate": {}, "seeds": {}}
    for number in numbers:
        here = rows[rows["num_real"] == number]
        if here.empty:
            continue
        by_seed = here.groupby("seed")[["rate", "recall", "recall_at_real_rate"]].mean()
        found["rate"][str(number)] = float(by_seed["rate"].mean())
        found["low"][str(number)], found["high"][str(number)] = (float(each) for each in np.quantile(by_seed["rate"], [0.1, 0.9]))
        found["excess"][str(number)] = float(by_seed["rate"].mean()) - RATE
        for name in ("recall", "recall_at_real_rate"):
            found[name][str(number)] = float(by_seed[name].mean())
        found["seeds"][str(number)] = len(by_seed)
    return found


def _few_seeds(rows: "pd.DataFrame", seeds: Sequence[int], few: list[str], others: list[str], numbers: list[int]) -> dict[str, Any]:
    """Arms that have these seeds alone, beside others on the same seeds and numbers, and which detector finds most after training on the real windows."""
    its = rows[rows["arm"].isin(few)]
    same = rows[rows["seed"].isin(seeds) & rows["num_real"].isin(its["num_real"].unique())]
    recall = same[same["arm"] == REAL].groupby(["num_real", "detector"])["recall_at_real_rate"].mean()
    best = {int(number): recall.loc[number].idxmax() for number in sorted(its["num_real"].unique())}
    return {
        "names": few,
        "seeds": list(seeds),
        "arms": {arm: _curves(same[same["arm"] == arm], numbers) for arm in (*others, *few)},
        "best_detector": {
            str(number): {"name": name, "recall_at_real_rate": float(recall.loc[number, name])} for number, name in best.items()
        },
    }


def _gain(rows: "pd.DataFrame", arm: str, numbers: list[int]) -> dict[str, dict[str, Any]]:
    """Recall at the matched rate of a classifier with the simulator minus that without: mean and range over the same seeds."""
    recall = rows.pivot_table("recall_at_real_rate", ["num_real", "seed"], "arm")
    gain = (recall[arm] - recall[CLASSIFIER_ON_REAL]).dropna()
    found = {}
    for number in numbers:
        if number in gain.index.get_level_values("num_real"):
            here = gain.loc[number]
            found[str(number)] = {"mean": float(here.mean()), "low": float(here.min()), "high": float(here.max()), "seeds": len(here)}
    return found


def _pays(arm: dict[str, Any], real: dict[str, Any], number: int) -> bool:
    at = str(number)
    if at not in arm["excess"] or real["excess"][at] <= SUFFICES:
        return False
    loss = real["recall_at_real_rate"][at] - arm["recall_at_real_rate"][at]
    return max(arm["excess"][at], 0) <= PAYS_SHARE * real["excess"][at] and loss <= MAX_RECALL_LOSS
