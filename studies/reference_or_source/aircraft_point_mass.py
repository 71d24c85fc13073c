"""The aircraft's crude coarse simulator: a point mass with textbook constants, which an engineer
could write in an afternoon.

Climb rate and airspeed follow their targets with first-order lags. The thrust is what the sum of
forces asks for, at a parabolic drag polar and a constant lift slope, and N1 follows it with a lag.
Its constants are those of textbooks, unless they are fitted to telemetry.
"""

import dataclasses

import numpy as np

from studies.reference_or_source.aircraft_faults import ICE_DRAG, ICE_LB, UNIT_SAMPLES


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


def simulate(
    targets: np.ndarray,
    sizes: dict[str, np.ndarray],
    has_climb_lag: bool = True,
    constants: Constants = Constants(),
) -> np.ndarray:
    """Simulates flights, each of which starts level at its first targets.

    Args:
        targets: Altitude in feet and airspeed in knots, shape `(flights, UNIT_SAMPLES, 2)`.
        sizes: Size of every fault at every sample of a flight, see `sizes_over_flight`; the
            elevator's is ignored.
        has_climb_lag: Whether the climb rate follows the wanted one with a lag, or at once.
        constants: Its constants.

    Returns:
        The channels of the aircraft, shape `(flights, UNIT_SAMPLES, 6)`.
    """
    lags = np.array([constants.climb_s, constants.speed_s, constants.engine_s])
    keeps_climb, keeps_speed, keeps_engine = np.exp(-1 / lags) * [has_climb_lag, 1, 1]
    leaked = np.cumsum(sizes["fuel leak"])
    altitude, airspeed = targets[:, 0].T.astype(float)
    climb = np.zeros(len(targets))
    change = np.zeros(len(targets))
    engines = None
    found = np.empty((*targets.shape[:2], 6))
    for sample in range(UNIT_SAMPLES):
        pitot = sizes["pitot"][sample]
        ice = sizes["icing"][sample]
        weight = _WEIGHT_LB - leaked[sample] + ice * ICE_LB
        # as a share of that at sea level, in the standard atmosphere
        density = (1 - 6.8756e-6 * altitude) ** 4.2559
        pressure = 0.5 * _AIR * (airspeed * _KNOT) ** 2 * _WING_SQFT  # dynamic pressure and wing
        path = climb / (airspeed * _KNOT / np.sqrt(density))
        lift = weight / pressure
        drag = (
            constants.drag + ice * ICE_DRAG + lift**2 / (np.pi * _ASPECT_RATIO * _SPAN_EFFICIENCY)
        )
        force = drag * pressure + weight * (path + change * _KNOT / np.sqrt(density) / _GRAVITY)
        at_full = _THRUST_LB * density * (1 - sizes["both engines"][sample])
        shares = np.array([1 - sizes["left engine"][sample], 1.0])
        throttle = np.minimum(np.sqrt(np.maximum(force, 0) / at_full * 2 / (shares**2).sum()), 1.0)
        wanted_engines = _IDLE_N1 + (100 - _IDLE_N1) * throttle * shares[:, None]
        engines = (
            wanted_engines
            if engines is None
            else wanted_engines + (engines - wanted_engines) * keeps_engine
        )
        pitch = path + lift / (1 - ice) / _LIFT_SLOPE + _ZERO_LIFT_PITCH
        found[:, sample] = np.stack(
            [airspeed + pitot, 60 * climb, np.rad2deg(pitch), *engines, altitude], axis=1
        )

        wanted_climb = np.clip(
            (targets[:, sample, 0] - altitude) / constants.altitude_s, -MOST_CLIMB, MOST_CLIMB
        )
        climb = wanted_climb + (climb - wanted_climb) * keeps_climb
        altitude = altitude + climb
        change = (targets[:, sample, 1] - airspeed - pitot) * (1 - keeps_speed)
        airspeed = airspeed + change
    return found
