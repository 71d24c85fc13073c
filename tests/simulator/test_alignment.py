import numpy as np
import pytest

from enhsim_tf.coarse_simulator.constant_level import ConstantLevel
from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.alignment import Runs, Waves, least_squares
from tests.simulator.conftest import coarse_run, series


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


def test_windows_that_do_not_follow_the_wave_are_flat(waves):
    assert waves.is_flat(np.array([[0.05, 2.0], [0.2, 2.0]])).tolist() == [[True, False], [False, False]]  # the wave's amplitude is 1


def test_waves_are_drawn_in_their_unit_and_a_scenario_may_concern_one_channel(waves):
    rng = np.random.default_rng(0)
    nominal = waves.draw(np.array([0, 20]), [None, None], rng)
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
    import dataclasses

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


def test_nearly_equal_periods_become_one_clock_at_the_distance_of_the_telemetry():
    first, second = (SquareWaveSimulator([SquareWave(period, phase)]) for period, phase in ((40.0, 0.1), (40.2, 0.9)))
    waves = Waves([first, second], ("a", "b"), 1.0, 80)
    times = np.arange(0, 4_000, 37)[:, None] + np.arange(80)
    targets = np.stack([SquareWave(40.0, phase)(times) for phase in (0.3, 0.55)], axis=2).astype(np.float32)  # a quarter of a period apart
    found = [each.waves[0] for each in waves.on_one_clock(targets).simulators]
    assert [each.period_s for each in found] == [40.0, 40.0] and np.mod(found[1].phase - found[0].phase, 1.0) == pytest.approx(
        0.25, abs=0.0125
    )  # half a sample
