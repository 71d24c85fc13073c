"""Blocks of time and the margin of chance, against numbers worked out by hand and the distribution of Student's t."""

import numpy as np
import pytest
from scipy.stats import t

from enhsim_tf.noise.block_means import NUM_BLOCKS, block_slices, margin


def test_two_standard_errors_by_hand():
    # each block is 1 above or below its mean: standard deviation sqrt(10 / 9), standard error 1 / 3
    assert margin([0.0, 2.0] * 5) == pytest.approx(2 / 3, rel=1e-3)
    assert margin([5.0]) == np.inf


@pytest.mark.parametrize("number", [1, 2, 9, 10, 11, 25, 500])
def test_blocks_contain_each_row_once_and_are_nearly_equal(number):
    blocks = block_slices(number)
    assert np.concatenate([np.arange(number)[block] for block in blocks]).tolist() == list(range(number))
    sizes = [block.stop - block.start for block in blocks]
    assert len(blocks) == min(number, NUM_BLOCKS) and max(sizes) - min(sizes) <= 1 and min(sizes) >= 1


@pytest.mark.parametrize("number", [2, 3, NUM_BLOCKS])
def test_chance_exceeds_the_margin_equally_rarely_with_few_blocks(number):
    blocks = np.random.default_rng(1).standard_normal((10_000, number))
    share = np.mean([each.mean() > margin(each) for each in blocks])
    assert share == pytest.approx(t.sf(2, NUM_BLOCKS - 1), abs=0.008)  # 3.8 %; four standard errors of a share of 10,000
