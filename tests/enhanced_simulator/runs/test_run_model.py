"""Run models: a known map is recovered, runs have no seams, and what is saved is what is loaded."""

import dataclasses
import json

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.interface import FunctionSimulator
from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.runs import fitting
from enhsim_tf.enhanced_simulator.runs.fitting import fit_run_model, split_pairs
from enhsim_tf.enhanced_simulator.runs.model import RunModel
from enhsim_tf.enhanced_simulator.runs.options import RunOptions
from enhsim_tf.enhanced_simulator.runs.scoring import score_run
from enhsim_tf.enhanced_simulator.saving import check_saved
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhanced_simulator.training import TrainingSettings
from enhsim_tf.enhancer.ladder import COARSE, LEVEL_AND_GAIN, RIDGE
from enhsim_tf.noise.names import BEST
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
START = "2024-01-01T00:00:00+00:00"
WINDOW, NOISE_SD = 32, 0.1
FAST = RunOptions(window=WINDOW, num_windows=300, noise="residual windows", epochs=1)


@pytest.fixture(scope="module", autouse=True)
def cheap_rungs():
    """Judges only the rungs without networks, which the tests of the ladder cover."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "RUNGS", (COARSE, LEVEL_AND_GAIN, RIDGE))
        yield


def coarse_run(num_samples=3_000, seed=0):
    """Two columns that do not repeat, at very different scales."""
    rng = np.random.default_rng(seed)
    smooth = np.stack([np.convolve(each, np.hanning(12), "same") for each in rng.standard_normal((2, num_samples))], axis=1)
    return (smooth / smooth.std(axis=0) * [1.0, 1e3] + [4.0, 0.0]).astype(np.float32)


def truth(run):
    """The vehicle: a linear filter of both columns."""
    return 3 * np.convolve(run[:, 0] - 4, [0.2, 0.6, 0.2], "same") + 1e-3 * np.roll(run[:, 1], 2)


def recording(values, **fields):
    return Recording((Run(values),), ("volts", "watts"), **{"interval_s": 10.0, "start": START, "name": "run.csv"} | fields)


def telemetry(values, seed=1, **fields):
    noise = NOISE_SD * np.random.default_rng(seed).standard_normal(len(values))
    return Telemetry((truth(values) + noise).astype(np.float32), **{"interval_s": 10.0, "start": START, "name": "celsius"} | fields)


@pytest.fixture(scope="module")
def fitted():
    run = coarse_run()
    return fit_run_model(telemetry(run), recording(run), FAST)


# the fit


def test_a_known_filter_is_recovered(fitted):
    model, report = fitted
    fresh = coarse_run(600, seed=7)
    inner = slice(5, -5)  # the filter has no neighbours at the ends
    error = np.sqrt(np.mean((model.enhance(fresh) - truth(fresh))[inner] ** 2))
    assert model.rung.name == report.chosen == RIDGE and error < 0.5 * NOISE_SD
    assert report.nrmse["enhanced"] < 0.2 * report.nrmse["coarse"] and model.delay_s == 0


def generated_sd(model):
    return float(np.std(model.noise.generate(2_000, np.random.default_rng(0))))


def test_the_noise_is_measured_on_time_that_the_enhancer_has_not_learnt(fitted):
    model, report = fitted
    for scale in (generated_sd(model), report.noise["real"]["sd"]):  # with the enhancer's own error; residuals of the training are smaller
        assert NOISE_SD < scale < 1.2 * NOISE_SD
    assert abs(report.noise["real"]["lag_1"]) < 0.1


def test_the_report_is_plain_json_and_agrees_with_the_ladder(fitted):
    _, report = fitted
    plain = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert [each["name"] for each in plain["ladder"]] == [COARSE, LEVEL_AND_GAIN, RIDGE]
    assert f"ridge {plain['ladder'][2]['error']:.4f}" in plain["verdict"][0] and "simplest within" in plain["verdict"][0]
    assert report.is_held_out and report.num_samples == 600 and any("delay: none found" in line for line in report.lines())


def test_the_held_out_end_does_not_affect_the_model(fitted):
    run = coarse_run()
    changed = dataclasses.replace(telemetry(run), values=np.where(np.arange(3_000) < 2_400, telemetry(run).values, 1e6).astype(np.float32))
    model, _ = fit_run_model(changed, recording(run), dataclasses.replace(FAST, delay_s=0.0))
    fresh = coarse_run(200, seed=7)
    np.testing.assert_array_equal(model.enhance(fresh), fitted[0].enhance(fresh))
    np.testing.assert_array_equal(model.generate(5, seed=1), fitted[0].generate(5, seed=1))


def test_a_delay_is_found_and_reported(fitted):
    run = coarse_run()
    late = dataclasses.replace(telemetry(run), offset_s=150.0)
    model, report = fit_run_model(late, recording(run), FAST)
    assert model.delay_s == 150 and any("150 s (15 samples) later than" in note for note in report.notes)
    _, given = fit_run_model(late, recording(run), dataclasses.replace(FAST, delay_s=150.0))
    assert any("as given" in note for note in given.notes)


def test_a_rung_may_be_asked_for():
    run = coarse_run()
    model, report = fit_run_model(telemetry(run), recording(run), dataclasses.replace(FAST, enhancer=LEVEL_AND_GAIN))
    assert model.rung.name == LEVEL_AND_GAIN and report.was_asked and "as asked for" in report.verdict[0]


def test_constant_columns_are_left_out_and_reported():
    run = coarse_run()
    values = np.stack([np.full(3_000, 5, np.float32), *run.T], axis=1)
    wide = dataclasses.replace(recording(run), parts=(Run(values),), columns=("mode", "volts", "watts"))
    model, report = fit_run_model(telemetry(run), wide, FAST)
    assert model.columns == ("volts", "watts") and any("never vary: mode" in note for note in report.notes)


def test_gaps_in_either_series_are_respected():
    run = coarse_run()
    whole = telemetry(run)
    gappy = dataclasses.replace(recording(run), parts=(Run(run[:1_400]), Run(run[1_450:], 14_500.0)))
    model, report = fit_run_model([whole.part(0, 800), whole.part(830, 3_000)], gappy, FAST)
    assert len(model.nominal.parts) == 3 and any("2,920 of 2,970" in note for note in report.notes)
    fresh = coarse_run(200, seed=7)
    assert np.sqrt(np.mean((model.enhance(fresh) - truth(fresh))[5:-5] ** 2)) < 0.5 * NOISE_SD


def test_pairs_are_split_by_time():
    class Part:
        def __init__(self, length):
            self.length = length

        def __len__(self):
            return self.length

        def part(self, start, stop):
            return start, stop

    assert split_pairs([Part(10), Part(10)], 0.25) == ([(0, 10), (0, 5)], [(5, 10)])


# runs


def test_copies_differ_in_their_noise_only(fitted):
    model, _ = fitted
    run = recording(coarse_run(500, seed=3))
    copies = np.stack([copy for (copy,) in model.generate_copies(run, 60, seed=2)])
    clean = model.enhance(run.parts[0].values)
    assert (copies - clean).std() == pytest.approx(generated_sd(model), rel=0.05)
    assert np.abs((copies - clean).mean(axis=0)).max() < 5 * NOISE_SD / np.sqrt(60)
    (again,), (first,) = next(model.generate_copies(run, 1, seed=2)), next(model.generate_copies(run, 60, seed=2))
    np.testing.assert_array_equal(again, first)


def test_the_noise_of_a_copy_has_the_same_scale_everywhere(fitted):
    model, _ = fitted
    run = recording(coarse_run(150, seed=3))
    copies = np.stack([copy for (copy,) in model.generate_copies(run, 2_500, seed=2)]) - model.enhance(run.parts[0].values)
    scale = copies.std(axis=0)
    assert np.abs(scale / scale.mean() - 1).max() < 0.08  # more than five standard errors of 2,500 draws
    steps = np.diff(copies, axis=1).std(axis=0)
    assert np.abs(steps / steps.mean() - 1).max() < 0.1  # and no steps where two windows meet


def test_without_held_out_telemetry_the_report_says_so():
    run = coarse_run(1_500)
    _, report = fit_run_model(telemetry(run), recording(run), dataclasses.replace(FAST, held_out=0.0))
    assert not report.is_held_out and report.num_samples == 1_500 and "none was held out" in report.verdict[1]


def test_columns_may_be_in_any_order_and_further_ones_are_ignored(fitted):
    model, _ = fitted
    values = coarse_run(200, seed=3)
    other = Recording((Run(np.stack([values[:, 1], np.zeros(200, np.float32), values[:, 0]], 1)),), ("watts", "mode", "volts"), 10.0, START)
    (one,), (swapped,) = (next(model.generate_copies(run, 1)) for run in (recording(values), other))
    np.testing.assert_array_equal(one, swapped)


def test_unusable_runs_are_refused(refused, fitted):
    model, _ = fitted
    with refused("without 'watts'"):
        model.usable(Recording((Run(coarse_run(200)[:, :1]),), ("volts",), 10.0, START))
    with refused("every 10 s", "every 5 s"):
        model.usable(recording(coarse_run(200), interval_s=5.0))
    with refused("at least one window of 32 samples", "31"):
        model.usable(recording(coarse_run(31)))
    with refused("(samples, 2)"):
        model.enhance(coarse_run(200)[:, :1])


def test_the_range_covers_what_is_like_the_training_and_nothing_else(fitted):
    model, report = fitted
    assert np.mean(model.coverage.score(coarse_run(2_000, seed=11)) > 1) < 0.1 and report.outside < 0.1
    far = coarse_run(300, seed=11)
    far[100:200, 1] += 8e3
    outside = model.coverage.score(far) > 1
    assert outside[110:190].all() and not outside[:60].any()


# nominal windows and series


def test_nominal_windows_and_series_come_from_the_saved_run(fitted):
    model, _ = fitted
    assert model.generate(7, seed=1).shape == (7, WINDOW) and model.generate(0).shape == (0, WINDOW)
    np.testing.assert_array_equal(model.generate(7, seed=1), model.generate(7, seed=1))
    series = model.generate_series(6_000, seed=1)  # longer than the run of 2,400 samples
    clean = truth(coarse_run()[:2_400])
    assert series.shape == (6_000,) and np.sqrt(np.mean((series[:2_300] - clean[:2_300]) ** 2)) < 1.5 * NOISE_SD
    assert series.std() == pytest.approx(np.hypot(clean.std(), NOISE_SD), rel=0.05)
    assert np.abs(np.diff(series)).max() < 2 * np.abs(np.diff(series[:2_300])).max()


def test_a_recording_has_no_degraded_modes(refused, fitted):
    for generate in (fitted[0].generate, fitted[0].generate_series):
        with refused("--coarse fault_run.csv"):
            generate(5, "stuck")


# saving


def test_what_is_saved_is_what_is_loaded(fitted, tmp_path):
    model, _ = fitted
    model.save(tmp_path / "model")
    loaded = RunModel.load(tmp_path / "model")
    run = recording(coarse_run(300, seed=3))
    for one, other in zip(model.generate_copies(run, 2, seed=5), loaded.generate_copies(run, 2, seed=5), strict=True):
        np.testing.assert_array_equal(one[0], other[0])
    np.testing.assert_array_equal(model.generate(3, seed=1), loaded.generate(3, seed=1))
    np.testing.assert_array_equal(model.coverage.score(run.parts[0].values), loaded.coverage.score(run.parts[0].values))
    assert (loaded.columns, loaded.delay_s, loaded.trained) == (model.columns, model.delay_s, json.loads(json.dumps(model.trained)))


def test_models_of_the_two_kinds_are_not_confused(refused, fitted, tmp_path):
    fitted[0].save(tmp_path / "model")
    with refused("a simulator of square waves", "a model of recorded runs"):
        EnhancedSimulator.load(tmp_path / "model")
    with refused("--windows"):
        check_saved(tmp_path / "model")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("window", lambda settings: settings | {"window": 31}),
        ("columns", lambda settings: settings | {"columns": ["volts"]}),
        ("limit", lambda settings: settings | {"limit": -1.0}),
        ("nominal", lambda settings: settings | {"nominal": {"start": None, "offsets_s": [0.0, 1.0]}}),
        ("trained", lambda settings: settings | {"trained": []}),
    ],
)
def test_damaged_settings_are_refused(refused, fitted, tmp_path, name, change):
    from enhsim_tf.common.atomic_files import sha256

    fitted[0].save(tmp_path / "model")
    path, manifest = tmp_path / "model" / "settings.json", tmp_path / "model" / "manifest.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    content = json.loads(manifest.read_text())
    content["sha256"]["settings.json"] = sha256(path)
    manifest.write_text(json.dumps(content))
    with refused("arrays and settings of a model"):
        RunModel.load(tmp_path / "model")


# simulators of the user's own


def heater(time_s, scenario=None):
    power = np.sin(time_s / 300) + np.sin(time_s / 77) * np.sin(time_s / 911)
    return (0.5 if scenario == "weak" else 1.0) * power


def test_a_simulator_is_run_at_the_times_of_the_telemetry_and_given_again(refused, tmp_path):
    times = 10.0 * np.arange(2_000)
    noise = 0.05 * np.random.default_rng(0).standard_normal(2_000)
    measured = Telemetry((2 + 3 * heater(times) + noise).astype(np.float32), 10.0, 0.0, START, "celsius")
    simulator = FunctionSimulator(heater, ["power"])
    model, report = fit_run_model(measured, simulator, FAST)
    assert model.rung.name in (LEVEL_AND_GAIN, RIDGE) and any("simulated at the times" in note for note in report.notes)
    weak = model.simulate(times[:300], "weak", labels={"scenario": "weak"})
    (copy,) = next(model.generate_copies(weak, 1))
    assert np.sqrt(np.mean((copy - 2 - 1.5 * heater(times[:300])) ** 2)) < 0.1
    model.save(tmp_path / "model")
    loaded = RunModel.load(tmp_path / "model")
    with refused("heater", "not saved with the model", "coarse=simulator"):
        loaded.simulate(times[:300], "weak")
    again = RunModel.load(tmp_path / "model", coarse=simulator).simulate(times[:300], "weak")
    np.testing.assert_array_equal(again.parts[0].values, weak.parts[0].values)
    with refused("columns power"):
        RunModel.load(tmp_path / "model", coarse=FunctionSimulator(heater, ["watts"]))


def test_square_waves_are_saved_with_the_model(tmp_path):
    waves = SquareWaveSimulator([SquareWave(700, low=0, high=2)])
    times = 10.0 * np.arange(2_000)
    values = np.convolve(waves(times), np.ones(5) / 5, "same") + 0.05 * np.random.default_rng(0).standard_normal(2_000)
    model, _ = fit_run_model(Telemetry(values.astype(np.float32), 10.0, 0.0, START, "amps"), waves, FAST)
    model.save(tmp_path / "model")
    loaded = RunModel.load(tmp_path / "model")
    np.testing.assert_array_equal(loaded.simulate(times[:100]).parts[0].values, model.simulate(times[:100]).parts[0].values)


def test_a_simulator_that_cannot_be_saved_is_named_before_the_long_training(refused):
    with refused("fit_run_model", "FunctionSimulator"):
        EnhancedSimulator.fit(telemetry(coarse_run()), FunctionSimulator(heater, ["power"]), window=64, follow=True)


# scores


def test_a_fault_is_found_in_the_difference_and_false_alarms_are_as_set(fitted):
    model, _ = fitted
    run = coarse_run(4_000, seed=21)
    measured = telemetry(run, seed=22).values.copy()
    measured[3_000:] += 4 * NOISE_SD * (np.arange(1_000) > 0)  # small against the signal, whose deviation is 3
    frame = score_run(model, [Telemetry(measured, 10.0, 0.0, START, "celsius")], recording(run), ScoreOptions("limit check", 500, 0.01))
    assert frame["flag"].iloc[:2_900].mean() < 0.05 and frame["flag"].iloc[3_032:].mean() > 0.95
    assert frame["score"].notna().all() and np.corrcoef(frame["enhanced"], truth(run))[0, 1] > 0.99


def test_telemetry_without_a_run_is_not_scored(refused, fitted):
    model, _ = fitted
    run = coarse_run(1_000, seed=21)
    frame = score_run(model, [telemetry(run)], recording(run[:600]), ScoreOptions("limit check", 100))
    assert frame["score"].notna().to_numpy().tolist() == [True] * 600 + [False] * 400 and not frame["flag"].iloc[600:].any()
    with refused("every 10 s", "every 5 s"):
        score_run(model, [telemetry(run, interval_s=5.0)], recording(run))
    with refused("overlaps the telemetry in time"):
        score_run(model, [telemetry(run, start="2025-01-01T00:00:00+00:00")], recording(run))


# options


@pytest.mark.parametrize(
    "options",
    [
        {"held_out": 0.6},
        {"window": 31},
        {"num_windows": 9},
        {"epochs": 0},
        {"noise": "pink"},
        {"enhancer": "magic"},
        {"delay_s": float("nan")},
    ],
)
def test_options_out_of_range_are_refused(refused, options):
    with refused(next(iter(options)).split("_")[0]):
        RunOptions(**options)


def test_the_noise_model_is_chosen_unless_one_is_named():
    assert RunOptions().noise == FitOptions().noise == TrainingSettings().noise == BEST


def test_too_little_shared_time_is_refused(refused):
    run = coarse_run(300)
    with refused("8 windows of 64 samples"):
        fit_run_model(telemetry(run), recording(run), dataclasses.replace(FAST, window=64))


def test_constant_input_is_refused(refused):
    run = coarse_run()
    with refused("values that vary"):
        fit_run_model(dataclasses.replace(telemetry(run), values=np.ones(3_000, np.float32)), recording(run), FAST)
    with refused("coarse column that varies"):
        fit_run_model(telemetry(run), recording(np.ones_like(run)), dataclasses.replace(FAST, delay_s=0.0))
