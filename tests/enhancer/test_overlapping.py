"""Runs from overlapping windows: no seam is seen, whatever the length."""

import numpy as np
import pytest

from enhsim_tf.enhancer.model import average_windows, run_starts


@pytest.mark.parametrize("num_samples", [32, 63, 201])
def test_windows_that_agree_give_the_run_itself(num_samples):
    run = np.random.default_rng(0).standard_normal((num_samples, 2)).astype(np.float32)
    starts = run_starts(num_samples, 32)
    made = average_windows(lambda rows: run[starts[rows, None] + np.arange(32)], starts, 32, num_samples)
    assert made.dtype == np.float32
    np.testing.assert_allclose(made, run, atol=1e-5)


def test_windows_that_disagree_are_joined_without_a_step():
    starts, levels = run_starts(1_000, 64), np.random.default_rng(0).standard_normal(1_000)
    made = average_windows(lambda rows: np.tile(levels[: len(starts)][rows, None, None], (1, 64, 1)), starts, 64, 1_000)
    assert np.abs(np.diff(made[:, 0])).max() < 0.12  # the levels themselves differ by up to 4


def test_every_sample_is_covered_and_the_last_window_ends_with_the_run():
    starts = run_starts(101, 20)
    assert starts[0] == 0 and starts[-1] == 81 and np.diff(starts).max() <= 5
    assert run_starts(20, 20).tolist() == [0] and run_starts(21, 20).tolist() == [0, 1]
