import dataclasses
import inspect
import re

import numpy as np
import pytest

from enhsim_tf.coarse.alignment import Paired
from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.runs import Runs
from enhsim_tf.coarse.square_waves import ConstantLevel, SquareWave, SquareWaveSimulator
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting import fitted, report
from enhsim_tf.simulator import simulator
from enhsim_tf.telemetry.series import Clock, Part, Telemetry
from tests.fitted_simulators import coarse_run
from tests.known_simulators import parts_of

START = "2024-01-01T00:00:00+00:00"
PLACES = np.arange(200)


@pytest.fixture
def waves():
    return Waves(
        [SquareWaveSimulator([SquareWave(40.0, low=1.0, high=3.0)]), ConstantLevel(7.0, 2.0)],
        ("a", "b"),
        1.0,
        80,
    )


def methods_of(kind):
    return {
        name: list(inspect.signature(method).parameters)
        for name, method in vars(kind).items()
        if inspect.isfunction(method) and not name.startswith("_")
    }


def test_waves_and_runs_answer_the_same_questions():
    waves = methods_of(Waves)
    runs = methods_of(Runs)
    asked = {
        name
        for module in (simulator, fitted, report)
        for name in re.findall(r"alignment\.(\w+)\(", inspect.getsource(module))
    }
    assert asked > {"pair", "draw", "clean_series"} and asked <= waves.keys() & runs.keys()
    assert runs == {name: waves[name] for name in runs}


def square(places):
    return np.where(places % 40 < 20, 1.0, -1.0)


def test_phase_offset_and_gain_of_windows_are_recovered(waves):
    starts = np.array([3, 11, 30])
    shift, gain = np.array([[10.0, -2.0, 0.5], [2.0, 1.0, 5.0]])
    wave = square(starts[:, None] + np.arange(80))
    targets = np.stack(
        [shift[:, None] + gain[:, None] * wave, np.full((3, 80), 4.0)], axis=2
    ).astype(np.float32)
    coarse, found_shift, found_gain = waves.align(targets)
    np.testing.assert_array_equal(coarse[:, :, 0], wave)
    np.testing.assert_allclose(found_shift, np.stack([shift, np.full(3, 4.0)], axis=1), atol=1e-5)
    np.testing.assert_allclose(found_gain, np.stack([gain, np.full(3, 2.0)], axis=1), atol=1e-5)
    # the wave's amplitude is 1
    assert waves.is_flat(np.array([[0.09, 2.0], [0.11, 2.0]])).tolist() == [
        [True, False],
        [False, False],
    ]


def test_the_phase_of_short_pulses_is_found_although_some_windows_have_none():
    pulses = Waves([SquareWaveSimulator([SquareWave(100.0, duty=0.2)])], ("a",), 1.0, 80)
    phases = pulses.phases(0)
    assert (np.ptp(phases, axis=1) == 0).any()
    targets = phases[[10, 200, 330]]
    np.testing.assert_array_equal(phases[pulses.best_phases(3 * targets[:, :, None], 0)], targets)


def test_enhanced_waveforms_find_the_phase(waves):
    times = 40.0 * np.arange(400) / 400
    sines = np.sin(2 * np.pi * (times[:, None] + np.arange(80)) / 40).astype(np.float32)
    targets = np.stack([5 + 3 * sines[[10, 130]], np.ones((2, 80))], axis=2).astype(np.float32)
    coarse, shift, gain = Waves(waves.simulators, ("a", "b"), 1.0, 80, [sines, None]).align(targets)
    np.testing.assert_allclose([shift[:, 0], gain[:, 0]], [[5, 5], [3, 3]], atol=1e-5)
    np.testing.assert_array_equal(coarse[:, :, 0], waves.phases(0)[[10, 130]])


# two per cent apart they keep their clocks
@pytest.mark.parametrize(("period", "expected"), [(40.2, 40.0), (41.0, 41.0)])
def test_nearly_equal_periods_become_one_clock_at_the_distance_of_the_telemetry(period, expected):
    first, second = (
        SquareWaveSimulator([SquareWave(each, phase)])
        for each, phase in ((40.0, 0.1), (period, 0.9))
    )
    times = np.arange(0, 4_000, 37)[:, None] + np.arange(80)
    # a quarter of a period apart
    targets = np.stack([SquareWave(40.0, phase)(times) for phase in (0.3, 0.55)], axis=2).astype(
        np.float32
    )
    waves = Waves([first, second], ("a", "b"), 1.0, 80).on_one_clock(targets)
    found = [simulator.waves[0] for simulator in waves.simulators]
    assert [each.period_s for each in found] == [40.0, expected]
    if expected == 40.0:
        # half a sample
        assert np.mod(found[1].phase - found[0].phase, 1.0) == pytest.approx(0.25, abs=0.0125)


def test_waves_are_drawn_in_their_unit_and_a_scenario_may_concern_one_channel(waves):
    rng, starts = np.random.default_rng(0), np.array([0, 7, 9])
    nominal = waves.draw(starts, [None] * 3, rng)
    assert nominal.coarse is nominal.nominal and not nominal.coarse[:, :, 1].any()
    np.testing.assert_array_equal(nominal.coarse[:, :, 0], square(starts[:, None] + np.arange(80)))
    found = waves.draw(
        starts, [None, Degraded("stuck", 1.0, 0.25, "b"), Degraded("drift", 1.0, 0.0, "b")], rng
    )
    # a level stands anyway
    assert (found.coarse != found.nominal).any(axis=1).tolist() == [
        [False, False],
        [False, False],
        [False, True],
    ]
    # the whole range of a level of spread 2, in units of the spread
    assert found.coarse[2, -1, 1] == pytest.approx(2.0)
    assert (found.held != np.arange(80)[:, None]).sum(axis=1).tolist() == [[0, 0], [0, 59], [0, 0]]
    with pytest.raises(InputError, match="one of: a, b"):
        waves.draw(np.array([0]), [Degraded("drift", 1.0, 0.0, "c")], rng)


@pytest.mark.parametrize(
    ("mode", "begin", "end", "still"),
    [(("stuck", 1.0, 0.5, "a"), 0, 100, 50), (("stuck", 1.0, 0.0), 30, 50, 30)],
)
def test_a_series_is_drawn_with_what_stands_still(waves, mode, begin, end, still):
    held = np.where((PLACES >= still) & (PLACES < end), still, PLACES)
    drawn = waves.draw_series(200, [(Degraded(*mode), begin, end)], np.random.default_rng(0))
    np.testing.assert_array_equal(drawn.nominal[0].T, [square(PLACES), np.zeros(200)])
    np.testing.assert_array_equal(drawn.coarse[0].T, [square(held), np.zeros(200)])
    np.testing.assert_array_equal(drawn.held[0].T, [held, PLACES if "a" in mode else held])


def test_each_part_of_telemetry_meets_the_run_of_its_own_time():
    first, second = (
        np.random.default_rng(seed).standard_normal((100, 1)).astype(np.float32) for seed in (0, 1)
    )
    telemetry = parts_of((Part(first, 0.0), Part(second, 1_500.0)), ("a",), 10.0, START)
    run = coarse_run(300).part(50, 300)
    paired = Runs(coarse_run(), ["a"], 40, delay_s=20.0).pair(telemetry, run)
    found, coarse = paired.telemetry, paired.run
    assert paired.places_in(telemetry) == [52, 100]
    for part, expected in zip(found.parts, (first[52:], second), strict=True):
        np.testing.assert_array_equal(part.values, expected)
    for part, expected in zip(coarse.parts, (run.values[:48], run.values[98:198]), strict=True):
        np.testing.assert_allclose(part.values, expected, atol=1e-6)
    for telemetry in (found, coarse):
        assert [part.offset_s for part in telemetry.parts] == [520.0, 1_500.0]


def test_parts_between_two_samples_of_the_clock_keep_their_places():
    telemetry = Telemetry.of(np.zeros(20, np.float32), offset_s=10.5)
    assert Paired(telemetry.part(3, 20)).places_in(telemetry) == [3]


def test_a_run_of_another_rate_or_without_a_window_is_refused():
    runs = Runs(coarse_run(), ["a"], 80)
    with pytest.raises(InputError, match="sample every 10 s"):
        runs.usable(dataclasses.replace(coarse_run(), clock=Clock.of(5.0, coarse_run().start)))
    with pytest.raises(InputError, match="at least one window of 80"):
        runs.usable(coarse_run(79))
    with pytest.raises(InputError, match="recorded run of the scenario"):
        runs.draw(np.array([0]), [Degraded("stuck", 0.5)], np.random.default_rng(0))


def test_windows_of_a_run_begin_again_after_the_last():
    values = coarse_run(100).values
    runs, starts = Runs(coarse_run(100), ["a"], 80), np.array([0, 20, 21, 43])
    drawn = runs.draw(starts, [None] * 4, np.random.default_rng(0)).coarse
    np.testing.assert_array_equal(drawn, [values[:80], values[20:], values[:80], values[1:81]])
