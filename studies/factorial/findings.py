"""Findings of the factorial experiment, computed from its table of cells alone.

Fixed before the first run:

- The primary outcome is the share of the gap in false alarms that a cell closes: (coarse - cell) / (coarse - real), each the mean
  false-alarm rate over the detectors. The second outcome is recall at the real rate, in percentage points.
- Each factor is switched from the paper's level to the other one: few to many windows, moving average to residual, network to ridge
  regression, and the paper's GAN to each of the three other generators in turn. Whole windows are the main comparison.
- The contribution of a factor is the change that switching it makes, averaged over all orders in which the four factors can be switched
  (the Shapley value). The contributions add up to the difference between the two ends. Because factors interact, the change is also given
  for a factor that is switched first (from the paper's pipeline) and last.
- Intervals are crossed bootstraps over environments and seeds. A comparison uses the seeds for which all of its cells exist in all
  environments, and the findings name these seeds.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics
from studies.factorial.cells import (
    AUTOREGRESSION,
    CELLS,
    CONVOLUTIONAL_GAN,
    FEW,
    GENERATORS,
    LEVELS,
    MANY,
    NETWORK,
    PAPER_CELL,
    REFERENCES,
    RESIDUAL,
    RIDGE,
    WHOLE_WINDOWS,
    WITHOUT_NETWORK,
    Cell,
)
from studies.robustness.averages import REPLICATE, interval
from studies.robustness.replicate import ENVIRONMENTS, QUICK_DETECTORS

if TYPE_CHECKING:
    import pandas as pd

OUTCOMES = ("gap_closed", "recall_at_real_rate")
CONTRASTS = {
    "no network, real": (WITHOUT_NETWORK.name, "real"),
    "no network, paper": (WITHOUT_NETWORK.name, PAPER_CELL.name),
    "network, ridge": (Cell(MANY, RESIDUAL, NETWORK, WHOLE_WINDOWS).name, WITHOUT_NETWORK.name),
    "network, ridge, few windows": (
        Cell(FEW, RESIDUAL, NETWORK, WHOLE_WINDOWS).name,
        Cell(FEW, RESIDUAL, RIDGE, WHOLE_WINDOWS).name,
    ),
    "autoregression, whole windows": (Cell(MANY, RESIDUAL, RIDGE, AUTOREGRESSION).name, WITHOUT_NETWORK.name),
    "convolutional GAN, whole windows, network": (
        Cell(MANY, RESIDUAL, NETWORK, CONVOLUTIONAL_GAN).name,
        Cell(MANY, RESIDUAL, NETWORK, WHOLE_WINDOWS).name,
    ),
    "convolutional GAN, whole windows": (Cell(MANY, RESIDUAL, RIDGE, CONVOLUTIONAL_GAN).name, WITHOUT_NETWORK.name),
    "convolutional GAN, whole windows, few windows": (
        Cell(FEW, RESIDUAL, RIDGE, CONVOLUTIONAL_GAN).name,
        Cell(FEW, RESIDUAL, RIDGE, WHOLE_WINDOWS).name,
    ),
    "few, many": (Cell(FEW, RESIDUAL, RIDGE, WHOLE_WINDOWS).name, WITHOUT_NETWORK.name),
}
"""Differences in false alarms and recall that the conclusions use: the first arm minus the second."""


def summarise(table: "pd.DataFrame") -> dict[str, Any]:
    """All numbers about the experiment, from the cells that there are.

    Args:
        table: As `run.read_cells` gives it.

    Returns:
        Plain JSON types: the seeds, the cells, the contributions of the factors and the contrasts.

    Raises:
        InputError: If no seed has both references in all environments.
    """
    is_there = table[table["cell"].isin(REFERENCES)].groupby(REPLICATE)["cell"].nunique().unstack("environment").eq(len(REFERENCES))
    if not is_there.all(axis=1).any() or is_there.shape[1] < table["environment"].nunique():
        raise InputError("Expected a seed with the cells coarse and real in all environments. Received: none. Run the experiment first.")
    rate, values = averaged(table)
    seeds = complete_seeds(rate, REFERENCES)
    return {
        "environments": _environments(table),
        "seeds": seeds,
        "num_windows": int(table["windows"].median()),
        "detectors": [name for name in QUICK_DETECTORS if name in set(table["detector"])],
        "num_cells": int(table[table["cell"].isin(list(CELLS))].groupby([*REPLICATE, "cell"]).ngroups),
        "of_cells": len(CELLS) * len(seeds) * table["environment"].nunique(),
        "cells": {name: found for name in (*REFERENCES, *CELLS) if (found := _cell(table, rate, values, name)) is not None},
        "shares": {generator: found for generator in GENERATORS if (found := shares(values, generator)) is not None},
        "contrasts": {name: found for name, pair in CONTRASTS.items() if (found := _contrast(rate, values, *pair)) is not None},
    }


def _environments(table: "pd.DataFrame") -> list[str]:
    return [name for name in ENVIRONMENTS if name in set(table["environment"])]


def averaged(table: "pd.DataFrame") -> "tuple[pd.DataFrame, dict[str, pd.DataFrame]]":
    """Means over detectors: the false-alarm rate, and every outcome; replicates in rows and cells in columns."""
    groups = table.assign(rate=table["alarms"] / table["windows"]).groupby([*REPLICATE, "cell"])
    rate, recall, own = (groups[name].mean().unstack("cell") for name in ("rate", "recall_at_real_rate", "recall"))
    gap = rate.apply(lambda row: [metrics.gap_closed(each, row["coarse"], row["real"]) for each in row], axis=1, result_type="broadcast")
    return rate, {"gap_closed": gap, "recall_at_real_rate": recall, "recall": own}


def complete_seeds(values: "pd.DataFrame", names: Iterable[str]) -> list[int]:
    """Seeds for which all of the named cells exist in all environments.

    Args:
        values: Replicates in rows, cells in columns.
        names: Names of cells.
    """
    names = list(names)
    if not set(names) <= set(values.columns):
        return []
    is_there = values[names].notna().all(axis=1).unstack("environment")
    return sorted(int(seed) for seed in is_there.index[is_there.eq(True).all(axis=1)])


def _of_seeds(values: "pd.Series", seeds: Sequence[int]) -> "pd.Series":
    return values[values.index.get_level_values("seed").isin(seeds)]


def _cell(table: "pd.DataFrame", rate: "pd.DataFrame", values: "Mapping[str, pd.DataFrame]", name: str) -> dict[str, Any] | None:
    seeds = complete_seeds(rate, [name, *REFERENCES])
    if not seeds:
        return None
    chosen = {key: _of_seeds(each[name], seeds) for key, each in ({"false_alarms": rate} | dict(values)).items()}
    kept, pairs = _keeps_the_rule(table[table["seed"].isin(seeds)], name)
    return {
        "seeds": seeds,
        "false_alarms": interval(chosen["false_alarms"]),
        **{key: float(chosen[key].mean()) for key in ("gap_closed", "recall", "recall_at_real_rate")},
        "by_environment": {
            environment: {key: float(each.loc[environment].mean()) for key, each in chosen.items()}
            | {"false_alarms": interval(chosen["false_alarms"], environment)}
            for environment in _environments(table)
        },
        "kept": kept,
        "pairs": pairs,
    }


def _keeps_the_rule(table: "pd.DataFrame", name: str) -> tuple[int, int]:
    """In how many pairs of environment and detector a cell meets the criterion of claim C8, as means over seeds, and of how many."""
    from studies.robustness.findings import keeps_the_rule

    chosen = table[table["cell"].isin([name, "real"])].rename(columns={"cell": "arm"})
    means = chosen.assign(rate=chosen["alarms"] / chosen["windows"]).groupby(["arm", "environment", "detector"])[["rate", "recall"]].mean()
    keeps = keeps_the_rule(means["rate"], means["recall"])[name]
    return int(keeps.sum()), int(len(keeps))


def corner(switched: Iterable[str], generator: str) -> str:
    """Name of the cell in which the given factors have their second level and the others that of the paper.

    Args:
        switched: Names of factors.
        generator: The second level of the factor `generator`.
    """
    switched = set(switched)
    second = {factor: levels[1] for factor, levels in LEVELS.items()} | {"generator": generator}
    return Cell(**{factor: second[factor] if factor in switched else levels[0] for factor, levels in LEVELS.items()}).name


def shares(values: "Mapping[str, pd.DataFrame]", generator: str) -> dict[str, Any] | None:
    """Contributions of the factors to each outcome; None if no seed has all sixteen cells.

    Args:
        values: As `averaged` gives them.
        generator: The generator that replaces the paper's GAN.
    """
    subsets = [each for size in range(len(LEVELS) + 1) for each in itertools.combinations(LEVELS, size)]
    seeds = complete_seeds(values["gap_closed"], [corner(each, generator) for each in subsets])
    if not seeds:
        return None
    found: dict[str, Any] = {"seeds": seeds}
    for outcome in OUTCOMES:
        worth = {frozenset(each): _of_seeds(values[outcome][corner(each, generator)], seeds) for each in subsets}
        every = frozenset(LEVELS)
        found[outcome] = {
            "paper": interval(worth[frozenset()]),
            "switched": interval(worth[every]),
            "factors": {
                factor: {
                    "share": interval(contribution(worth, factor)),
                    "first": interval(worth[frozenset([factor])] - worth[frozenset()]),
                    "last": interval(worth[every] - worth[every - {factor}]),
                    "by_environment": {
                        name: float(mean) for name, mean in contribution(worth, factor).groupby("environment").mean().items()
                    },
                }
                for factor in LEVELS
            },
        }
    return found


def contribution(worth: Mapping[frozenset[str], Any], factor: str) -> Any:
    """The Shapley value of a factor: the change that it makes, averaged over all orders of switching the factors.

    Args:
        worth: Outcome of each set of switched factors, for all subsets.
        factor: The factor.
    """
    others = sorted(set().union(*worth) - {factor})
    number, total = len(others) + 1, 0.0
    for size in range(number):
        weight = math.factorial(size) * math.factorial(number - size - 1) / math.factorial(number)
        for before in map(frozenset, itertools.combinations(others, size)):
            total = total + weight * (worth[before | {factor}] - worth[before])
    return total


def _contrast(rate: "pd.DataFrame", values: "Mapping[str, pd.DataFrame]", first: str, second: str) -> dict[str, Any] | None:
    seeds = complete_seeds(rate, [first, second, *REFERENCES])
    if not seeds:
        return None
    differences = {"false_alarms": rate, "recall_at_real_rate": values["recall_at_real_rate"]}
    chosen = {name: _of_seeds(table[first] - table[second], seeds) for name, table in differences.items()}
    return {
        "first": first,
        "second": second,
        "seeds": seeds,
        **{name: interval(each) for name, each in chosen.items()},
        "by_environment": {
            environment: {name: interval(each, environment) for name, each in chosen.items()}
            for environment in _environments(rate.reset_index())
        },
    }
