"""Physical oracles of both simulators. They need PyBaMM, and are skipped without it."""

import importlib.util
import os

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from studies.battery import simulate as module
from studies.battery.faults import Fault
from studies.battery.orbits import REGIMES
from studies.battery.simulate import MODELS, simulate, simulate_all

os.environ["PYBAMM_DISABLE_TELEMETRY"] = "true"  # before PyBaMM is imported
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("pybamm") is None,
        reason="PyBaMM is an optional extra: pip install 'enhsim_tf[battery]'",
    ),
]

GENTLE = REGIMES["gentle"]
SHORT = 240  # samples
VOLTS, AMPERES, CELSIUS = range(3)


@pytest.fixture(scope="module")
def pulses():
    """Voltages and temperatures of both simulators for a current with steps, nominal and under
    three faults from sample 120.
    """
    current = np.where(np.arange(SHORT) % 60 < 30, 3.0, -1.0)
    faults = [
        None,
        Fault("raised resistance", 1.0),
        Fault("lost capacity", 1.0),
        Fault("poor heat transfer", 1.0),
    ]
    return current, {
        model: simulate(MODELS[model], current, GENTLE, faults, onset=120) for model in MODELS
    }


def test_nothing_is_reported_to_anyone():
    import pybamm

    module.import_pybamm()
    assert pybamm.config.check_opt_out()
    assert pybamm.telemetry._posthog.disabled


def test_faults_change_nothing_before_their_onset(pulses):
    _, runs = pulses
    for nominal, *faulty in runs.values():
        for run in faulty:
            np.testing.assert_allclose(run[:120], nominal[:120], atol=2e-4)
            assert np.abs(run[126:] - nominal[126:]).max() > 0.002


def test_added_resistance_lowers_the_voltage_by_ohms_law(pulses):
    current, runs = pulses
    for nominal, raised, *_ in runs.values():
        drop = nominal[130:150, VOLTS] - raised[130:150, VOLTS]
        # its heat, which helps the kinetics, is the rest
        np.testing.assert_allclose(drop, 0.032 * current[130:150], rtol=0.04)


def test_a_cell_without_current_keeps_its_voltage_and_the_temperature_around_it():
    for model, celsius in (("coarse", 25.0), ("fine", 15.0)):
        (run,) = simulate(MODELS[model], np.zeros(60), GENTLE, [None], onset=10)
        assert np.ptp(run[:, VOLTS]) < 1e-3
        np.testing.assert_allclose(run[:, CELSIUS], celsius, atol=0.01)


def test_a_failed_run_is_repeated_with_less_current(monkeypatch):
    def failing(model, current, regime, faults, onset):
        return [
            np.full((len(current), 3), current[0])
            if current[0] < largest or fault is None
            else None
            for fault in faults
        ]

    monkeypatch.setattr(module, "simulate", failing)
    monkeypatch.setattr(module, "battery_current", lambda load, regime: np.ones(5))
    largest = 0.85
    nominal, faulty = simulate_all(np.zeros(5), GENTLE, [None, Fault("lost capacity", 1.0)])
    assert [run[0, 0] for run in nominal] == [1, 1] and [
        run[0, 0] for run in faulty
    ] == pytest.approx([0.81, 0.81])
    largest = 0.0
    with pytest.raises(InputError, match="Expected loads that the solver can follow"):
        simulate_all(np.zeros(5), GENTLE, [Fault("lost capacity", 1.0)])
