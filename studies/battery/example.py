"""Writes the small recorded pair that ships with the project: `python -m studies.battery.example
examples/battery`.

The files need no PyBaMM to be read. Times count seconds.

    telemetry.csv        the fine simulator's voltage through a noisy sensor: what a spacecraft
    would send simulator.csv        the coarse simulator over the same orbits: voltage, current and
    temperature simulator_fault.csv  the coarse simulator over other orbits: a nominal orbit, then
    raised resistance, with its labels telemetry_fault.csv  the telemetry of those orbits
    simulator_planned.csv  the coarse simulator over those orbits without the fault: what should
    have happened
"""

import sys

import numpy as np
import pandas as pd

from studies.battery.faults import SENSOR_NOISE_V, SENSOR_STEP_V, Fault, measure
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES, REGIMES, draw_load
from studies.battery.simulate import COLUMNS, simulate_all
from studies.common.command import example_command

SEED = 7
NUM_ORBITS = 32
NUM_FAULT_ORBITS = 4
FAULT = Fault("raised resistance", 1.0)
_DIGITS = tuple(zip(COLUMNS, (4, 3, 2), strict=True))


def tables(
    seed: int = SEED, num_orbits: int = NUM_ORBITS, num_fault_orbits: int = NUM_FAULT_ORBITS
) -> dict[str, pd.DataFrame]:
    """Simulates the pair in the gentle regime.

    Args:
        seed: Seed of the loads and of the sensor.
        num_orbits: Nominal orbits.
        num_fault_orbits: Orbits of the run with a fault; the first is nominal.

    Returns:
        The five tables by name.

    Raises:
        InputError: If PyBaMM is not installed.
    """

    def in_columns(times: np.ndarray, values: np.ndarray) -> pd.DataFrame:
        columns = {
            name: [f"{value:.{digits}f}" for value in column]
            for (name, digits), column in zip(_DIGITS, values.T, strict=True)
        }
        return pd.DataFrame({"time": times} | columns)

    regime = REGIMES["gentle"]
    found = {}
    loads = np.random.default_rng([seed, 0])
    noise = np.random.default_rng([seed, 1])
    for number, fault, suffix in ((num_orbits, None, ""), (num_fault_orbits, FAULT, "_fault")):
        # in the first orbit, which is left out, the battery reaches its usual temperature
        load = draw_load(number + 1, regime, loads)
        *planned, runs = simulate_all(
            load, regime, [fault] if fault is None else [None, fault], onset=2 * ORBIT_SAMPLES
        )
        coarse, fine = (run[ORBIT_SAMPLES:] for run in runs)
        times = np.arange(len(coarse)) * int(INTERVAL_S)
        simulator = in_columns(times, coarse)
        if fault is not None:
            found["simulator_planned"] = in_columns(times, planned[0][0][ORBIT_SAMPLES:])
            is_faulty = times >= ORBIT_SAMPLES * INTERVAL_S
            simulator["scenario"] = np.where(is_faulty, fault.kind, "nominal")
            simulator["severity"] = np.where(is_faulty, fault.severity, 0.0)
            simulator["mask"] = is_faulty.astype(int)
        volts = measure(fine[:, 0], SENSOR_NOISE_V, SENSOR_STEP_V, noise)
        telemetry = pd.DataFrame({"time": times, "volts": [f"{value:.4f}" for value in volts]})
        found |= {f"telemetry{suffix}": telemetry, f"simulator{suffix}": simulator}
    return found


if __name__ == "__main__":
    sys.exit(example_command("battery", "battery", tables))
