"""The parts of a simulator are made again from what is saved of them, and nothing else is made."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.coarse.runs import Runs
from enhsim_tf.coarse.square_waves import ConstantLevel, SquareWave, SquareWaveSimulator
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.enhancer.candidates import Training
from enhsim_tf.enhancer.names import COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_FEATURES
from enhsim_tf.noise.registry import NOISES, noise_model
from enhsim_tf.simulator.packing import packed, unpacked
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Part
from tests.known_simulators import parts_of

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
def test_every_noise_model_keeps_the_contract(name):
    check_noise_model(name)


def check_noise_model(name):
    """It generates finite float32 noise of the shape of the signal, the same with the same seed,
    also after it was saved and loaded.
    """
    model = noise_model(name).fit(WINDOWS, CLEAN)
    for number, signal, draw in (
        (6, CLEAN[:6], "generate"),
        (90, np.zeros((90, 2), np.float32), "generate_series"),
    ):
        first, second, saved, other = (
            getattr(each, draw)(number, np.random.default_rng(seed), signal)
            for each, seed in ((model, 1), (model, 1), (again(model), 1), (model, 2))
        )
        assert first.shape == signal.shape and first.dtype == np.float32
        assert np.isfinite(first).all() and first.std() < 3
        np.testing.assert_array_equal(first, second)
        np.testing.assert_array_equal(first, saved)
        assert name == "none" or (first != other).any()


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
    assert (made.channels, made.interval_s, made.window) == (("a",), 2.0, 40)
    assert made.waveforms == (None,) and made.levels is None
    np.testing.assert_array_equal(made.simulators[0].simulate(times), part.simulate(times))
    assert made.simulators[0].waves == part.waves and made.simulators[0].levels == part.levels


def test_saved_runs_are_the_same():
    parts = Part(WINDOWS[0]), Part(WINDOWS[1], 90.0)
    recording = parts_of(parts, ("a", "b"), 2.0, "2024-01-01T00:00:00+00:00", "a box")
    made = again(Runs(recording, ["volts"], 40, 3.0))
    assert (made.window, made.delay_s) == (40, 3.0)
    assert (made.columns, made.nominal.name) == (("a", "b"), "a box")
    assert made.nominal.start == recording.start
    for part, expected in zip(made.nominal.parts, recording.parts, strict=True):
        assert part.offset_s == expected.offset_s
        np.testing.assert_array_equal(part.values, expected.values)


def test_saved_levels_are_the_same():
    assert again(Levels(0.5, 1.0, 3)) == Levels(0.5, 1.0, 3)


def test_a_part_of_an_unknown_kind_is_not_saved(refused):
    with refused("SimpleNamespace as noise", "not saved"):
        packed(SimpleNamespace(), {}, "noise")


def test_no_other_kinds_are_made(refused):
    with refused("'SimpleNamespace'", "Fit it again"):
        unpacked({"class": "SimpleNamespace"}, {})
