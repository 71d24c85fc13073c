"""The aircraft's fine simulator: an Airbus A320 in JSBSim (Berndt 2004) with an autopilot, for one
flight.

The autopilot follows targets of altitude and airspeed, and keeps wings and heading level. Altitude
error gives a wanted climb rate; the wanted flight-path angle gives a pitch, and the pitch error an
elevator. The airspeed error gives a throttle, with a lead for the climb. It flies by the readings
of its sensors.
"""

import functools
import itertools
import math
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from studies.reference_or_source.aircraft_faults import ICE_DRAG, ICE_LB, UNIT_SAMPLES

CONTROLS_A_SECOND = 10
"""How often the autopilot acts; the wind changes as often."""
MOST_CLIMB = 25.0
MOST_ACCELERATION = 0.6
"""Largest climb rate in feet a second and acceleration in knots a second that the autopilot asks
for.
"""
# time constants: error of altitude to climb rate, its smoothing, the airspeed's smoothing
_ALTITUDE_S = 15.0
_CLIMB_S = 3.0
_SEEN_S = 1.0
_MOST_SPEED_ERROR = 8.0  # knots, to which the throttle answers
_STEPS_A_CONTROL = 3  # 30 steps of the simulator a second
# as in JSBSim's description of the A320
_WING_SQFT = 1_317.0
_DRAG_OF_SPEEDBRAKE = 0.04  # drag coefficient of the whole speed brake, which stands for other drag
# standard deviation in feet a second and correlation time in seconds, along and vertical
_WINDS = ((1.0, 8.0), (0.8, 4.0))

_READ = (
    "position/h-sl-ft", "velocities/h-dot-fps", "velocities/vc-kts", "velocities/vtrue-fps", "attitude/theta-rad", "velocities/q-rad_sec",
    "attitude/phi-rad", "velocities/p-rad_sec", "attitude/psi-rad", "propulsion/engine[0]/n1", "propulsion/engine[1]/n1",
)  # fmt: skip
_WRITTEN = (
    "fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm", "fcs/throttle-cmd-norm[0]", "fcs/throttle-cmd-norm[1]", "atmosphere/gust-north-fps",
    "atmosphere/gust-down-fps",
)  # fmt: skip


@functools.cache
def import_jsbsim() -> Any:
    """Imports JSBSim, silenced.

    Raises:
        InputError: If it is not installed.
    """
    try:
        import jsbsim
    except ImportError:
        raise InputError(
            "Expected JSBSim, which simulates the aircraft. Received: no such package. Install it: "
            "pip install 'enhsim_tf[aircraft]'."
        ) from None
    # before the first simulator, whose banner is printed at its birth
    jsbsim.FGJSBBase().debug_lvl = 0
    return jsbsim


def draw_wind(rng: np.random.Generator) -> np.ndarray:
    """Draws light turbulence over one flight, first-order Gauss-Markov processes.

    Returns:
        Wind along the heading and vertical wind in feet a second, shape `(UNIT_SAMPLES *
        CONTROLS_A_SECOND, 2)`.
    """
    from studies.common.noise_processes import first_order

    number = UNIT_SAMPLES * CONTROLS_A_SECOND
    return np.stack(
        [
            sd * first_order(number, np.exp(-1 / (time_s * CONTROLS_A_SECOND)), rng)
            for sd, time_s in _WINDS
        ],
        axis=1,
    )


def fly(targets: np.ndarray, wind: np.ndarray | None, sizes: dict[str, np.ndarray]) -> np.ndarray:
    """Simulates one flight, which starts trimmed at its first targets.

    Args:
        targets: Altitude in feet and airspeed in knots, shape `(UNIT_SAMPLES, 2)`; each holds for
            the second after its sample.
        wind: As `draw_wind` returns it; None for calm air.
        sizes: Size of every fault at every sample, see `sizes_over_flight`.

    Returns:
        Airspeed as it reads in knots, climb rate in feet a minute, pitch in degrees, N1 left and
        right in percent and altitude in feet, shape `(UNIT_SAMPLES, 6)`. They are the state at the
        start of the second in which the target of the sample holds.

    Raises:
        InputError: If JSBSim is not installed, or cannot trim the aircraft at the first targets.
    """
    model = _trimmed(*targets[0].tolist())
    nodes = model.get_property_manager()
    (
        altitude,
        climb,
        airspeed,
        true_speed,
        pitch,
        pitch_rate,
        roll,
        roll_rate,
        heading,
        n1_left,
        n1_right,
    ) = (nodes.get_node(name).get_double_value for name in _READ)
    put_elevator, put_aileron, put_left, put_right, put_along, put_down = (
        nodes.get_node(name).set_double_value for name in _WRITTEN
    )
    trimmed_elevator = model["fcs/pitch-trim-cmd-norm"]
    trimmed_throttle = model["fcs/throttle-cmd-norm"]
    # the elevator's command holds the trim, so that a fault of the elevator reaches it
    model["fcs/pitch-trim-cmd-norm"] = 0.0
    trimmed_pitch = pitch()
    wanted_speed = airspeed()
    seen_speed = airspeed()
    wanted_climb = path_sum = speed_sum = 0.0
    dt = 1 / CONTROLS_A_SECOND
    found = np.empty((UNIT_SAMPLES, 6))
    winds = itertools.repeat((0.0, 0.0)) if wind is None else iter(wind.tolist())
    for sample, (target_altitude, target_speed) in enumerate(targets.tolist()):
        size = {kind: float(values[sample]) for kind, values in sizes.items()}
        found[sample] = (
            airspeed() + size["pitot"],
            60 * climb(),
            math.degrees(pitch()),
            n1_left(),
            n1_right(),
            altitude(),
        )
        _apply(model, size, size["icing"] - sizes["icing"][max(sample - 1, 0)])
        for _ in range(CONTROLS_A_SECOND):
            wanted = _limit((target_altitude - altitude()) / _ALTITUDE_S, MOST_CLIMB)
            wanted_climb += (wanted - wanted_climb) * dt / _CLIMB_S
            speed = true_speed()
            path_error = (wanted_climb - climb()) / speed
            path_sum += path_error * dt
            wanted_pitch = (
                trimmed_pitch + wanted_climb / speed + (0.5 * path_error + 0.15 * path_sum)
            )
            wanted_elevator = trimmed_elevator + (
                3.0 * (pitch() - wanted_pitch) + 3.0 * pitch_rate()
            )
            put_elevator((1 - size["elevator"]) * wanted_elevator)
            put_aileron(-roll() - roll_rate() - 0.5 * math.sin(heading()))
            seen_speed += (airspeed() + size["pitot"] - seen_speed) * dt / _SEEN_S
            wanted_speed += _limit(target_speed - wanted_speed, MOST_ACCELERATION * dt)
            speed_error = _limit(wanted_speed - seen_speed, _MOST_SPEED_ERROR)
            throttle = (
                trimmed_throttle + (0.025 * speed_error + 0.0025 * speed_sum) + 0.009 * wanted_climb
            )
            if 0 < throttle < 1:  # the sum waits while the throttle is at its stop
                speed_sum += speed_error * dt
            throttle = min(max(throttle, 0.0), 1.0)
            put_left(throttle * (1 - size["left engine"]))
            put_right(throttle)
            along, down = next(winds)
            put_along(along)
            put_down(down)
            for _ in range(_STEPS_A_CONTROL):
                model.run()
    return found


def _limit(value: float, most: float) -> float:
    """Limits a value to `-most` to `most`."""
    return min(max(value, -most), most)


def _trimmed(altitude_ft: float, airspeed_kt: float) -> Any:
    """Returns a simulator of its own, so that flights are independent, that is trimmed for level
    flight to the north.
    """
    jsbsim = import_jsbsim()
    model = jsbsim.FGFDMExec(None)
    model.set_debug_level(0)
    model.load_model("A320")
    model.set_dt(1 / (CONTROLS_A_SECOND * _STEPS_A_CONTROL))
    start = {
        "ic/h-sl-ft": altitude_ft,
        "ic/vc-kts": airspeed_kt,
        "ic/gamma-deg": 0.0,
        "ic/psi-true-deg": 0.0,
    }
    gear = {"gear/gear-cmd-norm": 0.0, "gear/gear-pos-norm": 0.0}
    for name, value in (start | gear).items():
        model[name] = value
    model.run_ic()
    model["propulsion/set-running"] = -1
    try:
        model["simulation/do_simple_trim"] = 1
    except jsbsim.TrimFailureError:
        raise InputError(
            f"Expected first targets at which an A320 flies level. Received: {altitude_ft:.0f} ft "
            f"and {airspeed_kt:.0f} kt. Change them."
        ) from None
    return model


def _apply(model: Any, size: dict[str, float], new_ice: float) -> None:
    """Sets what faults of these sizes change in the simulator beside its controls."""
    for side in (0, 1):
        model[f"propulsion/engine[{side}]/bleed-factor"] = size["both engines"]
        if new_ice:  # the tanks carry its weight: JSBSim's A320 has no other weight that can change
            model[f"propulsion/tank[{side}]/contents-lbs"] += new_ice * ICE_LB / 2
    model["propulsion/tank[0]/external-flow-rate-pps"] = -size["fuel leak"]
    model["metrics/Sw-sqft"] = _WING_SQFT * (1 - size["icing"])
    model["fcs/speedbrake-cmd-norm"] = size["icing"] * ICE_DRAG / _DRAG_OF_SPEEDBRAKE
