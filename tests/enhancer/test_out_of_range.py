"""The out-of-range score for points computed by hand, and for degraded modes."""

import numpy as np
import pytest

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.scoring.metrics import threshold

PERIODS, SIZES, WINDOW = (480, 120), (0.5, 0.25), 500
COARSE = SquareWaveSimulator(
    [SquareWave(period, low=-size, high=size) for period, size in zip(PERIODS, SIZES, strict=True)]
)


def times(number, seed):
    return np.random.default_rng(seed).integers(0, 10**6, number)[:, None] + np.arange(
        float(WINDOW)
    )


def degraded(mode, severity, number=20, seed=2):
    """Coarse windows of a degraded mode."""
    return COARSE.simulate(
        times(number, seed), Degraded(mode, severity), np.random.default_rng(seed)
    )


@pytest.fixture(scope="module")
def training():
    return COARSE.simulate(times(1_500, 0))


@pytest.fixture(scope="module")
def fitted(training):
    return OutOfRange().fit(training)


def test_points_by_hand():
    # the first axis explains all but 1 / 41 of the variance; unit: root mean square of all twelve
    # coordinates
    training = 7 + np.array(
        [[-4.0, 0, 0], [4, 0, 0], [-2, 0.5, 0], [-2, -0.5, 0], [2, 0.5, 0], [2, -0.5, 0]]
    )
    unit = np.sqrt((2 * 16 + 4 * 4 + 4 * 0.25) / 18)
    found = (
        OutOfRange()
        .fit(training)
        .score(7 + np.array([[4.0, 0, 0], [5, 3, 4], [2, 0.5, 0], [0, 0, 0]]))
    )
    np.testing.assert_allclose(
        found * unit, np.sqrt(np.array([0, 25 + 0.25 * 1, 0.25, 0.25 * 4]) / 3), atol=1e-7
    )


def test_a_score_has_no_unit_and_does_not_count_repeats(fitted, training):
    windows = degraded("drift", 0.5)
    scaled = OutOfRange().fit(1e4 * training + 3e4)
    np.testing.assert_allclose(scaled.score(1e4 * windows + 3e4), fitted.score(windows), rtol=1e-4)
    repeated = OutOfRange().fit(np.concatenate([training[::-1], training[:700]]))
    np.testing.assert_allclose(repeated.score(windows), fitted.score(windows), rtol=1e-9)


def test_nominal_windows_are_in_range(fitted):
    scores, further = (fitted.score(COARSE.simulate(times(1_000, seed))) for seed in (1, 5))
    limit = threshold(scores, 0.01)
    assert np.mean(further > limit) < 0.01 + 4 * np.sqrt(0.01 / 1_000)
    for mode in ("stuck", "drift", "dropout", "period_change"):
        assert np.mean(fitted.score(degraded(mode, 0.5)) > limit) > 0.95
    assert fitted.score(degraded("drift", 1.0)).min() > 3 * limit


def test_waves_in_phases_that_training_never_had_are_seen_by_their_distance(fitted):
    nominal = times(200, 3)
    shifted = COARSE.waves[0](nominal) + COARSE.waves[1](nominal + 30)
    inside, outside = (fitted.score(windows) for windows in (COARSE(nominal), shifted))
    assert outside.min() > inside.max()
