import dataclasses

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.options import FitOptions
from enhsim_tf.telemetry.series import Telemetry
from tests.simulator.conftest import PERIOD, QUICK, WINDOW, coarse_run, joint, series, smooth_wave


def test_the_waveform_below_the_noise_is_recovered(single):
    simulator, report = single
    aligned = simulator.alignment.align(
        (5 + 2 * smooth_wave(WINDOW))[None, :, None].astype(np.float32)
    )
    clean = simulator.enhance(*aligned)[0, :, 0]
    assert np.sqrt(np.mean((clean - 5 - 2 * smooth_wave(WINDOW)) ** 2)) < 0.05  # half of the noise
    assert simulator.alignment.simulators[0].waves[0].period_s == pytest.approx(
        10 * PERIOD, rel=1e-3
    )
    assert report.nrmse["volts"]["enhanced"] < 0.5 * report.nrmse["volts"]["coarse"]
    assert len(simulator.nominal) == 3_000  # thresholds know all that was given


def test_each_channel_keeps_its_phase_level_and_scale(both):
    simulator, report = both
    clean = simulator.generate(400, seed=0, with_noise=False)
    assert clean.mean(axis=(0, 1)) == pytest.approx([5, 100], rel=0.02)
    assert np.std(clean, axis=(0, 1)) == pytest.approx(
        np.std(smooth_wave(4_000)) * np.array([2, 30]), rel=0.05
    )
    real = np.corrcoef(smooth_wave(4_000), -smooth_wave(4_000, 0.25))[0, 1]
    assert np.corrcoef(clean.reshape(-1, 2).T)[0, 1] == pytest.approx(real, abs=0.05)
    assert report.cross_correlation["apart"] < 0.1


@pytest.mark.parametrize("coarse", [None, coarse_run()])
def test_nominal_telemetry_keeps_a_piece_that_only_the_split_makes_shorter_than_a_window(coarse):
    whole = series()
    simulator, _ = fit(
        [whole.part(0, 2_340), whole.part(2_340, 3_000)], coarse, QUICK
    )  # 2,400 samples are not held out
    assert len(simulator.nominal) == 3_000 and (
        coarse is None or len(simulator.nominal_run) == 3_000
    )


def test_a_delay_between_run_and_telemetry_is_recovered():
    late = series()
    late = Telemetry(
        late.values, late.interval_s, 70.0, late.start, late.name
    )  # the same values, seven samples later
    simulator, report = fit(late, coarse_run(4_000), QUICK)
    assert simulator.alignment.delay_s == 70.0 and any(
        "later than the coarse run" in note for note in report.notes
    )


def test_telemetry_without_a_period_gets_a_constant_level():
    noise = Telemetry(
        np.random.default_rng(0).standard_normal(3_000).astype(np.float32), name="noise"
    )
    simulator, report = fit(noise, options=QUICK)
    assert (
        simulator.alignment.simulators[0].is_constant and "only a constant level" in report.coarse
    )
    assert np.std(simulator.generate(200)) == pytest.approx(1.0, rel=0.05)


def test_only_channels_that_follow_no_wave_become_levels():
    values = series().values.copy()
    values[2_000] += (
        1e5  # its best square wave is as high as the spike, and all other windows are flat beside it
    )
    noise = np.random.default_rng(1).standard_normal(3_000).astype(np.float32)
    others = {
        name: Telemetry(each, 10.0, 0.0, series().start, name)
        for name, each in (("spiky", values), ("noise", noise))
    }
    simulator, _ = fit({"volts": series(seed=1), **others}, options=QUICK)
    assert [each.is_constant for each in simulator.alignment.simulators] == [False, True, True]
    assert np.std(simulator.generate(200), axis=(0, 1))[2] == pytest.approx(1.0, rel=0.05)


def test_quantised_channels_stay_on_their_levels():
    telemetry = series(noise_sd=0.3)
    rounded = Telemetry(
        np.round(telemetry.values / 0.5).astype(np.float32) * 0.5,
        10.0,
        0.0,
        telemetry.start,
        "volts",
    )
    simulator, _ = fit(rounded, options=QUICK)
    values = simulator.generate(50) / 0.5
    np.testing.assert_allclose(values, np.round(values), atol=1e-4)


@pytest.mark.parametrize(("window", "is_short"), [(36, True), (44, False)])
def test_the_report_says_how_often_a_period_occurs_and_whether_a_window_is_shorter(
    window, is_short
):
    _, report = fit(series(1_000), options=dataclasses.replace(QUICK, window=window))
    assert (
        "which occurs 20.0 times in the longest part without a gap" in report.coarse
    )  # 800 of the samples are not held out
    assert [note.partition(":")[0] for note in report.notes] == [
        "a window of 36 samples is shorter than a period of 40"
    ] * is_short


@pytest.mark.parametrize("name", ["none", "residual windows", "matched residual windows"])
def test_the_noise_that_is_asked_for_is_used(name):
    simulator, report = fit(
        joint(1_500), options=FitOptions(window=64, num_windows=100, noise=name, held_out=0.0)
    )
    assert report.noise_model == simulator.trained["noise"] == name and not report.is_held_out
    expected = 0.0 if name == "none" else 0.2
    assert simulator.noise_sd[0] == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize(
    ("words", "telemetry", "others"),
    [
        ("constant 1", Telemetry(np.ones(1_000, np.float32)), {}),
        (
            "at least 256 samples .*, 8 windows of 32. Received: 200 samples of volts",
            series(200),
            {},
        ),
        ("at least one channel", {}, {}),
        (
            "2 groups",
            {"a": series(), "b": Telemetry(series().values, 1.0, 0.0, series().start)},
            {},
        ),
        (
            "overlaps the telemetry",
            series(),
            {"coarse": coarse_run(start="2031-01-01T00:00:00+00:00")},
        ),
        (
            "8 windows of 500. Received: 2,400 samples of volts that are not held out",
            series(),
            {"options": FitOptions(window=500)},
        ),
    ],
)
def test_telemetry_that_cannot_be_fitted_is_refused(words, telemetry, others):
    with pytest.raises(InputError, match=words):
        fit(telemetry, **others)


@pytest.mark.parametrize(
    "wrong",
    [
        {"window": 3},
        {"noise": "pink"},
        {"enhancer": "gan"},
        {"held_out": 0.7},
        {"num_windows": 0},
        {"seed": -1},
        {"epochs": 1.5},
    ],
)
def test_an_option_out_of_range_is_refused_by_its_name(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        FitOptions(**wrong)
