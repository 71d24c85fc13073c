"""Faults of the battery, which both simulators can express, and the sensor that turns a simulated
voltage into telemetry.
"""

import numpy as np

from studies.battery.orbits import ORBIT_SAMPLES, Regime
from studies.common import faults as common

SIZES = {
    "raised resistance": (0.002, 0.004, 0.008, 0.016, 0.032),
    "lost capacity": (0.02, 0.05, 0.1, 0.15, 0.2),
    "poor heat transfer": (0.2, 0.4, 0.6, 0.75, 0.9),
    "drifting sensor": (0.005, 0.01, 0.02, 0.04, 0.08),
    "payload stuck on": (0.2, 0.4, 0.6, 0.8, 1.0),
}
"""For each fault its size at each of `common.SEVERITIES`: added resistance in ohms; lost share of
the active material of both electrodes; lost share of the heat transfer; drift of the voltage sensor
in volts an orbit; share of the regime's `stuck_a`."""
SENSOR_NOISE_V = 0.002
SENSOR_STEP_V = 5.0 / 4096
"""Standard deviation of the voltage sensor's noise, and its resolution: 12 bits over 5 V."""
SENSOR_NOISE_C = 0.1
SENSOR_STEP_C = 0.0625
"""The same of the temperature sensor, in degrees Celsius."""


class Fault(common.Fault):
    """A fault of the battery."""

    sizes = SIZES


ALL = Fault.all()
"""Every fault at every severity."""
_INPUTS = {
    "raised resistance": "added resistance",
    "lost capacity": "lost material",
    "poor heat transfer": "lost heat transfer",
}


def simulator_inputs(fault: Fault | None) -> dict[str, float]:
    """The three inputs of a simulator by name, all 0 for nominal (None), for a drifting sensor and
    for a payload that is stuck on.
    """
    inputs = dict.fromkeys(_INPUTS.values(), 0.0)
    if fault is not None and fault.kind in _INPUTS:
        inputs[_INPUTS[fault.kind]] = fault.size
    return inputs


def load_under(load: np.ndarray, fault: Fault | None, regime: Regime, onset: int) -> np.ndarray:
    """Returns the load in amperes, with that of a payload that is stuck on from sample `onset`."""
    if fault is None or fault.kind != "payload stuck on":
        return load
    return load + np.where(np.arange(len(load)) >= onset, fault.size * regime.stuck_a, 0.0)


def drift_under(num_samples: int, fault: Fault | None, onset: int) -> np.ndarray:
    """Returns the error of a drifting voltage sensor in volts, shape `(num_samples,)`: 0 up to
    sample `onset`, then a ramp.
    """
    if fault is None or fault.kind != "drifting sensor":
        return np.zeros(num_samples)
    return fault.size * np.maximum(np.arange(num_samples) - onset, 0) / ORBIT_SAMPLES


def columns_of(fault: Fault | None) -> dict[str, str | float]:
    """The columns of a table that name a fault."""
    return {
        "fault": "nominal" if fault is None else fault.kind,
        "severity": 0.0 if fault is None else fault.severity,
    }


def measure(
    values: np.ndarray,
    noise_sd: float | np.ndarray,
    step: float | np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Measures simulated values of any shape: the sensor adds white noise of `noise_sd` and rounds
    to multiples of `step`, in float32.
    """
    noisy = values + noise_sd * rng.standard_normal(np.shape(values))
    return (np.rint(noisy / step) * step).astype(np.float32)
