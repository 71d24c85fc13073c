"""The simulator without a network recovers a known waveform and known noise from a wave whose level drifts."""

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.enhancer.training_pairs import cut_pairs
from enhsim_tf.telemetry.series import Telemetry
from studies.spacecraft.no_network import RidgeSimulator

WINDOW, PERIOD, SD = 100, 50, 0.05


def clean(place):
    return np.sin(2 * np.pi * place / PERIOD) + 0.3 * np.sin(6 * np.pi * place / PERIOD) + place / 3_000


@pytest.fixture(scope="module")
def telemetry():
    place = np.arange(3_000)
    return Telemetry((clean(place) + SD * np.random.default_rng(0).standard_normal(len(place))).astype(np.float32))


@pytest.fixture(scope="module")
def simulator(telemetry):
    return RidgeSimulator.fit(telemetry, SquareWaveSimulator.fit(telemetry), WINDOW, 600)


def test_it_follows_the_wave_up_to_the_noise(simulator, telemetry):
    pairs = simulator.align(cut_pairs([telemetry], simulator.coarse, np.arange(0, 2_900, 37), WINDOW, follow=True))
    truth = clean(np.arange(0, 2_900, 37)[:, None] + np.arange(WINDOW))
    error = np.sqrt(np.mean((simulator.follow(pairs) - truth) ** 2))
    raw = np.sqrt(np.mean((pairs.coarse_rescaled - truth) ** 2))
    assert error < SD < raw / 4


def test_its_residuals_are_the_noise(simulator):
    assert simulator.residuals.shape == (600, WINDOW)
    assert np.std(simulator.residuals) == pytest.approx(SD, rel=0.15)
    step = np.mean(simulator.residuals[:, 1:] * simulator.residuals[:, :-1]) / np.var(simulator.residuals)
    assert abs(step) < 0.2


def test_generated_windows_have_the_variance_of_the_telemetry_and_repeat_with_their_seed(simulator, telemetry):
    windows = simulator.generate(500, 3)
    assert windows.shape == (500, WINDOW) and windows.dtype == np.float32
    real = np.lib.stride_tricks.sliding_window_view(telemetry.values, WINDOW)
    assert windows.std(axis=1).mean() == pytest.approx(real.std(axis=1).mean(), rel=0.05)
    assert windows.mean(axis=1).std() == pytest.approx(real.mean(axis=1).std(), rel=0.15)
    np.testing.assert_array_equal(windows, simulator.generate(500, 3))
    assert (windows != simulator.generate(500, 4)).any()
