"""What the table of the study says: from how few real windows a simulator pays, and from how many
real windows suffice.

The rules below were fixed before the first run. False-alarm rates and recalls are means over the
detectors of a kind of training data; excess is the false-alarm rate above the one that thresholds
were set for. Recall is compared at the matched rate, with a threshold from other real windows.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from studies.common.tables import KeptTables, seeds_of
from studies.few_windows.record import REAL, SIMULATOR

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    names=("rows",),
    labels=("environment", "arm", "detector"),
    digits=4,
    command="python -m studies.few_windows",
)
RATE = 0.01
# a simulator pays where its excess is at most this share of that of training on the real windows
# alone
PAYS_SHARE = 0.5
MAX_RECALL_LOSS = 0.03  # and its recall at the matched rate is at most this much lower
SUFFICES = 0.005  # real windows suffice where the excess of training on them is at most this


def summarise(tables: "dict[str, pd.DataFrame]") -> dict[str, Any]:
    """Computes the findings from the table of `KEPT`.

    Args:
        tables: The table `rows`.

    Returns:
        For each environment the curves of all training data (`arms`) over the number of real
        windows, the numbers at which each simulator `pays`, and those at which other methods do,
        compared with the real windows of the same seeds; and the smallest number from which the
        real windows suffice.
    """
    # tables hold float32
    rows = tables["rows"].astype({"recall": float, "recall_at_real_rate": float})
    rows["rate"] = rows["alarms"] / rows["windows"]
    numbers = sorted({int(number) for number in rows["num_real"]})
    environments = {}
    for environment in dict.fromkeys(rows["environment"]):
        own = rows[rows["environment"] == environment]
        curves = {arm: _curve(own[own["arm"] == arm], numbers) for arm in dict.fromkeys(own["arm"])}
        pays = {arm: _pays(own, arm, numbers) for arm in curves if arm != REAL}
        excess = curves[REAL]["excess"]
        suffices = None
        for number in reversed(numbers):
            if excess[str(number)] > SUFFICES:
                break
            suffices = number
        environments[environment] = {
            "arms": curves,
            "pays": {arm: at for arm, at in pays.items() if arm.startswith(SIMULATOR)},
            "others_pay": {arm: at for arm, at in pays.items() if not arm.startswith(SIMULATOR)},
            "real_suffices_from": suffices,
        }
    return {
        "environments": environments,
        "numbers": numbers,
        "seeds": seeds_of(rows),
    }


def _curve(rows: "pd.DataFrame", numbers: Sequence[int]) -> dict[str, dict[str, float]]:
    """Means over seeds of the false-alarm rate, its excess and both recalls, by the number of real
    windows.
    """
    by_seed = rows.groupby(["num_real", "seed"])[["rate", "recall", "recall_at_real_rate"]].mean()
    means = by_seed.groupby("num_real").mean().assign(excess=lambda table: table["rate"] - RATE)
    return {
        name: {str(number): float(values[number]) for number in numbers if number in values.index}
        for name, values in means.items()
    }


def _pays(rows: "pd.DataFrame", arm: str, numbers: Sequence[int]) -> list[int]:
    """The numbers of real windows at which training data pay, compared with the real windows of the
    same seeds.
    """
    own = rows[rows["arm"] == arm]
    real = _curve(rows[(rows["arm"] == REAL) & rows["seed"].isin(own["seed"].unique())], numbers)
    its = _curve(own, numbers)
    found = []
    for at, excess in its["excess"].items():
        loss = real["recall_at_real_rate"][at] - its["recall_at_real_rate"][at]
        most = PAYS_SHARE * real["excess"][at]
        if real["excess"][at] > SUFFICES and max(excess, 0) <= most and loss <= MAX_RECALL_LOSS:
            found.append(int(at))
    return found
