"""Contributions of factors by their definition, and the cells of the design."""

import itertools

import numpy as np
import pytest

from studies.factorial import summary
from studies.factorial.cells import CELLS, LEVELS, NETWORK, PAPER_CELL, WHOLE_WINDOWS, WITHOUT_NETWORK, Cell, cells_by_source


def test_contributions_add_up_and_agree_with_the_orders():
    rng = np.random.default_rng(0)
    worth = {frozenset(each): rng.standard_normal() for size in range(5) for each in itertools.combinations(LEVELS, size)}
    for factor in LEVELS:  # the definition: the mean change over all orders of switching
        changes = []
        for order in itertools.permutations(LEVELS):
            before = frozenset(order[: order.index(factor)])
            changes.append(worth[before | {factor}] - worth[before])
        assert summary.contribution(worth, factor) == pytest.approx(np.mean(changes))
    total = sum(summary.contribution(worth, factor) for factor in LEVELS)
    assert total == pytest.approx(worth[frozenset(LEVELS)] - worth[frozenset()])


def test_corners_switch_the_named_factors():
    assert summary.corner([], WHOLE_WINDOWS) == PAPER_CELL.name and summary.corner(LEVELS, WHOLE_WINDOWS) == WITHOUT_NETWORK.name
    assert summary.corner(["extraction"], WHOLE_WINDOWS) == "few / residual / network / paper's GAN"


def test_noise_of_the_moving_average_does_not_depend_on_the_enhancer():
    assert len({Cell("few", "moving average", enhancer, "autoregression").source for enhancer in LEVELS["enhancer"]}) == 1
    assert Cell("few", "residual", NETWORK, "autoregression").source != Cell("few", "residual", "ridge", "autoregression").source


def test_every_cell_is_there_once_and_cells_that_share_a_noise_model_follow_each_other():
    parts = cells_by_source()
    assert len(CELLS) == 2 * 2 * 2 * 4 and len(parts) == 6
    assert sorted(cell.name for cells in parts.values() for cell in cells) == sorted(CELLS)
    for cells in parts.values():
        assert len([generator for generator, _ in itertools.groupby(cells, key=lambda cell: cell.generator)]) == 4
