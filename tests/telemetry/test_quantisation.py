"""Levels of quantised telemetry are found, other telemetry has none, and values are rounded to the
nearest level.
"""

import numpy as np
import pytest

from enhsim_tf.telemetry.quantisation import Levels


@pytest.mark.parametrize("step", [0.1, 1.0, 1 / 128])
def test_the_levels_of_quantised_values_are_found(step):
    rng = np.random.default_rng(0)
    values = (step * np.round(rng.normal(20, 3, 5_000))).astype(np.float32)
    # an interpolated gap
    values[100:103] += np.float32(step) * np.array([0.25, 0.5, 0.75], np.float32)
    found = Levels.find(values)
    assert found.step == pytest.approx(step, rel=1e-6) and 15 <= found.count <= 25
    kept = np.delete(values, np.arange(100, 103))
    np.testing.assert_allclose(found.round(kept), kept, rtol=1e-6)


def test_values_off_the_grid_by_a_rounding_error_are_the_same_level():
    rng = np.random.default_rng(0)
    grid = 0.05 * rng.integers(-10, 11, (50, 200))
    signal = rng.uniform(-1, 1, (50, 200)).astype(np.float32)
    values = (grid + signal).astype(np.float32) - signal
    assert len(np.unique(values)) > 2 * 21
    found = Levels.find(values)
    assert found.step == pytest.approx(0.05, rel=1e-5) and found.count == 21
    np.testing.assert_allclose(found.round(values), grid, atol=1e-6)


NOISE = np.random.default_rng(0).standard_normal(5_000)
NO_LEVELS = {
    "noise": NOISE,
    # values of a noise-free wave repeat too
    "wave": np.tile(np.sin(2 * np.pi * np.arange(50) / 50), 100),
    "a saturated sensor": np.clip(NOISE, -1, 1),
    "short": np.arange(20.0),
    "uneven": np.random.default_rng(0).choice([0.0, 1.0, 1.7], 500),
    # so dense that most neighbours differ by less than a millionth
    "dense": np.random.default_rng(0).uniform(0, 1, 2_000_000),
}


@pytest.mark.parametrize("name", NO_LEVELS)
def test_values_that_are_not_quantised_have_no_levels(name):
    assert Levels.find(NO_LEVELS[name].astype(np.float32)) is None


def test_values_are_rounded_to_the_nearest_level():
    levels = Levels(0.5, 0.1, 4)
    np.testing.assert_allclose(
        levels.round(np.array([0.1, 0.34, 0.36, -0.2, 7.0])), [0.1, 0.1, 0.6, -0.4, 7.1], rtol=1e-6
    )
    assert levels.round(np.zeros((2, 3))).dtype == np.float32
