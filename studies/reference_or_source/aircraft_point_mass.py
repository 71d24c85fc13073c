"""The aircraft's crude coarse simulator: a point mass with textbook constants, which an engineer
could write in an afternoon.

Climb rate and airspeed follow their targets with first-order lags. The thrust is what the sum of
forces asks for, at a parabolic drag polar and a constant lift slope, and N1 follows it with a lag.
Its constants are those of textbooks, unless they are fitted to telemetry.
"""

import dataclasses

import numpy as np

from studies.reference_or_source.aircraft_faults import UNIT_SAMPLES


@dataclasses.dataclass(frozen=True)
class Constants:
    """Constants of the point mass.

    Args:
        climb_s: Time constant of the climb rate, in seconds.
        altitude_s: That of the altitude.
        speed_s: That of the airspeed.
        engine_s: That of N1.
        drag: Drag coefficient at zero lift.
    """

    climb_s: float = 5.0
    altitude_s: float = 20.0
    speed_s: float = 15.0
    engine_s: float = 4.0
    drag: float = 0.02


MOST_CLIMB = 2_000 / 60
"""Largest climb rate, in feet a second."""
_WEIGHT_LB = 141_000.0
_WING_SQFT = 1_317.0
_ASPECT_RATIO = 9.4
_SPAN_EFFICIENCY = 0.8
_LIFT_SLOPE = 2 * np.pi * _ASPECT_RATIO / (_ASPECT_RATIO + 2)  # per radian, of an elliptic wing
_ZERO_LIFT_PITCH = np.deg2rad(-2.0)
# both engines at sea level; thrust goes with the air's density and the square of the throttle
_THRUST_LB = 50_000.0
_IDLE_N1 = 30.0
# feet a second squared; feet a second; slugs a cubic foot at sea level
_GRAVITY = 32.174
_KNOT = 1.6878
_AIR = 0.0023769


def simulate(targets: np.ndarray, constants: Constants) -> np.ndarray:
    """Simulates flights, each of which starts level at its first targets.

    Args:
        targets: Altitude in feet and airspeed in knots, shape `(flights, UNIT_SAMPLES, 2)`.
        constants: Its constants.

    Returns:
        The channels of the aircraft, shape `(flights, UNIT_SAMPLES, 6)`.
    """
    lags = np.array([constants.climb_s, constants.speed_s, constants.engine_s])
    keeps_climb, keeps_speed, keeps_engine = np.exp(-1 / lags)
    altitude, airspeed = targets[:, 0].T.astype(float)
    climb = np.zeros(len(targets))
    change = np.zeros(len(targets))
    found = np.empty((*targets.shape[:2], 6))
    for sample in range(UNIT_SAMPLES):
        # as a share of that at sea level, in the standard atmosphere
        density = (1 - 6.8756e-6 * altitude) ** 4.2559
        pressure = 0.5 * _AIR * (airspeed * _KNOT) ** 2 * _WING_SQFT  # dynamic pressure and wing
        path = climb / (airspeed * _KNOT / np.sqrt(density))
        lift = _WEIGHT_LB / pressure
        drag = constants.drag + lift**2 / (np.pi * _ASPECT_RATIO * _SPAN_EFFICIENCY)
        force = drag * pressure + _WEIGHT_LB * (path + change * _KNOT / np.sqrt(density) / _GRAVITY)
        throttle = np.minimum(np.sqrt(np.maximum(force, 0) / (_THRUST_LB * density)), 1.0)
        wanted_engines = _IDLE_N1 + (100 - _IDLE_N1) * throttle
        if sample == 0:
            engines = wanted_engines
        engines = wanted_engines + (engines - wanted_engines) * keeps_engine
        pitch = path + lift / _LIFT_SLOPE + _ZERO_LIFT_PITCH
        found[:, sample] = np.stack(
            [airspeed, 60 * climb, np.rad2deg(pitch), engines, engines, altitude], axis=1
        )

        wanted_climb = np.clip(
            (targets[:, sample, 0] - altitude) / constants.altitude_s, -MOST_CLIMB, MOST_CLIMB
        )
        climb = wanted_climb + (climb - wanted_climb) * keeps_climb
        altitude = altitude + climb
        change = (targets[:, sample, 1] - airspeed) * (1 - keeps_speed)
        airspeed = airspeed + change
    return found
