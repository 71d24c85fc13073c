"""Physical oracles of the aircraft and its coarse simulator. Those in JSBSim are skipped without it."""

import functools
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from studies.common.command import example_command
from studies.reference_or_source import aircraft_flight, aircraft_point_mass, example
from studies.reference_or_source.aircraft import Aircraft
from studies.reference_or_source.aircraft_faults import (
    ALL,
    ONSET,
    UNIT_SAMPLES,
    Fault,
    sizes_over_flight,
)

AIRCRAFT = Aircraft()
AIRSPEED, CLIMB, PITCH, LEFT, RIGHT, ALTITUDE = range(6)
FOLDER = Path(__file__).parents[3] / "examples" / "aircraft"
LATE = slice(ONSET + 450, None)  # when the fine simulator has settled after a fault's onset


@pytest.fixture(scope="module")
def jsbsim():
    return pytest.importorskip(
        "jsbsim", reason="JSBSim is an optional extra: pip install 'enhsim_tf[aircraft]'"
    )


@pytest.fixture(scope="module")
def level():
    """Targets of a level flight."""
    return np.tile([12_000.0, 260.0], (UNIT_SAMPLES, 1))


@pytest.fixture(scope="module")
def calm(jsbsim, level):
    return AIRCRAFT.run_real(level)[0]


@pytest.fixture(scope="module")
def run_with(jsbsim, level):
    """`run_with(kind)` is the level flight with the largest fault of a kind."""
    return functools.cache(lambda kind: AIRCRAFT.run_real(level, [Fault(kind, 1.0)])[0])


def test_level_flight_keeps_its_targets_and_takes_less_thrust_as_fuel_burns(calm, level):
    assert calm.shape == (UNIT_SAMPLES, 6) and calm.dtype == np.float32
    assert np.abs(calm[:, ALTITUDE] - 12_000).max() < 2
    assert np.abs(calm[:, AIRSPEED] - 260).max() < 0.1
    assert -1.0 < calm[-1, LEFT] - calm[0, LEFT] < -0.1 and calm[-1, PITCH] < calm[0, PITCH]
    first, again = (AIRCRAFT.run_real(level, rng=np.random.default_rng(1))[0] for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert 0.2 < (first - calm)[:, AIRSPEED].std() < 1  # light turbulence


def coarse_run(commands):
    return AIRCRAFT.run_coarse(commands, AIRCRAFT.first_values)


def test_steps_of_the_targets_are_reached(level):
    stepped = level.copy()
    stepped[100:, 0], stepped[600:, 1] = 13_000, 275
    run = coarse_run(stepped)
    np.testing.assert_array_equal(run[:, 6:], stepped)
    assert np.abs(run[:101, ALTITUDE] - 12_000).max() < 5 and abs(run[400, ALTITUDE] - 13_000) < 20
    assert abs(run[599, AIRSPEED] - 260) < 1 and abs(run[-1, AIRSPEED] - 275) < 1
    # climb rate is the altitude's derivative
    np.testing.assert_allclose(run[100:400, CLIMB].sum() / 60, 1_000, rtol=0.02)


def test_a_pitot_tube_that_reads_high_slows_the_aircraft_by_as_much(jsbsim, calm, level):
    run = AIRCRAFT.run_real(level, [Fault("pitot", 0.6)])[0]
    np.testing.assert_array_equal(run[:ONSET], calm[:ONSET])
    assert run[ONSET, AIRSPEED] == pytest.approx(264, abs=0.1)
    assert np.abs(run[LATE, AIRSPEED] - 260).max() < 0.2  # it reads the target
    slower = level.copy()
    slower[ONSET:, 1] = 256
    # and flies at 256 kt
    pitches = (flight[LATE, PITCH] for flight in (run, AIRCRAFT.run_real(slower)[0]))
    np.testing.assert_allclose(*pitches, atol=0.01)


@pytest.mark.parametrize(
    ("kind", "raised", "lowered", "kept"),
    [
        ("left engine", {RIGHT: 5}, {LEFT: 5}, {AIRSPEED: 0.5, ALTITUDE: 5}),
        ("both engines", {LEFT: 2, RIGHT: 2}, {}, {AIRSPEED: 0.5, ALTITUDE: 5, PITCH: 0.05}),
        ("icing", {LEFT: 4, RIGHT: 4, PITCH: 0.8}, {}, {AIRSPEED: 0.5, ALTITUDE: 10}),
        ("fuel leak", {}, {LEFT: 1, RIGHT: 1, PITCH: 0.1}, {AIRSPEED: 0.5, ALTITUDE: 5}),
        # once the autopilot has trimmed again
        ("elevator", {}, {}, {AIRSPEED: 0.5, ALTITUDE: 30, PITCH: 0.05, LEFT: 1}),
    ],
)
def test_a_fault_changes_the_channels_that_physics_says_and_nothing_before(
    calm, run_with, kind, raised, lowered, kept
):
    run = run_with(kind)
    np.testing.assert_array_equal(run[: ONSET + 1], calm[: ONSET + 1])
    assert np.abs(run - calm)[ONSET + 1 :].max() > 0.05
    change = (run - calm)[LATE].mean(0)
    for channel, least in raised.items():
        assert change[channel] > least, channel
    for channel, least in lowered.items():
        assert change[channel] < -least, channel
    for channel, most in kept.items():
        assert abs(change[channel]) < most, channel


def test_lags_of_the_point_mass_have_their_closed_form(level):
    constants, commands = aircraft_point_mass.Constants(), level.copy()
    commands[100:] = 16_000, 275  # so far above that the climb rate stays at its limit for a minute
    run = coarse_run(commands)
    expected = 275 - 15 * np.exp(-np.arange(UNIT_SAMPLES - 100) / constants.speed_s)
    np.testing.assert_allclose(run[100:, AIRSPEED], expected, atol=1e-3)
    limit = 60 * aircraft_point_mass.MOST_CLIMB
    climb = limit * (1 - np.exp(-np.arange(60) / constants.climb_s))
    np.testing.assert_allclose(run[100:160, CLIMB], climb, rtol=1e-4, atol=1e-3)


def test_pitch_of_the_point_mass_in_level_flight_by_hand(level):
    lift = 141_000 / (0.5 * 0.0023769 * (260 * 1.6878) ** 2 * 1_317)  # lift coefficient
    by_hand = np.rad2deg(lift / (2 * np.pi * 9.4 / 11.4)) - 2
    pitch = coarse_run(level)[:, PITCH]
    np.testing.assert_allclose(pitch, by_hand, rtol=1e-5)


def test_commands_stay_within_their_limits_and_step_every_90_seconds():
    commands = AIRCRAFT.draw_commands(40, np.random.default_rng(0)).reshape(40, UNIT_SAMPLES, 2)
    for values, low, high, largest in zip(
        np.moveaxis(commands, 2, 0), (8_000, 230), (16_000, 290), (1_600, 21), strict=True
    ):
        steps = np.abs(np.diff(values, axis=1))
        assert low <= values.min() and values.max() <= high and steps.max() <= largest
        assert UNIT_SAMPLES / np.count_nonzero(steps, axis=1).mean() == pytest.approx(90, rel=0.15)


def test_a_fault_has_its_size_at_the_end_and_no_other_grows_with_it():
    for fault in ALL:
        sizes = sizes_over_flight(fault)
        assert sizes[fault.kind][-1] == pytest.approx(fault.size)
        assert not any(values[:ONSET].any() for values in sizes.values())
        assert [kind for kind, values in sizes.items() if values.any()] == [fault.kind]


def test_errors_are_one_line(monkeypatch, jsbsim, level):
    with pytest.raises(InputError, match="60 kt"):
        AIRCRAFT.run_real(np.tile([12_000.0, 60.0], (UNIT_SAMPLES, 1)))
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    aircraft_flight.import_jsbsim.cache_clear()
    with pytest.raises(InputError, match="enhsim_tf\\[aircraft\\]"):
        aircraft_flight.import_jsbsim()


def test_the_example_is_written_again_as_it_is(jsbsim, tmp_path):
    tables = functools.partial(example.tables, num_flights=1)
    assert example_command("reference_or_source", "aircraft", tables, [str(tmp_path)]) == 0
    # draws of the telemetry depend on the number of flights
    for name in ("simulator", "telemetry_fault", "simulator_planned"):
        table = pd.read_csv(tmp_path / f"{name}.csv")
        shipped = pd.read_csv(FOLDER / f"{name}.csv")[:UNIT_SAMPLES]
        assert list(table) == list(shipped)
        # another processor may round a few values to the next step
        assert np.mean(table.to_numpy() == shipped.to_numpy()) > 0.99
