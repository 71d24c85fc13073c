"""An A320 and its coarse simulator, a point mass, for the study."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from studies.battery.faults import measure
from studies.reference_or_source.aircraft_faults import (
    ALL,
    ONSET,
    UNIT_SAMPLES,
    Fault,
    sizes_over_flight,
)
from studies.reference_or_source.aircraft_flight import draw_wind, fly, import_jsbsim
from studies.reference_or_source.aircraft_point_mass import Constants, simulate

COMMANDS = ("target altitude", "target airspeed")
NOISE_SD = (0.5, 30.0, 0.05, 0.1, 0.1, 6.0)
"""Standard deviation of each channel's sensor noise, in the channel's unit."""
RESOLUTION = (0.25, 16.0, 0.05, 0.1, 0.1, 4.0)
"""Resolution of each channel's sensor, in the channel's unit."""
_HOLDS_S = (60, 120)  # shortest and longest time between two steps of a target; the mean is 90 s
# limits, largest step and grid of altitude in feet and airspeed in knots
_TARGETS = ((8_000, 16_000), 1_500, 100), ((230, 290), 20, 1)


class Aircraft:
    """An A320 in JSBSim that flies targets of altitude and airspeed.

    Its telemetry is airspeed as it reads in knots, climb rate in feet a minute, pitch in degrees,
    N1 of the left and the right engine in percent and altitude in feet, once a second. A flight
    lasts 20 minutes and starts in the air, trimmed at its first targets. A fault acts from sample
    `onset` of every flight to its end.
    """

    is_continuous = False
    channels = ("airspeed", "climb rate", "pitch", "N1 left", "N1 right", "altitude")
    coarse_columns = (*channels, *COMMANDS)
    unit_samples = UNIT_SAMPLES
    onset = ONSET
    window = 120
    faults: tuple[Fault, ...] = ALL
    parameters = tuple(field.name for field in dataclasses.fields(Constants))
    """Parameters of the point mass that can be fitted to telemetry."""
    first_values = np.array([field.default for field in dataclasses.fields(Constants)])
    steps = first_values / 2
    bounds = (-1.8, 6.0)
    """Unit of each parameter in the fit, and the limits of its change in these units."""

    check_installed = staticmethod(import_jsbsim)

    def draw_commands(self, num_units: int, rng: np.random.Generator) -> np.ndarray:
        """Draws targets of some flights, each of which takes a random step every 60 to 120 seconds.

        Returns:
            Target altitude in feet and airspeed in knots, float64 of shape `(num_units *
            unit_samples, 2)`.
        """
        drawn = [_draw_target(*each, rng) for _ in range(num_units) for each in _TARGETS]
        return (
            np.reshape(drawn, (num_units, len(_TARGETS), UNIT_SAMPLES))
            .swapaxes(1, 2)
            .reshape(-1, len(_TARGETS))
        )

    def as_inputs(self, commands: np.ndarray) -> np.ndarray:
        """The targets, around the middle of their limits and in units of half of the range."""
        low, high = np.array([limits for limits, _, _ in _TARGETS], float).T
        return (commands - (low + high) / 2) / ((high - low) / 2)

    def run_real(
        self,
        commands: np.ndarray,
        faults: Sequence[Fault | None] = (None,),
        rng: np.random.Generator | None = None,
    ) -> list[np.ndarray]:
        """Runs the fine simulator.

        Args:
            commands: Targets, see `draw_commands`.
            faults: Faults, each of which acts from sample `onset` of every flight; None for
                nominal.
            rng: Random number generator of the turbulence, which the runs share; None for calm air.

        Returns:
            For each fault, the channels before the sensors' noise, float32 of shape `(samples, 6)`.
            The error of a pitot tube is in the airspeed, and the autopilot flies by it.

        Raises:
            InputError: If JSBSim is not installed, or `commands` cannot be flown.
        """
        flights = _as_flights(commands)
        winds = (
            [None] * len(flights)
            if rng is None
            else [draw_wind(own) for own in rng.spawn(len(flights))]
        )
        found = []
        for fault in faults:
            sizes = sizes_over_flight(fault)
            # each flight has a simulator of its own, so that none depends on the ones before it
            runs = [fly(*each, sizes) for each in zip(flights, winds, strict=True)]
            found.append(np.concatenate(runs).astype(np.float32))
        return found

    def run_coarse(self, commands: np.ndarray, values: Sequence[float]) -> np.ndarray:
        """Runs the coarse simulator, in calm air and without a fault.

        Args:
            commands: Targets, see `draw_commands`.
            values: Values of `parameters`, such as `first_values`.

        Returns:
            Columns `coarse_columns`: the channels as the simulator computes them, then the
            commands; float32 of shape `(samples, 8)`.
        """
        run = simulate(_as_flights(commands), Constants(*map(float, values)))
        run = run.reshape(-1, len(self.channels))
        return np.concatenate([run, commands], axis=1).astype(np.float32)

    def measure(self, values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Measures channels of shape `(samples, 6)` with sensors that add white noise and round;
        returns float32.
        """
        return measure(values, np.array(NOISE_SD), np.array(RESOLUTION), rng)


def _draw_target(
    limits: tuple[int, int], step: int, grid: int, rng: np.random.Generator
) -> np.ndarray:
    """Draws one target over one flight: a random walk that limits reflect, in steps of at most
    `step`, rounded to a grid.
    """
    target = np.empty(UNIT_SAMPLES)
    value = rng.uniform(*limits)
    begin = 0
    while begin < UNIT_SAMPLES:
        end = begin + int(rng.integers(_HOLDS_S[0], _HOLDS_S[1] + 1))
        target[begin:end] = np.rint(value / grid) * grid
        value += rng.uniform(-step, step)
        # reflected at the lower limit, and then at the upper one
        value = limits[0] + abs(value - limits[0])
        value = limits[1] - abs(limits[1] - value)
        begin = end
    return target


def _as_flights(commands: np.ndarray) -> np.ndarray:
    """Commands as `(flights, UNIT_SAMPLES, 2)`."""
    return commands.astype(float).reshape(-1, UNIT_SAMPLES, len(COMMANDS))
