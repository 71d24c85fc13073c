import dataclasses

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting.fit import fit
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.scoring.score import scorer_of
from enhsim_tf.scoring.scorer import MOST_NOMINAL, bounded
from enhsim_tf.telemetry.series import Telemetry
from tests.fitted_simulators import (
    PERIOD,
    QUICK,
    WINDOW,
    coarse_run,
    joint,
    recorded,
    series,
    smooth_wave,
)


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
    assert report.nrmse["volts"].enhanced < 0.5 * report.nrmse["volts"].coarse
    # thresholds know all that was given
    assert sum(map(len, simulator.nominal)) == 3_000


def test_each_channel_keeps_its_phase_level_and_scale(both):
    simulator, report = both
    clean = simulator.generate(400, seed=0, with_noise=False)
    assert clean.mean(axis=(0, 1)) == pytest.approx([5, 100], rel=0.02)
    assert np.std(clean, axis=(0, 1)) == pytest.approx(
        np.std(smooth_wave(4_000)) * np.array([2, 30]), rel=0.05
    )
    real = np.corrcoef(smooth_wave(4_000), -smooth_wave(4_000, 0.25))[0, 1]
    assert np.corrcoef(clean.reshape(-1, 2).T)[0, 1] == pytest.approx(real, abs=0.05)
    assert report.cross_correlation.apart < 0.1


@pytest.mark.parametrize("coarse", [None, coarse_run()])
def test_parts_with_half_of_the_samples_have_a_window_and_shorter_ones_are_reported(coarse):
    whole = series()
    # 1,800 of 2,880 samples are in parts of 60
    parts = [whole.part(first, first + 60) for first in range(0, 2_040, 68)]
    parts += [whole.part(2_040, 2_980), whole.part(2_985, 3_000)]
    options = dataclasses.replace(QUICK, window=None)
    simulator, report = fit(parts, coarse, options)
    assert simulator.window <= 60
    assert any("1 of 32 parts" in note and "15 of 2,755" in note for note in report.notes)


@pytest.mark.parametrize("coarse", [None, coarse_run()])
def test_nominal_telemetry_keeps_a_piece_that_only_the_split_makes_shorter_than_a_window(coarse):
    whole = series()
    # 2,400 samples are not held out
    simulator, _ = fit([whole.part(0, 2_340), whole.part(2_340, 3_000)], coarse, QUICK)
    if coarse is None:
        assert sum(map(len, simulator.nominal)) == 3_000
    else:
        assert len(simulator.alignment.nominal) == 3_000


def test_a_delay_between_run_and_telemetry_is_recovered():
    # seven samples later
    late = recorded(series().values, start="2024-01-01T00:01:10+00:00")
    simulator, report = fit(late, coarse_run(4_000), QUICK)
    assert simulator.alignment.delay_s == 70.0 and any(
        "later than the coarse run" in note for note in report.notes
    )


def test_only_channels_that_follow_no_wave_become_levels():
    values = series().values.copy()
    # its best square wave is as high as the spike, and all other windows are flat beside it
    values[2_000] += 1e5
    noise = np.random.default_rng(1).standard_normal(3_000).astype(np.float32)
    channels = np.column_stack([series(seed=1).values, values, noise])
    simulator, _ = fit(recorded(channels, ("volts", "spiky", "noise")), options=QUICK)
    assert [each.is_constant for each in simulator.alignment.simulators] == [False, True, True]
    assert np.std(simulator.generate(200), axis=(0, 1))[2] == pytest.approx(1.0, rel=0.05)


def test_a_channel_that_begins_still_is_named():
    valve = np.arange(3_000) >= 2_700
    whole = recorded(np.column_stack([joint().values, valve]), ("volts", "watts", "valve"))
    assert "the first 80% of valve is constant" in fit(whole, options=QUICK)[1].coarse


def test_quantised_channels_stay_on_their_levels():
    rounded = np.round(series(noise_sd=0.3).values / 0.5) * 0.5
    simulator, _ = fit(recorded(rounded), options=QUICK)
    values = simulator.generate(50) / 0.5
    np.testing.assert_allclose(values, np.round(values), atol=1e-4)


@pytest.mark.parametrize(("window", "is_short"), [(36, True), (44, False)])
def test_the_report_says_how_often_a_period_occurs_and_whether_a_window_is_shorter(
    window, is_short
):
    _, report = fit(series(1_000), options=dataclasses.replace(QUICK, window=window))
    # 800 of the samples are not held out
    assert "which occurs 20.0 times in the longest part without a gap" in report.coarse
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
        (
            "at least 256 samples .*, 8 windows of 32. Received: 200 samples of volts",
            series(200),
            {},
        ),
        ("at least one channel", {}, {}),
        ("at least one part", [], {}),
        ("a Telemetry. Received: NoneType", None, {}),
        ("options as FitOptions. Received: dict", series(), {"options": {"window": 64}}),
        ("do not overlap", [series(), series()], {}),
        ("at least one part", {"a": [], "b": series()}, {}),
        (
            "8 windows of 4000. Received: 3,000 samples of volts",
            series(),
            {"coarse": coarse_run(), "options": FitOptions(window=4_000)},
        ),
        (
            "2 groups",
            {"a": series(), "b": Telemetry.of(series().values, 1.0, 0.0, series().start)},
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
        {"delay_s": float("nan")},
    ],
)
def test_an_option_out_of_range_is_refused_by_its_name(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        FitOptions(**wrong)


def test_differences_from_a_run_that_scores_are_learnt_from_are_of_enhancers_that_have_not_learnt_them():
    """Ridge regression on few windows learns part of their noise, so what it leaves is too small."""
    noise = np.random.default_rng(3).standard_normal((1_500, 2))
    options = dataclasses.replace(QUICK, num_windows=60, delay_s=0.0)
    simulator, _ = fit(recorded(noise[:, 1]), recorded(noise[:, 0], "watts"), options)
    unlearnt = np.concatenate(simulator.nominal)
    learnt = noise[:1_200, 1:] - simulator.enhance_run(noise[:1_200, :1])
    assert np.std(unlearnt) > 1 > np.std(learnt)


@pytest.mark.parametrize(
    ("values", "by"), [(np.full(1_500, 3.5), 0.01), (np.arange(1_500) // 700 % 2, 3.0)]
)
def test_a_channel_that_never_or_hardly_varies_is_fitted_and_other_values_are_flagged(values, by):
    simulator, report = fit(Telemetry.of(values.astype(np.float32)))
    assert report.false_alarms <= 0.1 and np.isfinite(simulator.generate(5)).all()
    new = values[:600].astype(np.float32)
    new[300:310] += by
    found = scorer_of(simulator).score(new[:, None]).samples > 1
    assert found[300:310].all() and not found[:236].any()


def test_a_constant_channel_beside_others_changes_none_of_them():
    values = np.column_stack([joint().values, np.full(3_000, 7)])
    simulator, report = fit(recorded(values, ("volts", "watts", "valve")), options=QUICK)
    assert "valve: coarse simulator: none" in report.coarse and "never varies" in report.coarse
    generated = simulator.generate(20, seed=1)
    np.testing.assert_array_equal(generated[:, :, 2], 7)
    assert generated[:, :, 0].mean() == pytest.approx(5, rel=0.02)


def test_what_a_model_keeps_of_nominal_telemetry_is_bounded():
    long = [np.zeros((700_000, 2), np.float32), np.ones((900_000, 2), np.float32)]
    kept = bounded(long)
    assert sum(each.size for each in kept) <= MOST_NOMINAL and len(kept[0]) >= 512
    # as much of each as it has of all
    assert np.mean([each[0, 0] for each in kept]) == pytest.approx(9 / 16, abs=0.01)
    assert bounded(long[:1])[0] is not long[0] and bounded([long[0][:9]])[0].shape == (9, 2)


def test_of_many_short_series_a_model_keeps_different_ones():
    short = [np.full((400, 1), number, np.float32) for number in range(3_000)]
    kept = [float(each[0, 0]) for each in bounded(short)]
    assert len(set(kept)) == len(kept) > 1_500 and 400 * len(kept) <= MOST_NOMINAL
    # evenly spread
    assert np.mean(kept) == pytest.approx(1_500, abs=15) and max(np.diff(kept)) <= 2
