"""Blocks of time and the margin of chance, against numbers worked out by hand and the distribution of Student's t."""

import numpy as np
import pytest
from scipy.stats import t

from enhsim_tf.noise.block_means import NUM_BLOCKS, block_slices, margin


def test_two_standard_errors_by_hand():
    # mean 1, standard deviation 2 / sqrt(3), standard error 1 / sqrt(3)
    assert margin(np.array([0.0, 0.0, 2.0, 2.0])) == pytest.approx(2 / np.sqrt(3))
    assert margin(np.array([5.0])) == 0


@pytest.mark.parametrize("number", [1, 2, 9, 10, 11, 25, 500])
def test_blocks_contain_each_row_once_and_are_nearly_equal(number):
    blocks = block_slices(number)
    assert np.concatenate([np.arange(number)[block] for block in blocks]).tolist() == list(range(number))
    sizes = [block.stop - block.start for block in blocks]
    assert len(blocks) == min(number, NUM_BLOCKS) and max(sizes) - min(sizes) <= 1 and min(sizes) >= 1


def test_chance_exceeds_the_margin_as_often_as_the_t_distribution_says():
    means = np.random.default_rng(1).standard_normal((20_000, NUM_BLOCKS))
    share = np.mean([each.mean() > margin(each) for each in means])
    assert share == pytest.approx(t.sf(2, NUM_BLOCKS - 1), abs=0.005)  # 3.8 %; four standard errors of a share of 20,000
