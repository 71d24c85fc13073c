"""The detector of differences from the aligned simulator: what it absorbs and what it does not."""

import keras
import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator import scoring
from enhsim_tf.enhanced_simulator.residual_detector import AlignedResidual
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions, score_channel
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.telemetry.series import Telemetry

WINDOW, SD = 96, 0.1
COARSE = SquareWaveSimulator([SquareWave(48, low=-1, high=1)])


@pytest.fixture(scope="module")
def known():
    """A simulator of known processes: the coarse signal at levels around 10 with gains around 1, plus white noise."""
    enhancer = keras.Sequential([keras.Input((WINDOW,)), keras.layers.Dense(WINDOW)])
    enhancer.layers[0].set_weights([np.eye(WINDOW), np.zeros(WINDOW)])
    levels = [[10.0, 1.0], [10.2, 1.1], [9.9, 0.9]]
    return EnhancedSimulator(COARSE, enhancer, GaussianNoise(SD, WINDOW), levels=levels)


@pytest.fixture(scope="module")
def detector(known):
    return AlignedResidual(known).fit(known.generate(200, seed=0))


def windows(number=60, shift_s=0.0, level=10.0, gain=1.0, sd=SD, seed=1):
    times = shift_s + 12.0 * np.arange(number)[:, None] + np.arange(WINDOW)
    return (level + gain * COARSE(times) + sd * np.random.default_rng(seed).standard_normal((number, WINDOW))).astype(np.float32)


@pytest.mark.parametrize("changed", [{}, {"shift_s": 17.0}, {"level": 10.5}, {"gain": 1.9}, {"gain": 0.5}])
def test_phase_level_and_gain_within_the_bounds_leave_the_noise(detector, changed):
    sizes = detector.sizes(windows(**changed))
    # the edges of a square wave are found to a sample or so, and two fitted numbers take a little of the noise
    assert np.median(sizes) == pytest.approx(SD * np.sqrt(1 - 2 / WINDOW), rel=0.05)


@pytest.mark.parametrize(
    ("changed", "least"),
    [
        ({"level": 13.0}, 1.5),  # the nominal means span about 0.3, so 1.5 or more is beyond the range and one width
        ({"level": 7.0}, 1.5),
        ({"gain": 0.0}, 0.4),  # a channel that stands still: half the smallest gain, 0.45, is left over
        ({"gain": 4.0}, 1.5),
    ],
)
def test_what_lies_beyond_the_bounds_stays_in_the_residual_for_as_long_as_it_lasts(detector, changed, least):
    scores = detector.score(windows(400, **changed))
    assert scores.min() > least / detector.size.bound > 2 * SD


def test_telemetry_without_stored_levels_is_compared_on_the_clock(known):
    fixed = EnhancedSimulator(COARSE, known.enhancer, GaussianNoise(SD, WINDOW))
    found = AlignedResidual(fixed).residuals(windows(3, level=0.0)[:1])
    np.testing.assert_allclose(found, windows(3, level=0.0)[:1] - COARSE(np.arange(WINDOW)), atol=1e-5)


def test_the_command_s_scores_flag_a_fault_and_little_else(known, monkeypatch):
    monkeypatch.setattr(scoring, "_THRESHOLD_WINDOWS", 150)
    values = known.generate_series(6_000, seed=7)
    values[3_000:3_300] = values[3_000]  # longer than three windows
    frame = score_channel(known, [Telemetry(values, name="volts")], ScoreOptions("residual", num_windows=200, seed=3))
    assert frame["flag"].iloc[3_000:3_300].all()
    rest = np.r_[0 : 3_000 - WINDOW, 3_300 + WINDOW : 6_000]
    assert frame["flag"].iloc[rest].mean() < 0.1
    again = score_channel(known, [Telemetry(values, name="volts")], ScoreOptions("residual", num_windows=200, seed=3))
    assert frame["score"].equals(again["score"])


def test_a_model_of_recorded_runs_needs_the_run(refused):
    with refused("--coarse"):
        AlignedResidual(object())
