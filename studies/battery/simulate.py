"""The coarse and the fine simulator of the battery, in PyBaMM (Sulzer et al. 2021), without any
report of its use.

The coarse simulator is a single-particle model (SPM) with the published parameters of Chen et al.
(2020), at 25 degrees Celsius. The fine one is a Doyle-Fuller-Newman model (DFN) of a vehicle that
differs from them. Both have a lumped thermal model. Faults are inputs that begin at a given sample,
so that one model serves all of them.
"""

import dataclasses
import functools
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError
from studies.battery.faults import Fault, drift_under, load_under, simulator_inputs
from studies.battery.orbits import FIRST_CHARGE, INTERVAL_S, ORBIT_SAMPLES, Regime, battery_current

COLUMNS = ("volts", "amperes", "celsius")
"""Columns of a recorded run."""
ONSET = ORBIT_SAMPLES
"""First sample of a fault: runs begin with a nominal orbit, in which the battery also reaches its
usual temperature.
"""


@dataclasses.dataclass(frozen=True)
class Model:
    """A model of the battery. Without arguments, it is the published one at 25 degrees Celsius.

    Args:
        physics: Name of the model in PyBaMM.
        resistance: Contact resistance in ohms.
        lost_material: Lost share of the active material of both electrodes.
        lost_heat_transfer: Lost share of the heat transfer.
        diffusion: Diffusivity of lithium in the negative electrode's particles, as a share of the
            published value.
        follows_ambient: Whether it knows the temperature of the regime.
    """

    physics: str = "SPM"
    resistance: float = 0.0
    lost_material: float = 0.0
    lost_heat_transfer: float = 0.0
    diffusion: float = 1.0
    follows_ambient: bool = False


COARSE = Model()
VEHICLE = Model("DFN", 0.008, 0.04, 0.4, 0.7, follows_ambient=True)
MODELS = {"coarse": COARSE, "fine": VEHICLE}
"""The coarse simulator, and the fine one, whose battery differs from the published one."""
_PUBLISHED_K = 298.15
_ZERO_K = 273.15
_ONSET_S = 60.0  # a fault grows to its full size in this time
_MESH = {"x_n": 10, "x_s": 8, "x_p": 10, "r_n": 12, "r_p": 12}
_TOLERANCES = {"rtol": 1e-4, "atol": 1e-5}
_VOLTAGE = "Terminal voltage [V]"
_TEMPERATURE = "Volume-averaged cell temperature [K]"
_LIMITS_V = (1.0, 5.5)  # wider than the cell's, so that the solver passes over short excursions
_KINK_A = 0.2  # where the slope of the current changes by more than this, the solver makes a step
# after a failure of a solver, the current is multiplied by this, at most so often
_REDUCTION = 0.9
_MOST_REDUCTIONS = 8


@functools.cache
def import_pybamm() -> Any:
    """Imports PyBaMM with its usage reports switched off, which it looks up when it is imported.

    Raises:
        InputError: If it is not installed.
    """
    os.environ["PYBAMM_DISABLE_TELEMETRY"] = "true"
    try:
        import pybamm
    except ImportError:
        raise InputError(
            "Expected PyBaMM, which simulates the battery. Received: no such package. Install it: "
            "pip install 'enhsim_tf[battery]'."
        ) from None
    pybamm.telemetry.disable()  # in case another module imported it first
    pybamm.set_logging_level("ERROR")
    return pybamm


def simulate(
    model: Model,
    current: np.ndarray,
    regime: Regime,
    faults: Sequence[Fault | None],
    onset: int = ONSET,
) -> list[np.ndarray | None]:
    """Runs one simulator over a current, once for each fault.

    Args:
        model: The model.
        current: Current in amperes on the clock of `INTERVAL_S`, shape `(samples,)`; positive
            discharges the battery.
        regime: How hard the battery is used.
        faults: The faults, None for nominal. A payload that is stuck on must be in the current
            already.
        onset: First sample of each fault.

    Returns:
        For each fault a float32 run of shape `(samples, 3)` with `COLUMNS`, or None where the
        solver failed.

    Raises:
        InputError: If PyBaMM is not installed.
    """
    pybamm = import_pybamm()
    clock = np.arange(len(current)) * INTERVAL_S
    begun = onset * INTERVAL_S
    kinks = clock[np.flatnonzero(np.abs(np.diff(current, 2)) > _KINK_A) + 1]
    stops = np.unique([0.0, *kinks, begun, begun + _ONSET_S, clock[-1]])
    stops = stops[stops <= clock[-1]]
    simulation = _build(model, current, clock, regime, begun)

    def run_under(fault: Fault | None) -> np.ndarray | None:
        try:
            solution = simulation.solve(stops, t_interp=clock, inputs=simulator_inputs(fault))
            times = solution.t
            volts = solution[_VOLTAGE].data
            kelvins = solution[_TEMPERATURE].data
        except pybamm.SolverError:
            return None
        if times[-1] < clock[-1] or not np.isfinite([*volts, *kelvins]).all():  # stopped at a limit
            return None
        volts = np.interp(clock, times, volts) + drift_under(len(clock), fault, onset)
        celsius = np.interp(clock, times, kelvins) - _ZERO_K
        return np.stack([volts, current, celsius], axis=1).astype(np.float32)

    return [run_under(fault) for fault in faults]


def _build(
    model: Model, current: np.ndarray, clock: np.ndarray, regime: Regime, begun: float
) -> Any:
    """Builds a simulation over a current, whose inputs are those of `simulator_inputs`, which act
    from `begun` seconds.
    """
    pybamm = import_pybamm()
    published = pybamm.ParameterValues("Chen2020")
    values = published.copy()
    kelvins = regime.ambient_k if model.follows_ambient else _PUBLISHED_K
    charged = published.copy()
    charged.set_initial_state(FIRST_CHARGE)
    grown = pybamm.Interpolant(
        np.array([-1.0, begun, begun + _ONSET_S, 1e12]), np.array([0.0, 0.0, 1.0, 1.0]), pybamm.t
    )
    added, material, transfer = (
        pybamm.InputParameter(name) * grown for name in simulator_inputs(None)
    )
    values["Contact resistance [Ohm]"] = model.resistance + added
    for electrode in ("Negative", "Positive"):
        share = f"{electrode} electrode active material volume fraction"
        values[share] = published[share] * (1 - model.lost_material) * (1 - material)
        concentration = f"Initial concentration in {electrode.lower()} electrode [mol.m-3]"
        values[concentration] = charged[concentration]
    name = "Total heat transfer coefficient [W.m-2.K-1]"
    values[name] = published[name] * (1 - model.lost_heat_transfer) * (1 - transfer)
    name = "Negative particle diffusivity [m2.s-1]"
    values[name] = published[name] * model.diffusion
    values["Ambient temperature [K]"] = values["Initial temperature [K]"] = kelvins
    values["Lower voltage cut-off [V]"], values["Upper voltage cut-off [V]"] = _LIMITS_V
    values["Current function [A]"] = pybamm.Interpolant(clock, current, pybamm.t)
    build = getattr(pybamm.lithium_ion, model.physics)
    return pybamm.Simulation(
        build({"thermal": "lumped", "contact resistance": "true"}),
        parameter_values=values,
        solver=pybamm.IDAKLUSolver(**_TOLERANCES, output_variables=[_VOLTAGE, _TEMPERATURE]),
        var_pts=_MESH,
    )


def simulate_all(
    load: np.ndarray,
    regime: Regime,
    faults: Sequence[Fault | None],
    models: Sequence[Model] = (COARSE, VEHICLE),
    onset: int = ONSET,
) -> list[tuple[np.ndarray, ...]]:
    """Runs simulators over a load, once for each fault, driven by the same current; returns for
    each fault a run of each.

    Where a solver fails, the current of that run is reduced by a tenth and all simulators run
    again, which is told.

    Args:
        load: Load in amperes, shape `(samples,)`, from the start of an orbit.
        regime: How hard the battery is used.
        faults: The faults, None for nominal.
        models: The simulators.
        onset: First sample of each fault.

    Raises:
        InputError: If PyBaMM is not installed, or a run fails at the smallest current too.
    """
    currents = [battery_current(load_under(load, fault, regime, onset), regime) for fault in faults]
    found: dict[int, tuple[np.ndarray, ...]] = {}
    for number in range(_MOST_REDUCTIONS + 1):
        groups: dict[bytes, list[int]] = {}  # one built model is enough for equal currents
        for place, current in enumerate(currents):
            if place not in found:
                groups.setdefault(current.tobytes(), []).append(place)
        for same in groups.values():
            current = currents[same[0]] * _REDUCTION**number
            chosen = [faults[place] for place in same]
            runs = zip(
                *(simulate(model, current, regime, chosen, onset) for model in models), strict=True
            )
            for place, each in zip(same, runs, strict=True):
                if all(run is not None for run in each):
                    found[place] = each
                else:
                    tell(
                        "a solver failed; the current is reduced to "
                        f"{_REDUCTION ** (number + 1):.2f} of the load's under {faults[place]}"
                    )
        if len(found) == len(faults):
            return [found[place] for place in range(len(faults))]
    failed = next(fault for place, fault in enumerate(faults) if place not in found)
    raise InputError(
        f"Expected loads that the solver can follow. Received: a failure of {failed} at any "
        "current. Reduce the load."
    )
