"""The parts of a simulator are made again from what is saved of them, and nothing else is made."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import ConstantLevel, SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.candidates import Training
from enhsim_tf.enhancer.names import COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_FEATURES
from enhsim_tf.noise.names import NOISES
from enhsim_tf.noise.window_bootstrap import fit_noise
from enhsim_tf.simulator.alignment import Runs, Waves
from enhsim_tf.simulator.packing import packed, unpacked
from enhsim_tf.telemetry.quantisation import Levels

WINDOWS = np.random.default_rng(0).standard_normal((30, 40, 2)).astype(np.float32)
CLEAN = np.sin(np.arange(40) / 5).astype(np.float32)[:, None] * np.ones((30, 1, 2), np.float32)


def again(part):
    """A part as it is after it was saved and loaded."""
    arrays = {}
    state = packed(part, arrays, "part")
    made = unpacked(json.loads(json.dumps(state)), arrays)
    assert type(made) is type(part)
    return made


@pytest.mark.parametrize("name", NOISES)
def test_a_saved_noise_model_generates_the_same_noise(name):
    model = fit_noise(name, WINDOWS, CLEAN)
    for number, signal, draw in (
        (6, CLEAN[:6], "generate"),
        (90, np.zeros((90, 2)), "generate_series"),
    ):
        first, second = (
            getattr(each, draw)(number, np.random.default_rng(1), signal)
            for each in (model, again(model))
        )
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("name", [COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_FEATURES])
def test_a_saved_enhancer_predicts_the_same(name):
    enhancer = Training(CLEAN + WINDOWS, WINDOWS**2, 40 * np.arange(30)).fit(name)
    made = again(enhancer)
    assert (made.name, made.window, made.columns, made.channels) == (name, 40, 2, 2)
    np.testing.assert_array_equal(made.predict(CLEAN), enhancer.predict(CLEAN))


@pytest.mark.parametrize(
    "part",
    [SquareWaveSimulator([SquareWave(9.0, 0.1, 0.3, -2.0, 3.0)] * 2), ConstantLevel(2.0, 0.5, 7.0)],
)
def test_saved_waves_and_levels_are_the_same(part):
    times = np.arange(30.0)[None]
    made = again(Waves([part], ["a"], 2.0, 40, [None]))
    assert (made.channels, made.interval_s, made.window, made.waveforms) == (
        ("a",),
        2.0,
        40,
        (None,),
    )
    np.testing.assert_array_equal(made.simulators[0].simulate(times), part.simulate(times))
    assert made.simulators[0].waves == part.waves and made.simulators[0].levels == part.levels


def test_saved_runs_are_the_same():
    recording = Recording(
        (Run(WINDOWS[0]), Run(WINDOWS[1], 90.0)),
        ("a", "b"),
        2.0,
        "2024-01-01T00:00:00+00:00",
        "a box",
    )
    made = again(Runs(recording, 40, 3.0, "a heater", CommandTraces([(2, 8.0)])))
    assert (made.window, made.delay_s, made.name, made.commands.chosen) == (
        40,
        3.0,
        "a heater",
        ((2, 8.0),),
    )
    assert (made.columns, made.nominal.start, made.nominal.name) == (
        ("a", "b"),
        recording.start,
        "a box",
    )
    for part, expected in zip(made.nominal.parts, recording.parts, strict=True):
        assert part.offset_s == expected.offset_s
        np.testing.assert_array_equal(part.values, expected.values)


def test_saved_levels_are_the_same():
    assert again(Levels(0.5, 1.0, 3)) == Levels(0.5, 1.0, 3)


def test_a_part_of_an_unknown_kind_is_not_saved(refused):
    with refused("SimpleNamespace as noise", "not saved"):
        packed(SimpleNamespace(), {}, "noise")


def test_no_other_kinds_are_made():
    with pytest.raises(KeyError):
        unpacked({"kind": "SimpleNamespace"}, {})
