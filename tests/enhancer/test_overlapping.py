"""Runs from overlapping windows: no seam is seen, whatever the length."""

import numpy as np
import pytest

from enhsim_tf.enhancer.overlapping import cut_run, enhance_run, run_starts


@pytest.mark.parametrize("num_samples", [32, 33, 63, 200, 201])
def test_windows_that_agree_give_the_run_itself(num_samples):
    coarse = np.random.default_rng(0).standard_normal((num_samples, 2)).astype(np.float32)
    made = enhance_run(lambda windows: 2 * windows[:, :, 0] - windows[:, :, 1], coarse, 32)
    np.testing.assert_allclose(made, 2 * coarse[:, 0] - coarse[:, 1], atol=1e-5)


def test_windows_that_disagree_are_joined_without_a_step():
    levels = iter(np.random.default_rng(0).standard_normal(1_000))
    made = enhance_run(lambda windows: np.stack([np.full(64, next(levels)) for _ in windows]), np.zeros((1_000, 1)), 64)
    assert np.abs(np.diff(made)).max() < 0.12  # the levels themselves differ by up to 4


def test_every_sample_is_covered_and_the_last_window_ends_with_the_run():
    starts = run_starts(101, 20)
    assert starts[0] == 0 and starts[-1] == 81 and np.diff(starts).max() <= 5
    windows = cut_run(np.arange(202).reshape(101, 2), starts, 20)
    assert windows.shape == (len(starts), 20, 2) and windows[-1, -1].tolist() == [200, 201]
