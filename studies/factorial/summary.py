"""Findings of the factorial study, computed from its published table alone.

Fixed before the first run:

- The primary outcome is the share of the gap in false alarms that a cell closes: (coarse - cell) /
  (coarse - real), each the mean false-alarm rate over the detectors. The second outcome is recall
  at the real rate.
- Each factor is switched from the paper's level to the other one: few to many windows, moving
  average to residual, network to ridge regression, and the paper's GAN to each of the other
  generators in turn. Whole windows are the main comparison.
- The contribution of a factor is the change that switching it makes, averaged over all orders in
  which the four factors can be switched (the Shapley value). The contributions add up to the
  difference between the two ends. Because factors interact, the change is also given for a factor
  that is switched first (from the paper's pipeline) and last.
"""

import itertools
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from studies.common.noise_processes import NOISES
from studies.common.statistics import mean_interval, t_interval
from studies.common.tables import KeptTables, seeds_of
from studies.factorial.cells import (
    AUTOREGRESSION,
    CELLS,
    DETECTORS,
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

if TYPE_CHECKING:
    import pandas as pd

REPLICATE = ["environment", "seed"]
OUTCOMES = ("gap_closed", "recall_at_real_rate")
CONTRASTS = {
    "no network, real": (WITHOUT_NETWORK.name, "real"),
    "no network, paper": (WITHOUT_NETWORK.name, PAPER_CELL.name),
    "network, ridge": (Cell(MANY, RESIDUAL, NETWORK, WHOLE_WINDOWS).name, WITHOUT_NETWORK.name),
    "autoregression, whole windows": (
        Cell(MANY, RESIDUAL, RIDGE, AUTOREGRESSION).name,
        WITHOUT_NETWORK.name,
    ),
    "few, many": (Cell(FEW, RESIDUAL, RIDGE, WHOLE_WINDOWS).name, WITHOUT_NETWORK.name),
}
"""Differences in false alarms and recall that the conclusions use: the first cell minus the
second.
"""
KEPT = KeptTables(
    ("cells",),
    labels=("environment", "cell", "detector"),
    digits=4,
    command="python -m studies.factorial",
)


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the README and the figure.

    Args:
        tables: As `KEPT.read` gives them.

    Returns:
        Plain JSON types: what was run, the cells, the contributions of the factors and the
        contrasts.
    """
    table = tables["cells"]
    values = averaged(table)
    return {
        "environments": [name for name in NOISES if name in set(table["environment"])],
        "seeds": seeds_of(table),
        "num_windows": int(table["windows"].median()),
        "detectors": list(DETECTORS),
        "cells": {
            name: {"false_alarms": mean_interval(values["false_alarms"][name])}
            | {outcome: float(values[outcome][name].mean()) for outcome in OUTCOMES}
            for name in (*REFERENCES, *CELLS)
        },
        "shares": {
            generator: {outcome: shares(values[outcome], generator) for outcome in OUTCOMES}
            for generator in GENERATORS
        },
        "contrasts": {name: _contrast(values, *pair) for name, pair in CONTRASTS.items()},
    }


def averaged(table: "pd.DataFrame") -> "dict[str, pd.DataFrame]":
    """Means over detectors: the false-alarm rate and both outcomes; replicates in rows and cells in
    columns.
    """
    groups = table.assign(rate=table["alarms"] / table["windows"]).groupby([*REPLICATE, "cell"])
    rate, recall = (groups[name].mean().unstack("cell") for name in ("rate", "recall_at_real_rate"))
    # NaN or infinite if there is no gap
    gap = rate.rsub(rate["coarse"], axis=0).div(rate["coarse"] - rate["real"], axis=0)
    return {"false_alarms": rate, "gap_closed": gap, "recall_at_real_rate": recall}


def corner(switched: Iterable[str], generator: str) -> str:
    """Name of the cell in which the given factors have their second level and the others that of
    the paper.

    Args:
        switched: Names of factors.
        generator: The second level of the factor `generator`.
    """
    first = {factor: levels[0] for factor, levels in LEVELS.items()}
    second = {factor: levels[1] for factor, levels in LEVELS.items()} | {"generator": generator}
    return Cell(**first | {factor: second[factor] for factor in switched}).name


def shares(values: "pd.DataFrame", generator: str) -> dict[str, Any]:
    """Contributions of the factors to an outcome.

    Args:
        values: The outcome; replicates in rows and cells in columns.
        generator: The generator that replaces the paper's GAN.
    """
    worth = {
        frozenset(switched): values[corner(switched, generator)]
        for size in range(len(LEVELS) + 1)
        for switched in itertools.combinations(LEVELS, size)
    }
    every = frozenset(LEVELS)
    return {
        "paper": mean_interval(worth[frozenset()]),
        "switched": mean_interval(worth[every]),
        "factors": {
            factor: {
                "share": mean_interval(contribution(worth, factor)),
                "first": mean_interval(worth[frozenset([factor])] - worth[frozenset()]),
                "last": mean_interval(worth[every] - worth[every - {factor}]),
            }
            for factor in LEVELS
        },
    }


def contribution(worth: Mapping[frozenset[str], Any], factor: str) -> Any:
    """The Shapley value of a factor: the change that it makes, averaged over all orders of
    switching the factors.

    Args:
        worth: Outcome of each set of switched factors, for all subsets.
        factor: The factor.
    """
    others = sorted(set().union(*worth) - {factor})
    number = len(others) + 1
    total = 0.0
    for size in range(number):
        weight = math.factorial(size) * math.factorial(number - size - 1) / math.factorial(number)
        for before in map(frozenset, itertools.combinations(others, size)):
            total = total + weight * (worth[before | {factor}] - worth[before])
    return total


def _contrast(values: "Mapping[str, pd.DataFrame]", first: str, second: str) -> dict[str, Any]:
    """Differences between two cells: crossed intervals over all environments, and Student's
    intervals over seeds within each.
    """
    differences = {
        name: values[name][first] - values[name][second]
        for name in ("false_alarms", "recall_at_real_rate")
    }
    environments = differences["false_alarms"].index.unique("environment")
    return {
        "first": first,
        "second": second,
        **{name: mean_interval(each) for name, each in differences.items()},
        "by_environment": {
            environment: {
                name: t_interval(each.xs(environment)) for name, each in differences.items()
            }
            for environment in environments
        },
    }
