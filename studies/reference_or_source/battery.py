"""The battery of a satellite as a system of the study: three channels, driven by a known load."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from studies.battery.faults import (
    ALL,
    SENSOR_NOISE_C,
    SENSOR_NOISE_V,
    SENSOR_STEP_C,
    SENSOR_STEP_V,
    Fault,
    measure,
)
from studies.battery.orbits import (
    ORBIT_SAMPLES,
    REGIMES,
    battery_current,
    draw_load,
)
from studies.battery.simulate import COARSE, VEHICLE, Model, import_pybamm, simulate_all

SENSOR_NOISE_A = 0.02
SENSOR_STEP_A = 20.0 / 4096
"""Standard deviation of the current sensor's noise in amperes, and its resolution: 12 bits over 20
A.
"""


class Battery:
    """A battery over low orbits, in the gentle regime of `studies.battery`.

    Commands are the load in amperes. Telemetry has the voltage in volts, the current in amperes and
    the temperature in degrees Celsius. A run is continuous; an orbit before it, in which the
    battery reaches its usual temperature, is left out.
    """

    is_continuous = True
    """Whether a run goes on from unit to unit."""
    unit_samples = ORBIT_SAMPLES
    window = 100
    onset = 0
    """First sample of each unit of a run under a fault from which the fault acts."""
    faults = ALL
    parameters = ("resistance", "lost_material", "lost_heat_transfer")
    """Parameters of the simulator with wrong physics that can be fitted to telemetry, all 0 in the
    published model.
    """
    first_values = np.zeros(3)
    steps = np.array([0.01, 0.05, 0.3])
    bounds = ((-1e-9, -1e-9, -3.0), (5.0, 4.0, 3.0))
    """Published values of `parameters`, the unit of each in the fit, and the limits in these
    units.
    """

    check_installed = staticmethod(import_pybamm)

    def draw_commands(self, num_units: int, rng: np.random.Generator) -> np.ndarray:
        """Draws the load of so many orbits and one before them, shape `(samples, 1)`."""
        return draw_load(num_units + 1, REGIMES["gentle"], rng)[:, None]

    def as_inputs(self, commands: np.ndarray) -> np.ndarray:
        """The planned current of the battery in amperes, shape `(samples, 1)`, with the first
        orbit.
        """
        return battery_current(commands[:, 0], REGIMES["gentle"])[:, None]

    def run_real(
        self,
        commands: np.ndarray,
        faults: Sequence[Fault | None] = (None,),
        rng: np.random.Generator | None = None,
    ) -> list[np.ndarray]:
        """Runs the fine simulator, see `Aircraft.run_real`; the load is all that moves a battery,
        so that nothing is drawn.

        Returns:
            For each fault, which acts from the beginning of the run, float32 array of shape
            `(samples, 3)`, without the first orbit.
        """
        return self._run(VEHICLE, commands, faults)

    def run_coarse(self, commands: np.ndarray, values: Sequence[float]) -> np.ndarray:
        """Runs the coarse simulator, see `Aircraft.run_coarse`.

        Returns:
            Float32 array of shape `(samples, 4)`: the channels and the load, without the first
            orbit.
        """
        changed = dict(zip(self.parameters, map(float, values), strict=True))
        (run,) = self._run(dataclasses.replace(COARSE, **changed), commands, (None,))
        load = commands[ORBIT_SAMPLES:].astype(np.float32)
        return np.concatenate([run, load], axis=1)

    def _run(
        self, model: Model, commands: np.ndarray, faults: Sequence[Fault | None]
    ) -> list[np.ndarray]:
        found = simulate_all(commands[:, 0], REGIMES["gentle"], faults, [model])
        return [runs[0][ORBIT_SAMPLES:] for runs in found]

    def measure(self, values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Measures simulated channels of shape `(samples, 3)` with noisy sensors; returns
        float32.
        """
        noise = (SENSOR_NOISE_V, SENSOR_NOISE_A, SENSOR_NOISE_C)
        step = (SENSOR_STEP_V, SENSOR_STEP_A, SENSOR_STEP_C)
        channels = zip(values.T, noise, step, strict=True)
        return np.stack([measure(*channel, rng) for channel in channels], axis=1)
