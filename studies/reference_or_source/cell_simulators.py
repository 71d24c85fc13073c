"""Coarse simulators of a real cell under a load: counted charge, a circuit, and a single-particle
model.

Each has three parameters that can be fitted to known discharges: capacity, resistance and heat
transfer, as factors of what a textbook or data sheet says.
"""

import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from studies.battery.orbits import CAPACITY_AH as PUBLISHED_AH
from studies.battery.simulate import import_pybamm
from studies.reference_or_source.real_cells import (
    COLUMNS,
    INTERVAL_S,
    KNOWN,
    AgeingCell,
    Discharge,
)
from studies.reference_or_source.recordings import errors_of

CAPACITY_AH = 2.0
RESISTANCE_OHM = 0.1
"""Capacity of a cell by its data sheet, and the resistance of an 18650 cell of that time."""
SLOW_SHARE = 0.3
SLOW_S = 60.0
"""Share of the resistance that a capacitor bridges in the circuit, and its time constant."""
HEAT_CAPACITY = 45.0
HEAT_TRANSFER = 0.042
"""Heat capacity of 45 g in joules per kelvin; heat transfer of a surface of 42 square centimetres
in still air (10 W per square metre and kelvin) in watts per kelvin.
"""
FIRST_VALUES = np.ones(3)
BOUNDS = (0.3, 3.0)
"""Factors of capacity, resistance and heat transfer, and their limits in a fit."""
_FITTED_TO = slice(None, None, 3)  # of the known discharges
_EMPTY_V = 1.0  # the single-particle model stops here
_ZERO_K = 273.15

Curve = Callable[[np.ndarray], np.ndarray]
Simulator = Callable[[np.ndarray, float, Sequence[float], Curve], np.ndarray]


def open_circuit_curve(cells: Sequence[AgeingCell], group: str) -> Curve:
    """The open-circuit voltage over the share of the charge that was taken.

    There is no slow discharge. The slowest known one outside of the group is taken, if there is
    another group, its voltage raised by the drop over the resistance.
    """
    others = [cell for cell in cells if cell.group != group] or cells
    known = [discharge for cell in others for discharge in cell.of_use(KNOWN)]
    slowest = min(known, key=lambda discharge: discharge.values[:, 2].mean())
    volts, _, current = slowest.values.T
    charge = np.cumsum(current) / np.sum(current)
    return lambda taken: np.interp(taken, charge, volts + RESISTANCE_OHM * current)


def temperature(heat_w: np.ndarray, ambient_c: float, transfer: float) -> np.ndarray:
    """The temperature of a lump that begins at that of the room, for heat that is constant over
    each step: the exact solution at the beginning of each step.
    """
    decay = np.exp(-INTERVAL_S * transfer / HEAT_CAPACITY)
    return ambient_c + _lagged(heat_w / transfer, decay)


def circuit(
    current: np.ndarray,
    ambient_c: float,
    values: Sequence[float],
    curve: Curve,
    slow_share: float = SLOW_SHARE,
) -> np.ndarray:
    """Open-circuit voltage at the counted charge less the drop over a resistance, of which a
    capacitor bridges a share; see `SIMULATORS`.
    """
    capacity, resistance, transfer = _physical(values)
    slow = resistance * slow_share * _lagged(current, np.exp(-INTERVAL_S / SLOW_S))
    volts = curve(_taken(current, capacity)) - resistance * (1 - slow_share) * current - slow
    return np.stack([volts, temperature(resistance * current**2, ambient_c, transfer)], axis=1)


counted_charge = functools.partial(circuit, slow_share=0.0)
"""The circuit without a capacitor."""


def single_particle(
    current: np.ndarray, ambient_c: float, values: Sequence[float], curve: Curve
) -> np.ndarray:
    """PyBaMM's single-particle model of the cell of Chen et al. (2020), 5 Ah, of which the cell
    here is the share that its capacity is; see `SIMULATORS`.

    It is driven by the mean current, as discharges are at constant current. The resistance of its contacts
    is 0 as published; a factor of the resistance beyond 1 adds to it. Once empty, it keeps its last values.
    """
    capacity, resistance, _ = _physical(values)
    clock = np.arange(len(current)) * INTERVAL_S
    simulation = _single_particle_model()
    inputs = {
        "current": float(np.mean(current)) * PUBLISHED_AH / capacity,
        "contact": (resistance - RESISTANCE_OHM) * capacity / PUBLISHED_AH,
        "transfer": 10.0 * float(values[2]),
        "ambient": ambient_c + _ZERO_K,
    }
    solution = simulation.solve([0.0, clock[-1]], t_interp=clock, inputs=inputs)
    seconds = solution.t
    run = [
        np.interp(clock, seconds, solution[name].data)
        for name in ("Voltage [V]", "Volume-averaged cell temperature [K]")
    ]
    return np.stack([run[0], run[1] - _ZERO_K], axis=1)


SIMULATORS: Mapping[str, Simulator] = {
    "single particle": single_particle,
    "circuit": circuit,
    "counted charge": counted_charge,
}
"""The coarse simulators, functions with these arguments:

- current: current in amperes on the grid, shape `(samples,)`, positive while the cell discharges;
- ambient_c: temperature of the room in degrees Celsius;
- values: factors of capacity, resistance and heat transfer;
- curve: open-circuit voltage, see `open_circuit_curve`.

They return voltage and temperature, shape `(samples, 2)`.
"""


def fit_values(
    simulator: Simulator, discharges: Sequence[Discharge], ambient_c: float, curve: Curve
) -> np.ndarray:
    """Fits the three factors by least squares to every third of some known discharges."""
    some = discharges[_FITTED_TO]
    number = COLUMNS.index("current")
    telemetry = np.concatenate([discharge.values[:, :number] for discharge in some])

    def errors(logarithms: np.ndarray) -> np.ndarray:
        values = np.exp(logarithms)
        runs = [
            simulator(discharge.values[:, number], ambient_c, values, curve) for discharge in some
        ]
        return errors_of(np.concatenate(runs), telemetry)

    low, high = np.log(BOUNDS)
    fitted = least_squares(
        errors, np.log(FIRST_VALUES), diff_step=0.02, bounds=(low, high), max_nfev=30, x_scale=0.1
    )
    return np.exp(fitted.x)


def _physical(values: Sequence[float]) -> tuple[float, float, float]:
    capacity, resistance, transfer = values
    return capacity * CAPACITY_AH, resistance * RESISTANCE_OHM, transfer * HEAT_TRANSFER


def _taken(current: np.ndarray, capacity_ah: float) -> np.ndarray:
    """The share of the charge that was taken before each sample."""
    return np.concatenate([[0.0], np.cumsum(current)[:-1]]) * INTERVAL_S / 3600 / capacity_ah


def _lagged(values: np.ndarray, decay: float) -> np.ndarray:
    """The first-order lag of values that are constant over each step, 0 at the first one."""
    return lfilter([0.0, 1 - decay], [1.0, -decay], values)


@functools.cache
def _single_particle_model() -> object:
    """The model, built once; current, heat transfer and temperature of the room are inputs."""
    pybamm = import_pybamm()
    values = pybamm.ParameterValues("Chen2020")
    values["Current function [A]"] = pybamm.InputParameter("current")
    values["Total heat transfer coefficient [W.m-2.K-1]"] = pybamm.InputParameter("transfer")
    values["Contact resistance [Ohm]"] = pybamm.InputParameter("contact")
    for name in ("Ambient temperature [K]", "Initial temperature [K]"):
        values[name] = pybamm.InputParameter("ambient")
    values["Lower voltage cut-off [V]"] = _EMPTY_V
    return pybamm.Simulation(
        pybamm.lithium_ion.SPM({"thermal": "lumped", "contact resistance": "true"}),
        parameter_values=values,
        solver=pybamm.IDAKLUSolver(rtol=1e-6, atol=1e-6),
    )
