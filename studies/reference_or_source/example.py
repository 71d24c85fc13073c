"""Writes the small recorded pair of an aircraft: `python -m studies.reference_or_source.example
examples/aircraft`.

The files need no JSBSim to be read. Times count seconds; nominal flights of 20 minutes begin an
hour apart.

    telemetry.csv        the fine simulator through noisy sensors: what the aircraft's recorder
    would keep simulator.csv        the point mass over the same flights: its channels, and the
    commands that drive it telemetry_fault.csv  another flight, whose left engine answers its
    throttle 5 % too little after five minutes simulator_planned.csv  the point mass over that
    flight as planned: an operator does not know of the fault
"""

import sys

import numpy as np
import pandas as pd

from studies.common.command import example_command
from studies.reference_or_source.aircraft import Aircraft
from studies.reference_or_source.aircraft_faults import Fault

SEED = 7
NUM_FLIGHTS = 6
FAULT = Fault("left engine", 0.6)
_PERIOD_S = 3_600  # from the start of a flight to that of the next
_TELEMETRY_DIGITS = (2, 0, 2, 1, 1, 0)
_SIMULATOR_DIGITS = (*_TELEMETRY_DIGITS, 0, 0)


def tables(seed: int = SEED, num_flights: int = NUM_FLIGHTS) -> dict[str, pd.DataFrame]:
    """Simulates the flights.

    Args:
        seed: Seed of the commands, of the turbulence and of the sensors.
        num_flights: Number of nominal flights; one flight with the fault follows.

    Returns:
        The four tables by name.

    Raises:
        InputError: If JSBSim is not installed.
    """
    aircraft = Aircraft()
    found = {}
    parts = (
        (num_flights, None, "telemetry", "simulator"),
        (1, FAULT, "telemetry_fault", "simulator_planned"),
    )
    for part, (number, fault, of_telemetry, of_simulator) in enumerate(parts):
        rng = np.random.default_rng([seed, part])
        commands = aircraft.draw_commands(number, rng)
        telemetry = aircraft.measure(aircraft.run_real(commands, [fault], rng)[0], rng)
        simulator = aircraft.run_coarse(commands, aircraft.first_values)
        samples = np.arange(len(commands))
        times = samples // aircraft.unit_samples * _PERIOD_S + samples % aircraft.unit_samples
        for name, columns, digits, values in (
            (of_telemetry, aircraft.channels, _TELEMETRY_DIGITS, telemetry),
            (of_simulator, aircraft.coarse_columns, _SIMULATOR_DIGITS, simulator),
        ):
            cells = zip(columns, digits, values.T, strict=True)
            table = {
                column: [f"{value + 0.0:.{places}f}" for value in np.round(series, places)]
                for column, places, series in cells
            }
            found[name] = pd.DataFrame({"time": times} | table)
    return found


if __name__ == "__main__":
    sys.exit(example_command("reference_or_source", "aircraft", tables))
