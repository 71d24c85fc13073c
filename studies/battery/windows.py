"""Windows of the recorded runs of a replicate, with the sensor's noise: what enhancers and detectors learn from and are judged on."""

import dataclasses

import numpy as np

from enhsim_tf.simulator.joint import cut
from enhsim_tf.telemetry.windows import cut_windows, evenly_spaced_starts
from studies.battery.faults import SENSOR_NOISE_V, SENSOR_STEP_V, Fault, measure
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES
from studies.battery.record import Recorded, key_of

WINDOW = 500
"""Samples in a window, as in the paper: nearly an orbit at the interval of 10 s."""
NUM_TEST, NUM_FAULT = 400, 40
"""Windows of the test orbits, and of each fault at each severity, on which everything is judged."""
_AFTER_ONSET = round(60 / INTERVAL_S)  # samples in which a fault grows to its full size


@dataclasses.dataclass(frozen=True)
class PairWindows:
    """Windows of both simulators over the same time.

    Args:
        coarse: The coarse simulator's voltage, current and temperature, float32 of shape `(windows, WINDOW, 3)`.
        fine: The fine simulator's voltage without noise, shape `(windows, WINDOW)`.
        telemetry: The same through the sensor.
        starts: First sample of each window in its run.
    """

    coarse: np.ndarray
    fine: np.ndarray
    telemetry: np.ndarray
    starts: np.ndarray


def window_starts(num_samples: int, number: int) -> np.ndarray:
    """First samples of windows that are spread evenly over a run, behind its first orbit and behind the onset of a fault."""
    begin = ORBIT_SAMPLES + _AFTER_ONSET
    return begin + evenly_spaced_starts([range(num_samples - begin)], WINDOW, number)


def pair_windows(
    recorded: Recorded, part: str, number: int, seed: int, fault: Fault | None = None, is_planned: bool = False
) -> PairWindows:
    """Cuts windows of both simulators.

    The noise of the sensor depends on the seed, the part and the fault only, so that windows of a run share the noise of their
    common samples.

    Args:
        recorded: The runs.
        part: `fit`, `more`, `test` or `fault`.
        number: Number of windows, spread evenly over the run.
        seed: Seed of the sensor's noise.
        fault: The fault; None for nominal.
        is_planned: Whether the coarse windows are those of the nominal run, which an operator has without knowing of a fault.
    """
    fine = recorded.get(part, "fine", fault)[:, 0]
    coarse = recorded.get(part, "coarse", None if is_planned else fault)
    rng = np.random.default_rng([seed, 0, *f"{part}/{key_of(fault)}".encode()])
    telemetry = measure(fine, SENSOR_NOISE_V, SENSOR_STEP_V, rng)
    starts = window_starts(len(fine), number)
    return PairWindows(cut_columns(coarse, starts), cut_windows(fine, starts, WINDOW), cut_windows(telemetry, starts, WINDOW), starts)


def judged_windows(recorded: Recorded, fault: Fault | None, seed: int, is_planned: bool = False) -> PairWindows:
    """Windows of the test orbits, or of a fault, on which enhancers and detectors are judged; see `pair_windows`."""
    part, number = ("test", NUM_TEST) if fault is None else ("fault", NUM_FAULT)
    return pair_windows(recorded, part, number, seed, fault, is_planned)


def coarse_windows(recorded: Recorded, part: str, number: int, fault: Fault | None = None) -> np.ndarray:
    """Cuts windows of the coarse simulator alone, shape `(number, WINDOW, 3)`; see `pair_windows`."""
    run = recorded.get(part, "coarse", fault)
    return cut_columns(run, window_starts(len(run), number))


def cut_columns(run: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Cuts windows of shape `(windows, WINDOW, columns)` out of a run of shape `(samples, columns)`."""
    return cut([run], starts, WINDOW)
