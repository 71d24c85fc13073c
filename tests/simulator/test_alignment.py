import dataclasses

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.constant_level import ConstantLevel
from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.alignment import Runs, Waves, least_squares
from tests.simulator.conftest import coarse_run, series

START = "2024-01-01T00:00:00+00:00"


@pytest.fixture
def waves():
    return Waves([SquareWaveSimulator([SquareWave(40.0, low=1.0, high=3.0)]), ConstantLevel(7.0, 2.0)], ("a", "b"), 1.0, 80)


def test_phase_offset_and_gain_of_windows_are_recovered(waves):
    starts, shift, gain = np.array([3, 11, 30]), np.array([10.0, -2.0, 0.5]), np.array([2.0, 1.0, 5.0])
    square = np.where(((starts[:, None] + np.arange(80)) % 40) < 20, 1.0, -1.0)
    targets = np.stack([shift[:, None] + gain[:, None] * square, np.full((3, 80), 4.0)], axis=2).astype(np.float32)
    found = waves.align(targets)
    np.testing.assert_array_equal(found.coarse[:, :, 0], square)
    np.testing.assert_allclose(found.shift, np.stack([shift, np.full(3, 4.0)], axis=1), atol=1e-5)
    np.testing.assert_allclose(found.gain, np.stack([gain, np.full(3, 2.0)], axis=1), atol=1e-5)


def test_the_phase_of_short_pulses_is_found_although_some_windows_have_none():
    pulses = Waves([SquareWaveSimulator([SquareWave(100.0, duty=0.2)])], ("a",), 1.0, 80)
    phases = pulses.phases(0)
    assert (np.ptp(phases, axis=1) == 0).any()
    targets = phases[[10, 200, 330]]
    np.testing.assert_array_equal(phases[pulses.best_phases(3 * targets[:, :, None], 0)], targets)


def test_windows_that_do_not_follow_the_wave_are_flat(waves):
    assert waves.is_flat(np.array([[0.09, 2.0], [0.11, 2.0]])).tolist() == [[True, False], [False, False]]  # the wave's amplitude is 1


def test_waves_are_drawn_in_their_unit_and_a_scenario_may_concern_one_channel(waves):
    rng = np.random.default_rng(0)
    nominal = waves.draw(np.array([0, 7]), [None, None], rng)
    np.testing.assert_array_equal(nominal.coarse[:, :, 0], np.where((np.array([[0], [7]]) + np.arange(80)) % 40 < 20, 1.0, -1.0))
    assert (
        nominal.coarse is nominal.nominal and np.unique(nominal.coarse[:, :, 0]).tolist() == [-1, 1] and not nominal.coarse[:, :, 1].any()
    )
    changed = waves.draw(np.array([0, 20]), [None, Degraded("drift", 1.0, 0.0, "b")], rng)
    assert (changed.coarse != changed.nominal).any(axis=1).tolist() == [[False, False], [False, True]]
    assert changed.coarse[1, -1, 1] == pytest.approx(2.0)  # the whole range of a level of spread 2, in units of the spread
    with pytest.raises(InputError, match="one of: a, b"):
        waves.draw(np.array([0]), [Degraded("drift", 1.0, 0.0, "c")], rng)


def test_a_run_is_cut_to_the_time_of_the_telemetry():
    from enhsim_tf.simulator.joint import join_channels

    runs = Runs(coarse_run(), 80, delay_s=20.0)
    telemetry, coarse = runs.pair(join_channels({"volts": series()})[0], coarse_run())
    assert len(telemetry) == len(coarse) == 2_998 and telemetry.parts[0].offset_s == coarse.parts[0].offset_s == 20.0
    np.testing.assert_allclose(coarse.parts[0].values, coarse_run().parts[0].values[:2_998])


def test_a_run_of_another_rate_or_without_a_window_is_refused():
    runs = Runs(coarse_run(), 80)
    with pytest.raises(InputError, match="sample every 10 s"):
        runs.usable(dataclasses.replace(coarse_run(), interval_s=5.0))
    with pytest.raises(InputError, match="at least one window of 80"):
        runs.usable(coarse_run(79))
    with pytest.raises(InputError, match="recorded run of the scenario"):
        runs.draw(np.array([0]), [Degraded("stuck", 0.5)], np.random.default_rng(0))


def test_least_squares_of_a_constant_waveform_has_no_gain():
    shift, gain = least_squares(np.ones((1, 5)), np.arange(5.0)[None])
    assert shift.tolist() == [2.0] and gain.tolist() == [0.0]
    shift, gain = least_squares(0.01 * np.arange(5.0)[None], 3 + np.arange(5.0)[None])
    assert (shift[0], gain[0]) == pytest.approx((3.0, 100.0))


def test_nearly_equal_periods_become_one_clock_at_the_distance_of_the_telemetry():
    first, second = (SquareWaveSimulator([SquareWave(period, phase)]) for period, phase in ((40.0, 0.1), (40.2, 0.9)))
    waves = Waves([first, second], ("a", "b"), 1.0, 80)
    times = np.arange(0, 4_000, 37)[:, None] + np.arange(80)
    targets = np.stack([SquareWave(40.0, phase)(times) for phase in (0.3, 0.55)], axis=2).astype(np.float32)  # a quarter of a period apart
    found = [each.waves[0] for each in waves.on_one_clock(targets).simulators]
    assert [each.period_s for each in found] == [40.0, 40.0] and np.mod(found[1].phase - found[0].phase, 1.0) == pytest.approx(
        0.25, abs=0.0125
    )  # half a sample


def test_periods_that_differ_by_more_than_two_per_cent_keep_their_clocks():
    waves = Waves([SquareWaveSimulator([SquareWave(period)]) for period in (40.0, 41.0)], ("a", "b"), 1.0, 80)
    found = waves.on_one_clock(np.random.default_rng(0).standard_normal((5, 80, 2)).astype(np.float32))
    assert [each.waves[0].period_s for each in found.simulators] == [40.0, 41.0]


def test_a_series_is_drawn_with_what_stands_still(waves):
    square = np.where((5 + np.arange(200)) % 40 < 20, 1.0, -1.0)  # begins at 5 s
    stuck = square.copy()
    stuck[50:100] = square[50]  # the second half of the first hundred samples
    drawn = waves.draw_series(200, 5.0, [(Degraded("stuck", 1.0, 0.5, "a"), 0, 100)], np.random.default_rng(0))
    np.testing.assert_array_equal(drawn.nominal, np.stack([square, np.zeros(200)], axis=1)[None])
    np.testing.assert_array_equal(drawn.coarse, np.stack([stuck, np.zeros(200)], axis=1)[None])
    places = np.arange(200)
    np.testing.assert_array_equal(drawn.held[0].T, [np.where((places >= 50) & (places < 100), 50, places), places])
    stuck = square.copy()
    stuck[30:50] = square[30]
    drawn = waves.draw_series(200, 5.0, [(Degraded("stuck", 1.0, 0.0), 30, 50)], np.random.default_rng(0))
    np.testing.assert_array_equal(drawn.coarse[0, :, 0], stuck)
    assert (drawn.held[0, 30:50] == 30).all() and (drawn.held[0, 50:] == places[50:, None]).all()


def test_windows_name_what_stands_still_in_them(waves):
    drawn = waves.draw(np.array([0, 7, 9]), [None, Degraded("stuck", 1.0, 0.25, "b"), Degraded("drift", 1.0)], np.random.default_rng(0))
    assert (drawn.held != np.arange(80)[:, None]).sum(axis=1).tolist() == [[0, 0], [0, 59], [0, 0]] and (drawn.held[1, 20:, 1] == 20).all()
    assert (drawn.coarse != drawn.nominal).any(axis=1).tolist() == [
        [False, False],
        [False, False],
        [True, True],
    ]  # a level stands still anyway


def test_enhanced_waveforms_find_the_phase_and_are_saved(waves):
    times = 40.0 * np.arange(400) / 400
    sines = np.sin(2 * np.pi * (times[:, None] + np.arange(80)) / 40).astype(np.float32)
    enhanced = Waves(waves.simulators, ("a", "b"), 1.0, 80, [sines, None])
    targets = np.stack([5 + 3 * sines[[10, 130]], np.ones((2, 80))], axis=2).astype(np.float32)
    assert enhanced.best_phases(targets, 0).tolist() == [10, 130]
    found = enhanced.align(targets)
    np.testing.assert_allclose(found.shift[:, 0], 5, atol=1e-5)
    np.testing.assert_allclose(found.gain[:, 0], 3, atol=1e-5)
    np.testing.assert_array_equal(found.coarse[:, :, 0], waves.phases(0)[[10, 130]])
    again = Waves.from_arrays(enhanced.settings, enhanced.arrays, ("a", "b"), 1.0, 80)
    assert again.settings == enhanced.settings and list(again.arrays) == ["waveform_0"]
    np.testing.assert_array_equal(again.waveforms[0], sines)


def test_each_part_of_telemetry_meets_the_run_of_its_own_time():
    first, second = (np.random.default_rng(seed).standard_normal((100, 1)).astype(np.float32) for seed in (0, 1))
    telemetry = Recording((Run(first, 0.0), Run(second, 1_500.0)), ("a",), 10.0, START)
    values = coarse_run(300).parts[0].values
    late = dataclasses.replace(coarse_run(300), parts=(Run(values[50:], 500.0),))
    found, coarse = Runs(coarse_run(), 40).pair(telemetry, late)
    for part, expected in zip(found.parts, (first[50:], second), strict=True):
        np.testing.assert_array_equal(part.values, expected)
    for part, expected in zip(coarse.parts, (values[50:100], values[150:250]), strict=True):
        np.testing.assert_allclose(part.values, expected, atol=1e-6)
    assert [part.offset_s for part in found.parts] == [part.offset_s for part in coarse.parts] == [500.0, 1_500.0]


def test_windows_of_a_run_begin_again_after_the_last():
    values = coarse_run(100).parts[0].values
    drawn = Runs(coarse_run(100), 80).draw(np.array([0, 20, 21, 43]), [None] * 4, np.random.default_rng(0))
    np.testing.assert_array_equal(drawn.coarse, [values[:80], values[20:], values[:80], values[1:81]])
    assert drawn.held is None and drawn.nominal is drawn.coarse


def test_a_saved_run_is_the_same_and_one_that_is_not_finite_is_none():
    assert Runs(coarse_run(100), 80).name == "the run"
    runs = Runs(coarse_run(100), 80, 20.0, name="the box")
    again = Runs.from_arrays(runs.settings, runs.arrays, ("a",), 10.0, 80)
    assert (again.columns, again.window, again.delay_s, again.name) == (("square", "ramp"), 80, 20.0, "the box")
    assert (again.nominal.start, again.nominal.interval_s) == (START, 10.0)
    np.testing.assert_array_equal(again.nominal.parts[0].values, runs.nominal.parts[0].values)
    for settings, arrays in (({"delay_s": np.nan}, {}), ({"offsets_s": [np.inf]}, {}), ({}, {"part_0": np.zeros((100, 2))})):
        with pytest.raises(ValueError, match="not finite, or of another type"):
            Runs.from_arrays(runs.settings | settings, runs.arrays | arrays, ("a",), 10.0, 80)
