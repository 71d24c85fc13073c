"""The current of a satellite's battery over low orbits: bus load, random payload passes, solar
array and charge controller.

An orbit has an hour of sun and 35 minutes of eclipse. The controller counts charge. It reduces the
charging current near the full battery and the load near the empty one. The current therefore does
not depend on the voltage, and the coarse and the fine simulator are driven by the same current.
"""

import dataclasses

import numpy as np

INTERVAL_S = 10.0
"""Interval of the clock, in seconds."""
SUN_SAMPLES = 360
ECLIPSE_SAMPLES = 210
ORBIT_SAMPLES = SUN_SAMPLES + ECLIPSE_SAMPLES
CAPACITY_AH = 5.0
"""Nominal capacity of the cell of Chen et al. (2020), in ampere-hours."""
FIRST_CHARGE = 0.9
"""State of charge at the start of a run, as a share of the capacity."""
# states of charge at which charging and discharging end
_FULL = 0.95
_EMPTY = 0.08
_TAPER_H = 0.15  # time constant, in hours, with which the current falls towards these states
_MOST_PASSES = 3  # payload passes in an orbit; there is at least one
_PASS_SAMPLES = (30, 120)  # shortest and longest pass: 5 and 20 minutes


@dataclasses.dataclass(frozen=True)
class Regime:
    """How hard the battery is used.

    Args:
        ambient_k: Temperature around the vehicle's battery, in kelvin.
        bus_a: Constant load of the bus, in amperes.
        solar_a: Current of the solar array in the sun, in amperes.
        pass_a: Smallest and largest load of a payload pass, in amperes.
        stuck_a: Load of a payload that is stuck on at the largest severity, in amperes.
    """

    ambient_k: float
    bus_a: float
    solar_a: float
    pass_a: tuple[float, float]
    stuck_a: float


REGIMES = {
    "gentle": Regime(ambient_k=288.15, bus_a=1.25, solar_a=3.5, pass_a=(0.5, 2.25), stuck_a=1.0),
    "hard": Regime(ambient_k=268.15, bus_a=2.5, solar_a=7.0, pass_a=(2.0, 6.0), stuck_a=1.5),
}
"""A gentle regime, where the map from the coarse to the fine simulator is nearly linear, and a hard
one: cold, with high currents.
"""


def draw_load(num_orbits: int, regime: Regime, rng: np.random.Generator) -> np.ndarray:
    """Draws the load in amperes, shape `(num_orbits * ORBIT_SAMPLES,)`: the bus and one to three
    payload passes in each orbit.

    The passes have random times; the first orbit begins with the sun.
    """
    load = np.full(num_orbits * ORBIT_SAMPLES, regime.bus_a)
    for orbit in range(num_orbits):
        for _ in range(rng.integers(1, _MOST_PASSES + 1)):
            begin = orbit * ORBIT_SAMPLES + rng.integers(ORBIT_SAMPLES)
            load[begin : begin + rng.integers(_PASS_SAMPLES[0], _PASS_SAMPLES[1] + 1)] += (
                rng.uniform(*regime.pass_a)
            )
    return load


def battery_current(load: np.ndarray, regime: Regime) -> np.ndarray:
    """Computes the current of the battery for a load from the start of an orbit, by counting
    charge.

    Both are in amperes and have the shape `(samples,)`; a positive current discharges the battery.
    """
    solar = np.where(np.arange(len(load)) % ORBIT_SAMPLES < SUN_SAMPLES, regime.solar_a, 0.0)
    current = np.empty(len(load))
    charge = FIRST_CHARGE
    hours = INTERVAL_S / 3600
    for place, wanted in enumerate(load - solar):
        largest = (charge - _EMPTY if wanted > 0 else _FULL - charge) * CAPACITY_AH / _TAPER_H
        current[place] = np.sign(wanted) * min(abs(wanted), max(largest, 0.0))
        charge -= current[place] * hours / CAPACITY_AH
    return current
