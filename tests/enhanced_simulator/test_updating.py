"""Updates of a fitted simulator: known drift is recovered, the old simulator is kept, and what cannot be used is refused."""

import json
import re

import numpy as np
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.coarse_simulator.constant_level import ConstantLevel
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.backend import keras
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhanced_simulator.update_options import UpdateOptions
from enhsim_tf.enhanced_simulator.updating import update_simulator
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap
from enhsim_tf.telemetry.series import Telemetry

WINDOW, SD = 64, 0.1
WAVE = SquareWave(50, low=9, high=11)


def known(coarse=None, noise=None, levels=((0.0, 1.0), (0.05, 1.005))):
    """A simulator whose enhancer changes nothing."""
    enhancer = keras.Sequential([keras.Input((WINDOW,)), keras.layers.Dense(WINDOW)])
    enhancer.layers[0].set_weights([np.eye(WINDOW), np.zeros(WINDOW)])
    return EnhancedSimulator(
        coarse or SquareWaveSimulator([WAVE]), enhancer, noise or GaussianNoise(SD, WINDOW), 1.0, 10.0, 1.0, levels, {"seed": 0}
    )


def drifted(number=3_000, period=50.0, phase=0.0, shift=0.0, gain=1.0, sd=SD, **fields):
    values = shift + gain * SquareWave(period, phase, low=9, high=11)(np.arange(number))
    values = values + sd * np.random.default_rng(0).standard_normal(number)
    return Telemetry(values.astype(np.float32), **{"name": "volts"} | fields)


KEEP = UpdateOptions(epochs=0)


def test_known_drift_of_level_gain_period_phase_and_noise_is_recovered():
    old = known()
    new, report = update_simulator(old, drifted(period=51.5, phase=0.3, shift=2.0, gain=1.2, sd=0.25), KEEP)
    wave = new.coarse.waves[0]
    assert wave.period_s == pytest.approx(51.5, rel=1e-3) and (wave.duty, wave.low, wave.high) == (WAVE.duty, WAVE.low, WAVE.high)
    assert abs((wave.phase - 0.3 + 0.5) % 1 - 0.5) < 0.03
    assert report.before.level == pytest.approx(10.05, abs=0.06) and report.after.level == pytest.approx(2 + 1.2 * 10, abs=0.05)
    assert report.before.gain == pytest.approx(1, abs=0.01) and report.after.gain == pytest.approx(1.2, abs=0.03)
    assert report.before.noise_sd == pytest.approx(0.1, rel=0.05) and report.after.noise_sd == pytest.approx(0.25, rel=0.1)
    assert report.after.error < report.before.error and report.before.alarms > 0.9 and report.after.alarms < 0.15
    # generated telemetry has the new properties, too
    windows = new.generate(200, seed=1)
    assert windows.mean() == pytest.approx(14, abs=0.1)
    np.testing.assert_array_equal(
        update_simulator(old, drifted(period=51.5, phase=0.3, shift=2.0, gain=1.2, sd=0.25), KEEP)[0].levels, new.levels
    )


def test_nothing_changes_if_nothing_drifted():
    old = known()
    before = old.generate(5, seed=3)
    new, report = update_simulator(old, drifted(), KEEP)
    assert report.after.period_s == report.before.period_s == 50
    assert report.after.gain == pytest.approx(report.before.gain, abs=0.02) and report.after.noise_sd == pytest.approx(SD, rel=0.05)
    np.testing.assert_array_equal(old.generate(5, seed=3), before)  # the old simulator is not changed
    assert "updates" not in old.trained and new.trained["updates"][0]["telemetry"] == "volts"
    again, _ = update_simulator(new, drifted(), KEEP)
    assert len(again.trained["updates"]) == 2 and len(new.trained["updates"]) == 1


def test_the_enhancer_is_trained_further_only_if_that_reduces_the_error():
    old = known()
    old.enhancer.layers[0].set_weights([0.8 * np.eye(WINDOW), 0.1 * np.sin(np.arange(WINDOW))])  # a wrong waveform
    weights = old.enhancer.get_weights()
    new, report = update_simulator(old, drifted(), UpdateOptions(epochs=4, num_windows=400))
    assert report.after.error < report.before.error and not report.notes
    np.testing.assert_array_equal(old.enhancer.get_weights()[1], weights[1])
    kept, report = update_simulator(known(), drifted(sd=0.001), UpdateOptions(epochs=1, num_windows=50))
    np.testing.assert_array_equal(kept.enhancer.get_weights()[0], np.eye(WINDOW))
    assert any("weights are kept" in note for note in report.notes)


def test_a_wave_of_another_period_is_not_taken():
    _, report = update_simulator(known(), drifted(period=80), KEEP)
    assert report.after.period_s == 50 and any("another wave" in note for note in report.notes)


@pytest.mark.parametrize(
    "noise",
    [
        WindowBootstrap(SD * np.random.default_rng(1).standard_normal((50, WINDOW)).astype(np.float32)),
        MatchedWindowBootstrap(SD * np.random.default_rng(1).standard_normal((50, WINDOW)), np.zeros((50, min(64, WINDOW)))),
        GaussianAutoregression([0.5], SD, WINDOW),
    ],
    ids=["windows", "matched windows", "autoregression"],
)
def test_the_size_of_each_noise_model_is_updated(noise):
    old = known(noise=noise)
    before = old.noise_sd
    new, report = update_simulator(old, drifted(sd=0.4), KEEP)
    assert new.noise_sd == report.after.noise_sd == pytest.approx(0.4, rel=0.1)
    assert old.noise_sd == before and type(new.noise) is type(noise)


def test_a_constant_level_is_updated_without_a_period(tmp_path):
    values = (5 + np.cumsum(0.1 * np.random.default_rng(0).standard_normal(2_000))).astype(np.float32)
    old = known(ConstantLevel(0.0, 1.0), levels=((0.0, 1.0),))
    new, report = update_simulator(old, Telemetry(values), KEEP)
    assert report.after.period_s is None and report.after.level == pytest.approx(np.median(values[:1_600]), abs=1)
    np.testing.assert_array_equal(new.levels[:, 1], 1.0)
    assert "no period" in report.lines()[0]
    json.dumps(report.to_dict(), allow_nan=False)
    new.save(tmp_path / "level")
    np.testing.assert_array_equal(EnhancedSimulator.load(tmp_path / "level").generate(3, seed=1), new.generate(3, seed=1))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda old: (old, drifted(500)), "8 windows"),
        (lambda old: (old, drifted(interval_s=2.0)), "every 1 s"),
        (lambda old: (object(), drifted()), "--coarse"),
        (lambda old: (known(levels=None), drifted()), "levels"),
    ],
)
def test_what_cannot_be_updated_is_refused_in_one_line(refused, change, word):
    with refused(word):
        update_simulator(*change(known()), KEEP)


@pytest.mark.parametrize("options", [{"epochs": -1}, {"num_windows": 1}, {"held_out": 0.0}, {"held_out": 0.6}])
def test_options_out_of_range_are_refused(refused, options):
    with refused("held_out"):
        UpdateOptions(**options)


# the command


def test_the_command_keeps_the_old_simulator_and_says_what_changed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known().save("models/volts")
    np.savetxt("new.csv", drifted(shift=3.0).values, header="volts", comments="")
    before = {path.name: path.read_bytes() for path in (tmp_path / "models" / "volts").iterdir()}
    command = ["update", "models", "new.csv", "--time", "none", "--epochs", "0"]
    assert main(command) == 0
    said = capsys.readouterr().out
    old, new = re.search(r"level ([\d.]+) -> ([\d.]+),", said).groups()
    assert (float(old), float(new)) == pytest.approx((10.05, 13), abs=0.06) and "alarms of the residual detector" in said
    assert {path.name: path.read_bytes() for path in (tmp_path / "models" / "volts").iterdir()} == before
    updated = EnhancedSimulator.load("models-updated/volts")
    assert np.median(updated.levels[:, 0] + 10 * updated.levels[:, 1]) == pytest.approx(13, abs=0.1)
    assert json.loads((tmp_path / "models-updated" / "volts" / "report.json").read_text())["update"]["channel"] == "volts"
    for words in (command, [*command, "--out", "models"]):  # a simulator is there already
        assert main(words) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "--replace" in line
    assert main([*command, "--out", "models", "--replace"]) == 0
    assert len(EnhancedSimulator.load("models/volts").trained["updates"]) == 1


def test_a_channel_without_a_simulator_and_a_short_source_are_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known().save("models/volts")
    known().save("models/amps")
    np.savetxt("new.csv", drifted().values, header="other", comments="")
    np.savetxt("short.csv", drifted(100).values, header="volts", comments="")
    for source, word in (("new.csv", "fitted channels"), ("short.csv", "8 windows"), ("none.csv", "does not exist")):
        assert main(["update", "models", source, "--time", "none", "--out", "out"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert word in line and not list((tmp_path / "out").glob("*"))
