"""Splitting and cutting series, and blocks of time, against cases worked out by hand."""

import numpy as np
import pytest

from enhsim_tf.telemetry.windows import evenly_spaced_starts, random_window_starts, time_blocks


def test_blocks_of_time_by_hand():
    starts = np.array([30, 0, 10, 20, 40, 50])  # windows of 10 that share no sample, not in order
    blocks = [tuple(map(list, block)) for block in time_blocks(starts, 3, 10)]
    assert blocks == [([3, 0, 4, 5], [1, 2]), ([1, 2, 4, 5], [3, 0]), ([1, 2, 3, 0], [4, 5])]


def test_windows_that_overlap_the_held_out_block_are_left_out():
    # windows of 10: neighbours share 5 samples; blocks begin at 0, 20 and 40
    starts = np.arange(0, 60, 5)
    training, held_out = time_blocks(starts, 3, 10)[1]
    assert starts[held_out].tolist() == [20, 25, 30, 35]
    assert starts[training].tolist() == [0, 5, 10, 45, 50, 55]
    training, held_out = time_blocks(starts, 3, 18)[1]
    assert starts[training].tolist() == [0, 55], "a quarter of eight remains"
    training, _ = time_blocks(starts, 3, 21)[1]
    assert len(training) == 8, "where less than a quarter would remain, all are kept"


def test_there_are_at_most_as_many_blocks_as_windows():
    assert time_blocks(np.array([5]), 5, 10) == []
    blocks = time_blocks(np.array([5, 0, 99]), 5, 1)
    assert [held_out.tolist() for _, held_out in blocks] == [[1], [0], [2]]


def test_random_starts_reach_every_window_and_no_more(refused):
    starts, again, other = (
        random_window_starts([range(30)], 20, 5_000, np.random.default_rng(seed))
        for seed in (0, 0, 1)
    )
    counts = np.bincount(starts, minlength=11)
    assert len(counts) == 11  # 0 to 10: the last window ends with the series
    assert counts == pytest.approx(np.full(11, 5_000 / 11), abs=5 * np.sqrt(5_000 / 11))
    assert (starts == again).all() and (starts != other).any()
    rng = np.random.default_rng(0)
    assert random_window_starts([range(20)], 20, 3, rng).tolist() == [0, 0, 0]
    with refused("at least 20 samples", "Received: 19"):
        random_window_starts([range(19)], 20, 3, rng)


def test_evenly_spaced_starts_reach_from_end_to_end():
    assert evenly_spaced_starts([range(110)], 10, 5).tolist() == [0, 25, 50, 75, 100]
    starts = evenly_spaced_starts([range(1_000)], 60, 37)
    # 940 / 36 = 26.1
    assert (starts[0], starts[-1]) == (0, 940) and set(np.diff(starts)) == {26, 27}
    assert evenly_spaced_starts([range(60)], 60, 3).tolist() == [0]
