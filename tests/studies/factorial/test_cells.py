"""Tests the design of the factorial experiment."""

import itertools

from studies.factorial.cells import (
    CELLS,
    LEVELS,
    NETWORK,
    PAPER_CELL,
    PUBLISHED,
    REFERENCES,
    WITHOUT_NETWORK,
    Cell,
    rounds,
)
from studies.robustness.replicate import ARMS


def test_every_combination_is_a_cell_once():
    assert len(CELLS) == 2 * 2 * 2 * 4 and [len(levels) for levels in LEVELS.values()] == [2, 2, 2, 4]
    assert CELLS["few / moving average / network / paper's GAN"] == PAPER_CELL
    assert all(levels[0] == value for levels, value in zip(LEVELS.values(), vars(PAPER_CELL).values(), strict=True))


def test_the_rounds_contain_every_cell_once_and_the_first_trains_no_network():
    (cheap,), (many, paper), (autoregression,), (convolutional,) = rounds()
    assert sorted([*cheap, *many, *paper, *autoregression, *convolutional]) == sorted([*REFERENCES, *CELLS])
    assert WITHOUT_NETWORK.name in cheap and not any("network" in name or "GAN" in name for name in cheap)
    for names, generator in ((autoregression, "autoregression"), (convolutional, "convolutional GAN")):
        assert len(names) == 8 and all(name.endswith(generator) for name in names)
    # the first two rounds hold all cells of the main comparison
    assert {CELLS[name].generator for name in [*cheap, *many, *paper] if name in CELLS} == {"paper's GAN", "whole windows"}


def test_cells_that_share_a_noise_model_follow_each_other():
    _, (_, paper), (autoregression,), (convolutional,) = rounds()
    for names, models in (
        (paper, 2 + 6),
        (autoregression, 6),
        (convolutional, 6),
    ):  # of a GAN: two of the moving average, two for each enhancer
        found = [(CELLS[name].source, CELLS[name].generator) for name in names]
        assert 1 + sum(before != after for before, after in itertools.pairwise(found)) == len(set(found)) == models


def test_noise_of_the_moving_average_does_not_depend_on_the_enhancer():
    sources = {Cell("few", "moving average", enhancer, "autoregression").source for enhancer in LEVELS["enhancer"]}
    assert len(sources) == 1
    assert Cell("few", "residual", NETWORK, "autoregression").source != Cell("few", "residual", "ridge", "autoregression").source


def test_published_arms_exist_in_both_experiments():
    assert set(PUBLISHED) <= set(ARMS) and set(PUBLISHED.values()) <= {*REFERENCES, *CELLS}
