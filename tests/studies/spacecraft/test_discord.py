"""Left discord, against a direct computation."""

import numpy as np
import pytest

from studies.spacecraft.discord import left_discord


def direct(series, begin, window):
    """The distance to each earlier window, one by one."""

    def normalised(start):
        piece = series[start : start + window]
        return (piece - piece.mean()) / piece.std()

    return min(np.linalg.norm(normalised(begin) - normalised(start)) for start in range(begin - window + 1))


def test_distances_equal_those_of_a_direct_computation():
    series = np.random.default_rng(0).standard_normal(300)
    begins = np.array([40, 100, 270])
    np.testing.assert_allclose(left_discord(series, begins, 30), [direct(series, begin, 30) for begin in begins], rtol=1e-9)


def test_a_shape_that_never_occurred_is_the_discord():
    series = np.sin(2 * np.pi * np.arange(1_000) / 50) + 0.01 * np.random.default_rng(0).standard_normal(1_000)
    series[700:720] = series[700]
    begins = np.arange(200, 951, 10)
    found = left_discord(series, begins, 50)
    assert 650 < begins[np.argmax(found)] < 720


def test_the_scale_and_the_level_of_a_window_do_not_count():
    shape = np.random.default_rng(1).standard_normal(20)
    assert left_discord(np.concatenate([shape, 5 + 3 * shape]), [20], 20)[0] == pytest.approx(0, abs=1e-6)


def test_constant_windows_and_the_first_window(refused):
    series = np.concatenate([np.random.default_rng(2).standard_normal(40), np.ones(40)])
    found = left_discord(series, np.array([0, 40, 60]), 20)
    np.testing.assert_allclose(found, [2 * np.sqrt(20), np.sqrt(20), 0.0])
    with refused("windows inside the series"):
        left_discord(series, [61], 20)
