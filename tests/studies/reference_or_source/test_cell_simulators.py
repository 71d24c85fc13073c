"""Closed forms of the coarse simulators of a cell. The single-particle model is skipped without
PyBaMM.
"""

import numpy as np
import pytest

from studies.reference_or_source.cell_simulators import (
    CAPACITY_AH,
    HEAT_CAPACITY,
    HEAT_TRANSFER,
    RESISTANCE_OHM,
    SIMULATORS,
    SLOW_S,
    SLOW_SHARE,
    circuit,
    counted_charge,
    fit_values,
    open_circuit_curve,
    single_particle,
)
from studies.reference_or_source.real_cells import INTERVAL_S, KNOWN, AgeingCell, Discharge

SECONDS = np.arange(200) * INTERVAL_S
CURRENT = np.full(200, 2.0)


def line(taken):
    """An open-circuit voltage that falls in proportion to the charge."""
    return 4.2 - taken


@pytest.fixture(scope="module")
def pybamm():
    return pytest.importorskip(
        "pybamm", reason="PyBaMM is an optional extra: pip install 'enhsim_tf[battery]'"
    )


def test_counted_charge_is_the_integral_of_the_current():
    volts = counted_charge(CURRENT, 24.0, (1.5, 1e-9, 1.0), line)[:, 0]
    assert volts == pytest.approx(4.2 - 2.0 * SECONDS / 3600 / (1.5 * CAPACITY_AH))


def test_the_circuit_answers_a_step_of_the_current_as_its_closed_form():
    volts = circuit(CURRENT, 24.0, (1e12, 2.0, 1.0), line)[:, 0]
    resistance = 2.0 * RESISTANCE_OHM
    rise = (1 - SLOW_SHARE) + SLOW_SHARE * (1 - np.exp(-SECONDS / SLOW_S))
    assert 4.2 - volts == pytest.approx(2.0 * resistance * rise)


@pytest.mark.parametrize("simulator", [counted_charge, circuit])
def test_the_temperature_approaches_what_heat_and_its_transfer_balance(simulator):
    celsius = simulator(CURRENT, 24.0, (1.0, 1.0, 2.0), line)[:, 1]
    transfer = 2 * HEAT_TRANSFER
    balance = RESISTANCE_OHM * 2.0**2 / transfer
    assert celsius == pytest.approx(
        24 + balance * (1 - np.exp(-SECONDS * transfer / HEAT_CAPACITY))
    )


def test_a_cell_of_half_the_capacity_has_the_same_voltage_at_half_the_current(pybamm):
    whole, half = (
        single_particle(share * CURRENT, 24.0, (share, 1.0, 1.0), line) for share in (1.0, 0.5)
    )
    assert half == pytest.approx(whole, rel=1e-4)


def test_an_empty_single_particle_model_keeps_its_last_values(pybamm):
    run = single_particle(np.full(600, 2.0), 24.0, (1.0, 1.0, 1.0), line)
    assert np.isfinite(run).all() and np.ptp(run[-50:], axis=0) == pytest.approx([0, 0])


def discharge(values, number=0):
    return Discharge(number, values, 1.0, True, KNOWN)


@pytest.mark.parametrize("name", SIMULATORS)
def test_a_fit_finds_the_factors_with_which_telemetry_was_made(name):
    if name == "single particle":
        pytest.importorskip("pybamm", reason="PyBaMM is an optional extra")
    truth = np.array([0.9, 1.4, 0.7])
    run = SIMULATORS[name](CURRENT, 24.0, truth, line)
    known = [discharge(np.column_stack([run, CURRENT]))]
    assert fit_values(SIMULATORS[name], known, 24.0, line) == pytest.approx(truth, rel=0.02)


def test_the_curve_is_that_of_the_slowest_discharge_of_another_group_less_its_drop():
    cells = []
    for group, amperes in (("a", 1.0), ("b", 2.0), ("c", 4.0)):
        current = np.full(101, amperes)
        values = np.column_stack([np.linspace(4.0, 3.0, 101), current, current])
        cells.append(AgeingCell(group, group, 24.0, (discharge(values),)))
    assert open_circuit_curve(cells, "b")(np.array([1 / 101, 1.0])) == pytest.approx([4.1, 3.1])
    assert open_circuit_curve(cells, "a")(np.array([1.0])) == pytest.approx([3.2])
