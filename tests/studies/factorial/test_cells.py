"""The design of the factorial study."""

import itertools

from studies.factorial.cells import CELLS, LEVELS, NETWORK, PAPER_CELL, Cell, cells_by_source


def test_every_combination_is_a_cell_once():
    assert len(CELLS) == 2 * 2 * 2 * 4 and [len(levels) for levels in LEVELS.values()] == [2, 2, 2, 4]
    assert CELLS["few / moving average / network / paper's GAN"] == PAPER_CELL
    assert all(levels[0] == value for levels, value in zip(LEVELS.values(), vars(PAPER_CELL).values(), strict=True))


def test_noise_of_the_moving_average_does_not_depend_on_the_enhancer():
    assert len({Cell("few", "moving average", enhancer, "autoregression").source for enhancer in LEVELS["enhancer"]}) == 1
    assert Cell("few", "residual", NETWORK, "autoregression").source != Cell("few", "residual", "ridge", "autoregression").source


def test_cells_that_share_a_noise_model_follow_each_other():
    parts = cells_by_source()
    assert len(parts) == 6 and sorted(cell.name for cells in parts.values() for cell in cells) == sorted(CELLS)
    for cells in parts.values():
        assert len([generator for generator, _ in itertools.groupby(cells, key=lambda cell: cell.generator)]) == 4
