"""The choice of the enhancer for square waves: a linear channel gets ridge regression, and the model is saved as before."""

import json

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator import choosing
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.ladder import COARSE, LEVEL_AND_GAIN, NETWORK, RIDGE, RIDGE_AND_NETWORK
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
WAVES = SquareWaveSimulator([SquareWave(40.0, low=17.0, high=23.0)])


def channel(num_samples=2_000):
    """A square wave through a filter, with white noise; its level drifts."""
    places = np.arange(num_samples)
    smooth = np.convolve(WAVES(np.arange(-20.0, num_samples + 20.0)), np.hanning(15) / np.hanning(15).sum(), "same")[20:-20]
    return Telemetry(
        (smooth + 0.001 * places + 0.2 * np.random.default_rng(0).standard_normal(num_samples)).astype(np.float32), name="volts"
    )


def fit(**options):
    settings = {"num_windows": 200, "window": 64, "epochs": 1, "noise": "none", "follow": True, "verbose": 0}
    return EnhancedSimulator.fit(channel(), WAVES, **settings | options)


@pytest.fixture(scope="module")
def fitted():
    return fit(enhancer="best")


def test_a_filtered_wave_gets_ridge_regression(fitted):
    ladder = {each["name"]: each for each in fitted.trained["ladder"]}
    assert list(ladder) == [COARSE, RIDGE, RIDGE_AND_NETWORK, NETWORK]  # aligned windows have their level and gain already
    assert [name for name, each in ladder.items() if each["is_chosen"]] == [RIDGE]
    assert ladder[RIDGE]["error"] < 0.5 * ladder[COARSE]["error"]
    pairs = fitted.pairs(channel(), np.arange(0, 1_900, 50))
    assert np.std(pairs.target - fitted.follow(pairs)) == pytest.approx(0.2, rel=0.1)


def test_the_model_is_saved_in_the_form_of_square_waves(fitted, tmp_path):
    fitted.save(tmp_path / "model")
    assert json.loads((tmp_path / "model" / "manifest.json").read_text())["format"] == "enhsim_tf.EnhancedSimulator/2"
    loaded = EnhancedSimulator.load(tmp_path / "model")
    np.testing.assert_array_equal(loaded.generate(5, seed=1), fitted.generate(5, seed=1))
    assert loaded.trained["ladder"] == fitted.trained["ladder"]


def test_a_rung_may_be_asked_for_and_is_saved(tmp_path):
    simulator = fit(enhancer=RIDGE_AND_NETWORK)
    assert [each["name"] for each in simulator.trained["ladder"] if each["is_chosen"]] == [RIDGE_AND_NETWORK]
    simulator.save(tmp_path / "model")
    np.testing.assert_array_equal(EnhancedSimulator.load(tmp_path / "model").generate(5), simulator.generate(5))


def test_a_fixed_simulator_is_judged_with_level_and_gain(monkeypatch):
    monkeypatch.setattr(choosing, "RUNGS", (COARSE, LEVEL_AND_GAIN, RIDGE))
    assert [each["name"] for each in fit(enhancer="best", follow=False).trained["ladder"]] == [COARSE, LEVEL_AND_GAIN, RIDGE]


def test_the_papers_network_is_trained_as_before_without_a_choice():
    simulator = fit()
    assert "ladder" not in simulator.trained and "enhancer" not in simulator.trained


def test_an_unknown_enhancer_is_refused(refused):
    with refused("ridge and network", "'level and gain'"):
        FitOptions(enhancer="level and gain")
