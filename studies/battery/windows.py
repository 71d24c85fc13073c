"""Windows of the recorded runs of a replicate, with the sensor's noise: what enhancers and detectors learn from and are judged on."""

import dataclasses

import numpy as np

from enhsim_tf.telemetry.windows import cut_windows, evenly_spaced_starts
from studies.battery.faults import (
    SENSOR_NOISE_C,
    SENSOR_NOISE_V,
    SENSOR_STEP_C,
    SENSOR_STEP_V,
    Fault,
    measure,
)
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES
from studies.battery.record import Recorded, key_of
from studies.battery.simulate import COLUMNS

WINDOW = 500
"""Samples in a window, as in the paper: nearly an orbit at the interval of 10 s."""
TARGETS = {"volts": (0, SENSOR_NOISE_V, SENSOR_STEP_V), "celsius": (COLUMNS.index("celsius"), SENSOR_NOISE_C, SENSOR_STEP_C)}
"""For each measured quantity its column, the standard deviation of its sensor's noise, and the sensor's resolution."""
_AFTER_ONSET = round(60 / INTERVAL_S)  # samples in which a fault grows to its full size


@dataclasses.dataclass(frozen=True)
class PairWindows:
    """Windows of both simulators over the same time.

    Args:
        coarse: The coarse simulator's columns, float32 of shape `(windows, WINDOW, 3)`; the measured quantity is the first.
        fine: The fine simulator's quantity without noise, shape `(windows, WINDOW)`.
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
    recorded: Recorded, part: str, number: int, seed: int, fault: Fault | None = None, target: str = "volts", is_planned: bool = False
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
        target: A key of `TARGETS`.
        is_planned: Whether the coarse windows are those of the nominal run, which an operator has without knowing of a fault.
    """
    fine = recorded.get(part, "fine", fault)
    coarse = recorded.get(part, "coarse", None if is_planned else fault)
    column, noise_sd, step = TARGETS[target]
    rng = np.random.default_rng([seed, column, *f"{part}/{key_of(fault)}".encode()])
    telemetry = measure(fine[:, column], noise_sd, step, rng)
    starts = window_starts(len(fine), number)
    columns = np.roll(np.arange(len(COLUMNS)), -column)
    return PairWindows(
        cut_windows_of_columns(coarse[:, columns], starts),
        cut_windows(fine[:, column], starts, WINDOW),
        cut_windows(telemetry, starts, WINDOW),
        starts,
    )


def coarse_windows(recorded: Recorded, part: str, number: int, fault: Fault | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Cuts windows of the coarse simulator alone.

    Args:
        recorded: The runs.
        part: A field of `record.Counts`.
        number: Number of windows, spread evenly over the run.
        fault: The fault; None for nominal.

    Returns:
        Windows of shape `(number, WINDOW, 3)`, and their first samples.
    """
    run = recorded.get(part, "coarse", fault)
    starts = window_starts(len(run), number)
    return cut_windows_of_columns(run, starts), starts


def cut_windows_of_columns(run: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Cuts windows of shape `(windows, WINDOW, columns)` out of a run of shape `(samples, columns)`."""
    return np.lib.stride_tricks.sliding_window_view(run, WINDOW, axis=0)[starts].transpose(0, 2, 1)
