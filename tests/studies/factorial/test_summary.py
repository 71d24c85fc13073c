"""Contributions of factors by their definition."""

import itertools

import numpy as np
import pytest

from studies.factorial import summary
from studies.factorial.cells import LEVELS


def test_contributions_add_up_and_agree_with_the_orders():
    rng = np.random.default_rng(0)
    worth = {
        frozenset(each): rng.standard_normal()
        for size in range(5)
        for each in itertools.combinations(LEVELS, size)
    }
    for factor in LEVELS:  # the definition: the mean change over all orders of switching
        changes = []
        for order in itertools.permutations(LEVELS):
            before = frozenset(order[: order.index(factor)])
            changes.append(worth[before | {factor}] - worth[before])
        assert summary.contribution(worth, factor) == pytest.approx(np.mean(changes))
    total = sum(summary.contribution(worth, factor) for factor in LEVELS)
    assert total == pytest.approx(worth[frozenset(LEVELS)] - worth[frozenset()])
