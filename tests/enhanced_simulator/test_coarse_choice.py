"""The coarse simulator that a channel gets: square waves, commands, or a constant level, and what the report says of it."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.coarse_simulator.commands import HELD, CommandTraces
from enhsim_tf.coarse_simulator.constant_level import ConstantLevel, waves_or_level
from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator import fitting, report_measure
from enhsim_tf.enhanced_simulator.coarse_choice import COMMANDS, LEVEL, SQUARE_WAVES, choose_coarse
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.fitting import fit_channel
from enhsim_tf.enhanced_simulator.runs.commands import is_of_commands, recording_of
from enhsim_tf.enhanced_simulator.runs.model import RunModel
from enhsim_tf.enhanced_simulator.runs.scoring import score_run
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.training_pairs import cut_pairs
from enhsim_tf.telemetry.commands import has_commands, read_commands
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import read_source

TINY = FitOptions(num_windows=60, epochs=1, seed=3, enhancer="best", noise="residual windows")
RNG = np.random.default_rng(0)
T = np.arange(4_308)


def noise(size, sd=0.05, seed=0):
    return sd * np.random.default_rng(seed).standard_normal(size)


def commands_of(size, seed=0, number=24):
    """One-hot commands, as in the published arrays; the last ones are never sent."""
    found = (np.random.default_rng(seed).random((size, number)) < 0.02).astype(np.float32)
    found[:, -6:] = 0
    return found


def switched(commands):
    """A state that command 1 switches on and command 2 off."""
    state, values = 0.0, []
    for on, off in commands[:, :2]:
        state = 1.0 if on else 0.0 if off else state
        values.append(state)
    return np.array(values)


def telemetry(values, name="volts"):
    return Telemetry(np.asarray(values, np.float32), name=name)


STAND_INS = {
    "period longer than the record": (np.sin(2 * np.pi * T[:2_800] / 4_000) + noise(2_800), LEVEL),
    "trend": (T[:2_800] / 2_800 + noise(2_800), LEVEL),
    "random walk": (np.cumsum(noise(2_800)), LEVEL),
    "shortest record": (np.sin(2 * np.pi * T[:312] / 40) + noise(312), SQUARE_WAVES),
    "shortest record of noise": (noise(312), LEVEL),
    "700 samples": (np.sin(2 * np.pi * T[:700] / 97) + noise(700), SQUARE_WAVES),
    "2,300 samples of a long period": (np.sin(2 * np.pi * T[:2_300] / 162) + noise(2_300), SQUARE_WAVES),
    "two values, sent on change": (np.repeat(np.random.default_rng(4).random(20) < 0.5, 140).astype(float), None),
    "nearly constant with rare steps": (np.where((T[:2_158] > 900) & (T[:2_158] < 960), 1.0, 0.0), LEVEL),
    "one sample differs": (np.where(T[:2_200] == 700, 1.0, -1.0), None),
    "quantised walk": (np.round(np.cumsum(noise(2_690)), 1), LEVEL),
    "white noise": (noise(2_000), LEVEL),
    "mixture of a wave and a walk": (0.2 * np.sin(2 * np.pi * T / 120) + np.cumsum(noise(4_308, 0.02)), LEVEL),
    "saturated walk": (np.clip(np.cumsum(noise(2_800, 0.2)), -1, 1), None),
}


@pytest.mark.parametrize("name", STAND_INS)
def test_each_kind_of_channel_gets_a_coarse_simulator_that_fits_into_its_record(name):
    values, kind = STAND_INS[name]
    choice = choose_coarse([telemetry(values)])
    assert kind is None or choice.kind == kind
    assert 32 <= choice.window <= 500 and 8 * choice.window <= len(values)
    assert choice.said.startswith("coarse simulator: ") and "\n" not in choice.said
    assert isinstance(choice.coarse, ConstantLevel) is (choice.kind == LEVEL)
    if choice.kind == LEVEL:
        assert "knows no shape" in choice.said and "its file has no commands" in choice.said


def test_a_channel_that_was_accepted_before_keeps_its_wave_and_window():
    values = telemetry(np.sin(2 * np.pi * T[:2_800] / 90.5) + noise(2_800))
    choice = choose_coarse([values])
    assert choice.kind == SQUARE_WAVES and choice.window == 181
    assert choice.coarse.get_config() == SquareWaveSimulator.fit(values).get_config()


def test_commands_are_used_if_they_explain_more_than_a_wave():
    commands = commands_of(2_600)
    values = switched(commands)
    choice = choose_coarse([telemetry(values)], None, commands)
    assert choice.kind == COMMANDS and {1, 2} <= {number for number, _ in choice.traces.chosen}
    assert "commands, which explain" in choice.said
    # commands that have nothing to do with the channel, or that were never sent
    kinds = []
    for seed in range(10):
        choice = choose_coarse([telemetry(np.cumsum(noise(1_300, seed=seed)))], None, commands_of(1_300, seed=100 + seed))
        kinds.append(choice.kind)
        assert choice.kind != LEVEL or "commands explain no more" in choice.said
    assert kinds.count(COMMANDS) <= 1
    unsent = choose_coarse([telemetry(noise(2_600))], None, np.zeros((2_600, 54), np.float32))
    assert unsent.kind == LEVEL and "no command was sent" in unsent.said
    # a wave that explains more than the commands
    wave = choose_coarse([telemetry(np.sin(2 * np.pi * T[:2_600] / 90))], None, commands)
    assert wave.kind == SQUARE_WAVES


def test_commands_after_which_the_telemetry_jumps_become_states():
    commands = commands_of(1_800, number=54)
    values = switched(commands)
    found = CommandTraces.fit(values, commands)
    assert {(1, HELD), (2, HELD)} <= set(found.chosen) and found.columns[0] == "command 1, until another"
    held = CommandTraces([(1, HELD), (2, HELD)])
    np.testing.assert_array_equal(held.traces(commands)[:, 0], values)  # on, until off
    first = np.flatnonzero(commands[:, :2].any(axis=1))[0]
    assert not held.traces(commands)[:first].any()
    choice = choose_coarse([telemetry(values + noise(1_800))], None, commands)
    assert choice.kind == COMMANDS and "explain 9" in choice.said


def test_a_trace_is_an_exponential_decay_after_each_command():
    commands = np.zeros((200, 3), np.float32)
    commands[[50, 60], 1] = 1
    found = CommandTraces([(2, 8.0), (2, 0.0)])
    expected = np.where(T[:200] >= 50, np.exp(-(T[:200] - 50) / 8), 0) + np.where(T[:200] >= 60, np.exp(-(T[:200] - 60) / 8), 0)
    np.testing.assert_allclose(found.traces(commands)[:, 0], expected, atol=1e-6)
    np.testing.assert_array_equal(found.traces(commands)[:, 1], commands[:, 1])
    assert found.columns == ("command 2, decay 8", "command 2")
    assert CommandTraces.from_config(found.get_config()).chosen == found.chosen


@pytest.mark.parametrize(
    ("values", "word"),
    [(np.full(3_000, -1.0), "constant"), (noise(255), "256 samples"), (np.zeros(0), "256 samples")],
    ids=["constant", "short", "empty"],
)
def test_what_no_one_can_use_is_refused_in_one_line(refused, values, word):
    with refused(word, "volts"):
        choose_coarse([telemetry(values) if len(values) else telemetry([1.0, 2.0])])


def test_parts_shorter_than_a_window_do_not_count():
    values = np.sin(2 * np.pi * T / 100) + noise(len(T))
    whole = telemetry(values)
    parts = [whole.part(0, 150), whole.part(200, 1_200), whole.part(1_300, 1_900)]
    choice = choose_coarse(parts)
    assert choice.kind == SQUARE_WAVES and choice.window == 200
    shorter = choose_coarse([whole.part(0, 150), whole.part(200, 1_000)])  # eight windows of 200 samples do not fit
    assert shorter.window == 100 + 18  # (150 + 800) // 8


# the constant level


def test_a_constant_level_follows_the_mean_of_each_window():
    coarse = ConstantLevel(level=5.0, spread=2.0)
    values = 5 + np.cumsum(noise(1_000))
    pairs = cut_pairs([telemetry(values)], coarse, np.array([0, 400, 900]), 64, follow=True)
    np.testing.assert_allclose(pairs.shift, [values[s : s + 64].mean() - 5 for s in (0, 400, 900)], atol=1e-5)
    np.testing.assert_array_equal(pairs.gain, 1.0)
    assert waves_or_level(coarse.get_config()).get_config() == coarse.get_config()


@pytest.mark.parametrize(
    ("mode", "changes"), [("drift", True), ("dropout", True), ("stuck", False), ("gain_loss", False), ("friction", False)]
)
def test_only_modes_of_the_sensor_change_a_constant_level(mode, changes):
    coarse, times = ConstantLevel(5.0, 2.0), np.arange(200.0)[None]
    windows = coarse.simulate(times, Degraded(mode, 1.0), np.random.default_rng(0))
    assert (windows != coarse.simulate(times)).any() == changes


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    """A simulator with a constant level, saved and loaded again, and its report."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report_measure, "_NUM_WINDOWS", 100)
        simulator, report = fit_channel([telemetry(20 + np.cumsum(noise(1_500, 0.1)))], TINY, 0)
    folder = tmp_path_factory.mktemp("level")
    simulator.save(folder)
    return simulator, report, EnhancedSimulator.load(folder)


def test_a_simulator_without_a_shape_generates_around_levels_of_the_record(level):
    simulator, report, loaded = level
    assert simulator.trained["coarse"]["kind"] == LEVEL and report.lines()[0].startswith(
        "volts: coarse simulator: none, only a constant level"
    )
    assert np.isnan(report.period_s) and report.to_dict()["period_s"] is None and ", period" not in report.lines()[1]
    windows = simulator.generate(50, seed=1)
    np.testing.assert_array_equal(loaded.generate(50, seed=1), windows)
    np.testing.assert_array_equal(simulator.levels[:, 1], 1.0)
    clean = simulator.generate_clean(50, seed=1)
    assert (np.ptp(clean, axis=1) < 1e-4).all()  # no shape
    levels = simulator.levels[:, 0] + simulator.coarse.level
    assert clean.min() >= levels.min() - 1e-3 and clean.max() <= levels.max() + 1e-3
    masks = np.concatenate([mask for _, mask in simulator.generate_labelled_chunks(5, Degraded("drift", 1.0), seed=2)])
    assert masks.any()


def test_the_record_is_not_split_if_its_beginning_cannot_be_learnt_from(monkeypatch):
    monkeypatch.setattr(fitting, "report_on", lambda simulator, learnt, judged, is_held_out, seed: (simulator, judged, is_held_out))
    monkeypatch.setattr(EnhancedSimulator, "fit", lambda *arguments, **options: SimpleNamespace(window=options["window"], trained={}))
    late = np.where(T[:2_500] > 2_300, 1.0, -1.0) + np.where(T[:2_500] > 2_300, noise(2_500), 0)
    for values, word in ((late, "the first 80% of the record is constant"), (np.sin(T[:312] / 6), "only 312 samples")):
        simulator, (_, judged, is_held_out) = fit_channel([telemetry(values)], TINY, 0)
        assert not is_held_out and sum(map(len, judged)) == len(values)
        assert word in simulator.trained["coarse"]["said"]


def test_a_wave_from_which_nothing_can_be_learnt_gives_a_constant_level(monkeypatch):
    def fit(parts, coarse, *arguments, **options):
        if not coarse.is_constant:
            raise InputError("Expected windows that follow the coarse simulator. Received: none.")
        return SimpleNamespace(window=options["window"], trained={})

    monkeypatch.setattr(EnhancedSimulator, "fit", fit)
    simulator = fitting.fit_simulator([telemetry(np.sin(2 * np.pi * T / 100))], TINY, 0)
    assert simulator.trained["coarse"]["kind"] == LEVEL
    assert "nothing can be learnt from its best square wave (Expected windows that follow" in simulator.trained["coarse"]["said"]


# arrays with commands


@pytest.fixture(scope="module")
def array(tmp_path_factory):
    """An array in the published layout, whose channel commands switch."""
    commands = commands_of(1_800)
    path = tmp_path_factory.mktemp("array") / "S-1.npy"
    np.save(path, np.column_stack([switched(commands) + noise(1_800, 0.02), commands]))
    return path


def test_the_columns_of_commands_are_not_channels(array, tmp_path):
    series = read_source(array)
    assert list(series) == ["S-1.0"] and series["S-1.0"].attrs["findings"][0]["kind"] == "commands"
    assert list(read_source(array, ["3"])) == ["S-1.3"]  # named columns are read as before
    for columns in (None, ["0"]):
        np.testing.assert_array_equal(read_commands(array, columns), np.load(array)[:, 1:])
    assert read_commands(array, ["3"]) is None and read_commands(array, ["0", "3"]) is None, "column 3 would explain itself"
    other = np.load(array)
    other[7, 4] = 0.5
    assert has_commands(np.load(array)) and not has_commands(other) and not has_commands(other[:, :20])
    np.save(tmp_path / "plain.npy", other)
    assert len(read_source(tmp_path / "plain.npy")) == 25 and read_commands(tmp_path / "plain.npy") is None
    assert read_commands(tmp_path / "none.npy") is None


def test_a_model_of_commands_reads_them_from_the_telemetry(array, refused, tmp_path, capsys):
    values, commands = np.load(array)[:, 0], read_commands(array)
    model, report = fit_channel([telemetry(values, "S-1.0")], TINY, 0, commands=commands)
    assert isinstance(model, RunModel) and is_of_commands(model)
    assert report.lines()[0].startswith("S-1.0: coarse simulator: traces of") and report.nrmse["enhanced"] < 1
    model.save(tmp_path / "model")
    loaded = RunModel.load(tmp_path / "model")
    run = recording_of(loaded, array)
    assert run.columns == model.columns
    frame = score_run(loaded, [telemetry(values, "S-1.0")], run, ScoreOptions(num_windows=50))
    assert len(frame) == len(values) and np.isfinite(frame["score"]).all()
    np.save(tmp_path / "plain.npy", values)
    with refused("25 or 55 columns", "plain.npy"):
        recording_of(loaded, tmp_path / "plain.npy")
    # the commands score and generate
    model.save(tmp_path / "models" / "S-1.0")
    scores, copies = tmp_path / "scores.csv", tmp_path / "copies.parquet"
    assert main(["score", str(tmp_path / "models"), str(array), "--windows", "50", "--detector", "residual", "--out", str(scores)]) == 0
    assert "difference from the enhanced run" in capsys.readouterr().out and len(pd.read_csv(scores)) == len(values)
    assert main(["generate", str(tmp_path / "models"), "--coarse", str(array), "--out", str(copies)]) == 0
    assert len(pd.read_parquet(copies)) == len(values)
