"""Fit and report of a channel: held-out telemetry is not used, and the sentences agree with the numbers."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.detection.anomalies import INJECTIONS
from enhsim_tf.enhanced_simulator import fitting, report_measure
from enhsim_tf.enhanced_simulator.coarse_choice import window_of
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.fitting import fit_channel
from enhsim_tf.enhanced_simulator.report import ChannelReport
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
TINY = FitOptions(window=64, num_windows=40, epochs=1, noise="residual windows", seed=3, enhancer="network")
DETECTORS = ("limit check", "PCA residual", "nearest neighbours", "isolation forest")


def channel(num_samples=2_000, seed=0, **fields):
    rng = np.random.default_rng(seed)
    values = 20 + 3 * np.sin(2 * np.pi * np.arange(num_samples) / 40) + 0.2 * rng.standard_normal(num_samples)
    return Telemetry(values.astype(np.float32), **{"name": "volts", "unit": "V"} | fields)


@pytest.fixture(scope="module")
def fitted():
    """A simulator fitted with a tiny budget, and its report, evaluated on the end of two parts."""
    whole = channel(start="2024-01-01T00:00:00+00:00", interval_s=10.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report_measure, "_NUM_WINDOWS", 100)
        return fit_channel([whole.part(0, 900), whole.part(1_000, 2_000)], TINY, verbose=0)


# the report


def test_the_fields_of_the_report(fitted):
    simulator, report = fitted
    assert simulator.window == report.window == 64
    assert (report.channel, report.unit, report.time_unit, report.is_held_out) == ("volts", "V", "s", True)
    assert report.period_s == pytest.approx(400, rel=0.01)
    assert report.num_windows == min(200, 380 - 64 + 1) and report.num_disjoint == 380 // 64  # a fifth of 1,900 samples, in one part
    assert set(report.nrmse) == {"coarse", "ridge", "nearest", "enhanced"} and all(error > 0 for error in report.nrmse.values())
    assert set(report.false_alarms) == {"generated", "real"}
    assert all(tuple(rates) == DETECTORS and all(0 <= rate <= 1 for rate in rates.values()) for rates in report.false_alarms.values())
    assert tuple(report.recall) == DETECTORS and all(set(rates) == set(INJECTIONS) for rates in report.recall.values())
    assert 16 <= report.noise_window <= 64 and len(report.noise) == 15
    assert {"measure", "ratio", "value", "floor_95", "is_within"} <= set(report.noise[0])
    assert report.noise_sd > 0 and not report.levels
    assert set(report.examples) == {"coarse", "enhanced", "generated", "real"}
    assert all(np.shape(window) == (64,) for window in report.examples.values())


def test_an_error_of_the_enhancer_that_depends_on_the_phase_does_not_make_all_noise_look_wrong():
    num_samples, period = 40_000, 40  # the window is two periods: windows one after the other would all begin at one phase
    whole = channel(num_samples)
    coarse = SquareWaveSimulator([SquareWave(period, low=18.0, high=22.0)])
    options = {"window": 2 * period, "num_windows": 400, "enhancer": "coarse", "noise": "residual windows"}
    simulator = EnhancedSimulator.fit(whole, coarse, 3, epochs=1, verbose=0, **options)
    _, rows = report_measure._compare_noise(simulator, [whole], 3)
    beyond = [row["measure"] for row in rows if row["ratio"] is not None and row["ratio"] > 2]
    assert len(rows) == 15 and len(beyond) <= 3, beyond  # 10 of them in windows of one phase


def test_the_error_agrees_with_an_independent_computation(fitted):
    simulator, report = fitted
    held_out = channel(interval_s=10.0).part(1_620, 2_000)  # the last fifth of 900 + 1000 samples
    begins = np.unique(np.linspace(0, 316, 200).astype(int))
    target = np.stack([held_out.values[begin : begin + 64] for begin in begins])
    moved = []
    for begin, window in zip(begins, target, strict=True):  # all time shifts, on a grid twice as fine as that of the simulator
        times = held_out.offset_s + 10.0 * (begin + np.arange(64))
        coarse = np.stack([simulator.coarse(times + shift) for shift in np.linspace(-200, 200, 401)])
        design = [np.linalg.lstsq(np.stack([np.ones(64), each], 1), window, rcond=None)[0] for each in coarse]
        apply_shift_and_gain = np.stack([shift + gain * each for (shift, gain), each in zip(design, coarse, strict=True)])
        moved.append(apply_shift_and_gain[np.argmin(((apply_shift_and_gain - window) ** 2).sum(axis=1))])
    errors = np.sqrt(np.mean((np.array(moved) - target) ** 2, axis=1)) / target.std(axis=1)
    assert report.nrmse["coarse"] == pytest.approx(np.median(errors), rel=0.02)


def test_the_report_is_plain_json(fitted):
    _, report = fitted
    plain = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert set(plain) == {field.name for field in dataclasses.fields(report)} - {"examples"} | {"verdict"}
    assert plain["verdict"] == report.verdict and plain["nrmse"] == report.nrmse


def test_same_seed_same_simulator_and_report(fitted, monkeypatch):
    monkeypatch.setattr(report_measure, "_NUM_WINDOWS", 100)
    whole = channel(start="2024-01-01T00:00:00+00:00", interval_s=10.0)
    simulator, report = fit_channel([whole.part(0, 900), whole.part(1_000, 2_000)], TINY, verbose=0)
    np.testing.assert_array_equal(simulator.generate(20, seed=1), fitted[0].generate(20, seed=1))
    assert report.to_dict() == fitted[1].to_dict()


# held-out telemetry


@pytest.fixture
def unmeasured(monkeypatch):
    """Replaces the report by the arguments of the function that makes it."""
    monkeypatch.setattr(fitting, "report_on", lambda *arguments: arguments)


def test_held_out_telemetry_does_not_affect_training(unmeasured):
    whole = channel()
    changed = whole.values.copy()
    changed[1_600:] = 1e6
    (one, about), (other, _) = (fit_channel([dataclasses.replace(whole, values=v)], TINY, 0) for v in (whole.values, changed))
    for made in (one, other):
        assert made.trained["telemetry"] == "volts"
    np.testing.assert_array_equal(one.generate(10, seed=0), other.generate(10, seed=0))
    np.testing.assert_array_equal(one.levels, other.levels)
    _, learnt, held_out, is_held_out, seed = about
    assert sum(map(len, learnt)) == 1_600 and sum(map(len, held_out)) == 400 and is_held_out and seed == 3
    assert max(part.time_s[-1] for part in learnt) < min(part.time_s[0] for part in held_out)


@pytest.mark.parametrize(("held_out", "num_learnt", "is_held_out"), [(0.0, 2_000, False), (0.05, 1_900, False), (0.5, 1_000, True)])
def test_the_report_states_whether_telemetry_was_held_out(unmeasured, monkeypatch, held_out, num_learnt, is_held_out):
    monkeypatch.setattr(EnhancedSimulator, "fit", lambda *arguments, **options: SimpleNamespace(window=options["window"], trained={}))
    _, about = fit_channel([channel()], dataclasses.replace(TINY, held_out=held_out), 0)
    assert sum(map(len, about[1])) == num_learnt and about[3] is is_held_out
    assert (sum(map(len, about[2])) == 2_000 * held_out) or about[2] is about[1] or about[2] == about[1]


def test_parts_shorter_than_a_window_are_not_used_for_training(unmeasured, monkeypatch):
    monkeypatch.setattr(
        EnhancedSimulator, "fit", lambda telemetry, *arguments, **options: SimpleNamespace(window=options["window"], trained={})
    )
    whole = channel()
    _, about = fit_channel([whole.part(0, 63), whole.part(100, 1_000), whole.part(1_010, 2_000)], TINY, 0)
    assert [len(part) for part in about[1]] == [900, pytest.approx(600, abs=5)]


# telemetry that cannot be fitted


@pytest.mark.parametrize(
    ("values", "word"),
    [
        (np.full(2_000, 3.0), "constant"),
        (np.zeros(2_000), "constant"),
        (channel(600).values, "8 windows of 64"),  # four fifths of the samples are 480, that is seven and a half windows
        (channel(5).values, "256 samples"),
        (channel(255).values, "256 samples"),
    ],
)
def test_telemetry_that_cannot_be_fitted_is_refused(refused, values, word):
    with refused(word, "volts"):
        fit_channel([Telemetry(np.asarray(values, np.float32), name="volts")], TINY, 0)


@pytest.mark.parametrize(
    "options",
    [
        {"held_out": -0.1},
        {"held_out": 0.6},
        {"held_out": float("nan")},
        {"window": 31},
        {"num_windows": 0},
        {"epochs": 0},
    ],
)
def test_options_out_of_range_are_refused(refused, options):
    with refused(next(iter(options))):
        FitOptions(**options)


@pytest.mark.parametrize(("period_s", "interval_s", "window"), [(100, 1.0, 200), (100, 10.0, 64), (1_000, 1.0, 500), (900, 10.0, 180)])
def test_the_default_window_is_two_periods_within_limits(period_s, interval_s, window):
    assert window_of(SquareWaveSimulator([SquareWave(period_s), SquareWave(period_s / 3)]), interval_s) == window


# sentences of the verdict


def made_up(**changed):
    """Makes a report with given numbers."""
    noise = [{"measure": f"measure {number}", "ratio": ratio} for number, ratio in enumerate((0.5, 1.9, 1.0, 0.2))]
    rates = {"limit check": 0.0, "PCA residual": 0.02, "nearest neighbours": 0.1, "isolation forest": 1.0}
    recall = {name: dict.fromkeys(("spike", "level_shift", "stuck"), 0.5) for name in DETECTORS}
    fields = {
        "channel": "volts",
        "window": 64,
        "period_s": 400.0,
        "is_held_out": True,
        "num_windows": 200,
        "num_disjoint": 5,
        "nrmse": {"coarse": 0.5, "ridge": 0.3, "nearest": 0.4, "enhanced": 0.2},
        "noise": noise,
        "noise_window": 16,
        "false_alarms": {"generated": rates, "real": dict.fromkeys(rates, 0.01)},
        "recall": recall,
        "noise_sd": 0.2,
        "examples": {},
    }
    return ChannelReport(**fields | changed)


def sentence(report, word):
    (found,) = [line for line in report.verdict if line.startswith(word)]
    return found


@pytest.mark.parametrize(
    ("errors", "judged"),
    [
        ((0.5, 0.3, 0.4, 0.2), "The enhancer is nearest to it."),
        ((0.5, 0.3, 0.4, 0.4), "The enhancer is no nearer than ridge regression."),
        ((0.3, 0.5, 0.6, 0.4), "The enhancer is no nearer than the coarse simulator."),
        ((0.3, 0.2, 0.6, 0.4), "The enhancer is no nearer than ridge regression."),
        ((0.5, 0.3, 0.1, 0.2), "The enhancer is no nearer than the mean of the nearest training windows."),
        ((0.0, 0.0, 0.0, 0.0), "The enhancer is no nearer than the coarse simulator."),
    ],
)
def test_the_sentence_on_the_signal(errors, judged):
    said = sentence(made_up(nrmse=dict(zip(("coarse", "ridge", "nearest", "enhanced"), errors, strict=True))), "Signal")
    assert (
        said.endswith(judged)
        and f"error {errors[3]:.3f}" in said
        and f"nearest training windows {errors[2]:.3f}" in said
        and f"coarse simulator {errors[0]:.3f}" in said
    )


def test_constant_telemetry_has_no_error_and_the_report_is_valid_json():
    report = made_up(nrmse=dict.fromkeys(("coarse", "ridge", "nearest", "enhanced"), float("nan")))
    assert "no window of telemetry it has not seen moves" in sentence(report, "Signal")
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False))["nrmse"] == dict.fromkeys(("coarse", "ridge", "nearest", "enhanced"))


@pytest.mark.parametrize(
    ("ratios", "said"),
    [
        ([], "too short to compare"),
        ([None, None], "too short to compare"),
        ([0.1, 2.0, 1.0], "none of 3 measures tells generated noise from the telemetry's."),
        ([0.1, 2.1, None], "1 of 2 measures tells generated noise from the telemetry's; it is m1."),
        ([3.0, 5.0, 1.0], "2 of 3 measures tell generated noise from the telemetry's; they are m1 and m0."),
        ([3.0, 9.0, 4.0, 2.5, 0.0], "4 of 5 measures tell generated noise from the telemetry's; most of all m1, m2 and m0."),
    ],
)
def test_the_sentence_on_the_noise(ratios, said):
    report = made_up(noise=[{"measure": f"m{number}", "ratio": ratio} for number, ratio in enumerate(ratios)])
    assert said in sentence(report, "Noise:")


@pytest.mark.parametrize(
    ("num_windows", "num_disjoint", "said"),
    [
        (
            200,
            5,
            "200 windows tried, which overlap: 5 of them share no sample. With so few, even where none alarms the rate may be up to 45%.",
        ),
        (
            64,
            1,
            "64 windows tried, which overlap: 1 of them shares no sample. With so few, even where none alarms the rate may be up to 95%.",
        ),
        (200, 150, "200 windows tried, which overlap: 150 of them share no sample."),
        (150, 150, "150 windows tried."),
        (1, 1, "1 window tried. With so few"),
    ],
)
def test_the_sentence_on_false_alarms(num_windows, num_disjoint, said):
    line = sentence(made_up(num_windows=num_windows, num_disjoint=num_disjoint), "False alarms")
    assert said in line and ("With so few" in line) is (num_disjoint < 100)
    assert "limit check 0% (1%), PCA residual 2% (1%), nearest neighbours 10% (1%) and isolation forest 100% (1%)" in line


def test_the_sentence_on_anomalies():
    recall = {name: {"spike": 0.0, "level_shift": 0.3, "stuck": 0.1, "ramp": 0.2} for name in DETECTORS}
    recall["PCA residual"] |= {"level_shift": 0.8, "ramp": 0.21}
    recall["isolation forest"] = dict.fromkeys(("spike", "level_shift", "stuck", "ramp"), 1.0)  # this detector flags every window
    report = made_up(recall=recall)
    assert report.usable == list(DETECTORS[:3])
    assert report.found == {
        "spike": ("limit check", 0.0),
        "level_shift": ("PCA residual", 0.8),
        "stuck": ("limit check", 0.1),
        "ramp": ("PCA residual", 0.21),
    }
    assert sentence(report, "Anomalies") == (
        "Anomalies of 4 standard deviations of the noise: of those tried, a detector trained on this notices level shift (PCA residual, 80%); "
        "it finds only some of ramp (PCA residual, 21%); it misses spike (0%) and stuck (10%). "
        "Left out, because it alarms on more than 10% of nominal windows: isolation forest."
    )


def test_the_sentence_on_anomalies_without_missed_ones():
    report = made_up(recall={name: {"spike": 1.0, "stuck": 0.9} for name in DETECTORS})
    said = sentence(report, "Anomalies")
    assert "notices spike (limit check, 100%) and stuck (limit check, 90%)." in said and "misses" not in said and "some of" not in said


def test_detectors_that_flag_everything_are_not_usable():
    report = made_up(false_alarms={arm: dict.fromkeys(DETECTORS, 0.9) for arm in ("generated", "real")})
    assert report.usable == [] and report.found == {}
    assert "no detector trained on this can be used" in sentence(report, "Anomalies")


def test_the_report_states_the_evaluation_telemetry():
    assert "volts: windows of 64 samples, period 400 s; measured on 200 windows held out" == made_up().lines()[0]
    seen = made_up(is_held_out=False, num_windows=1, time_unit="samples")
    assert seen.lines()[0] == "volts: windows of 64 samples, period 400 samples; measured on 1 window of the training telemetry"
    assert "none was held out" in sentence(seen, "Signal")
    assert all(len(line.splitlines()) == 1 for line in made_up(channel="a\nb\x1b[31m").lines())


def test_the_report_names_the_levels():
    assert "19 values, 0.25 apart" in sentence(made_up(levels={"count": 19, "step": 0.25}), "Levels")
    assert not [line for line in made_up().verdict if line.startswith("Levels")]


def test_noise_that_is_told_apart_is_named_in_the_first_line():
    first, *_ = made_up(noise_auc={"generated": 0.81, "real": 0.55}).lines()
    assert "WARNING: a classifier tells its noise from the telemetry's (AUC 0.81; 0.55" in first
    assert "WARNING" not in made_up(noise_auc={"generated": 0.79, "real": 0.55}).lines()[0]
    assert "WARNING" not in made_up().lines()[0]
