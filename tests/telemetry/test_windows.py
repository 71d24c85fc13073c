"""Blocks of time and disjoint windows, against cases worked out by hand."""

import numpy as np

from enhsim_tf.telemetry.windows import disjoint_rows, time_blocks


def test_blocks_of_time_by_hand():
    starts = np.array([30, 0, 10, 20, 40, 50])  # windows of 10 that share no sample, not in order
    blocks = [(training.tolist(), held_out.tolist()) for training, held_out in time_blocks(starts, 3, 10)]
    assert blocks == [([3, 0, 4, 5], [1, 2]), ([1, 2, 4, 5], [3, 0]), ([1, 2, 3, 0], [4, 5])]


def test_windows_that_overlap_the_held_out_block_are_left_out():
    starts = np.arange(0, 60, 5)  # windows of 10: neighbours share 5 samples; blocks begin at 0, 20 and 40
    training, held_out = time_blocks(starts, 3, 10)[1]
    assert starts[held_out].tolist() == [20, 25, 30, 35] and starts[training].tolist() == [0, 5, 10, 45, 50, 55]
    training, held_out = time_blocks(starts, 3, 18)[1]
    assert starts[training].tolist() == [0, 55], "a quarter of eight remains"
    training, _ = time_blocks(starts, 3, 21)[1]
    assert len(training) == 8, "where less than a quarter would remain, all are kept"


def test_there_are_at_most_as_many_blocks_as_windows():
    assert time_blocks(np.array([5]), 5, 10) == []
    assert [held_out.tolist() for _, held_out in time_blocks(np.array([5, 0, 99]), 5, 1)] == [[1], [0], [2]]


def test_disjoint_windows_by_hand():
    starts = np.array([25, 0, 7, 10, 19, 20])  # windows of 10: those that begin at 0, 10 and 20 share no sample
    assert disjoint_rows(starts, 10).tolist() == [1, 3, 5]
    assert disjoint_rows(starts, 1).tolist() == [1, 2, 3, 4, 5, 0]
    assert disjoint_rows(starts[:0], 10).tolist() == []
