"""The runs of both simulators that a replicate works with, and windows of them, through the sensor:
what is learnt from and judged on.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.stages import save_arrays
from enhsim_tf.paper.telemetry import cut_windows
from enhsim_tf.telemetry.windows import cut, evenly_spaced_starts
from studies.battery.faults import ALL, SENSOR_NOISE_V, SENSOR_STEP_V, Fault, measure
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES, Regime, draw_load
from studies.battery.simulate import MODELS, simulate_all

PARTS = {
    "fit": ((None,), tuple(MODELS)),
    "more": ((None,), tuple(MODELS)),
    "test": ((None,), tuple(MODELS)),
    "fault": ((None, *ALL), tuple(MODELS)),
    "coarse": ((None,), ("coarse",)),
}
"""For each part its faults and its simulators. The enhanced simulator is fitted to `fit`. Detectors
learn more real telemetry from `more`, everything is judged on `test` and `fault`, and training data
are generated from `coarse`."""
WINDOW = 500
"""Samples in a window, as in the paper: nearly an orbit at the interval of 10 s."""
NUM_TEST = 400
NUM_FAULT = 40
"""Windows of the test orbits, and of each fault at each severity, on which everything is judged."""
_AFTER_ONSET = round(60 / INTERVAL_S)  # samples in which a fault grows to its full size


Runs = Mapping[str, np.ndarray]
"""The runs of a replicate, float32 of shape `(samples, 3)` with the columns `simulate.COLUMNS`, by
the key that `run_key` gives.
"""


def run_key(part: str, model: str, fault: Fault | None = None) -> str:
    """The key of the run of a model, `coarse` or `fine`, in one of `PARTS`; the fault is None for
    nominal.
    """
    return f"{part}/{key_of(fault)}/{model}"


def key_of(fault: Fault | None) -> str:
    """The name of a fault at its severity in files, or `nominal`."""
    return "nominal" if fault is None else f"{fault.kind} {fault.severity:g}"


def record(
    folder: Path, counts: Mapping[str, int], regime: Regime, seed: int, progress: Progress = SILENT
) -> None:
    """Simulates all runs of a replicate and writes them.

    Each part has loads of its own, drawn with the seed. All faults of a part share one load, and
    begin after its first orbit.

    Args:
        folder: An existing folder.
        counts: Number of orbits of each of `PARTS`. Each run has one more, its first, in which the
            battery reaches its usual temperature.
        regime: How hard the battery is used.
        seed: Seed of the loads.
        progress: Reports the progress.

    Raises:
        InputError: If PyBaMM is not installed, or a solver fails at any current.
    """
    arrays: dict[str, np.ndarray] = {}
    told = progress.loop("part", len(PARTS))
    for number, (part, (faults, models)) in enumerate(PARTS.items()):
        load = draw_load(counts[part] + 1, regime, np.random.default_rng([seed, number]))
        for fault, runs in zip(
            faults,
            simulate_all(load, regime, faults, [MODELS[name] for name in models]),
            strict=True,
        ):
            arrays |= {
                run_key(part, model, fault): run for model, run in zip(models, runs, strict=True)
            }
        told(number + 1)
    save_arrays(folder, arrays, "runs")


class PairWindows(NamedTuple):
    """Windows of both simulators over the same time.

    Args:
        coarse: The coarse simulator's voltage, current and temperature, float32 of shape `(windows,
            WINDOW, 3)`.
        telemetry: The fine simulator's voltage through the sensor, shape `(windows, WINDOW)`.
        starts: First sample of each window in its run.
    """

    coarse: np.ndarray
    telemetry: np.ndarray
    starts: np.ndarray


def pair_windows(
    runs: Runs,
    part: str,
    number: int,
    seed: int,
    fault: Fault | None = None,
    is_planned: bool = False,
) -> PairWindows:
    """Cuts a number of windows of both simulators, spread evenly over the run of a part.

    The noise of the sensor depends on the seed, the part and the fault only, so that windows of a
    run share the noise of their common samples. With `is_planned`, the coarse windows are those of
    the nominal run, which an operator has without knowing of a fault.
    """
    fine = runs[run_key(part, "fine", fault)][:, 0]
    coarse = runs[run_key(part, "coarse", None if is_planned else fault)]
    rng = np.random.default_rng([seed, 0, *f"{part}/{key_of(fault)}".encode()])
    telemetry = measure(fine, SENSOR_NOISE_V, SENSOR_STEP_V, rng)
    starts = _starts(fine, number)
    return PairWindows(
        cut([coarse], starts, WINDOW), cut_windows(telemetry, starts, WINDOW), starts
    )


def judged_windows(
    runs: Runs, fault: Fault | None, seed: int, is_planned: bool = False
) -> PairWindows:
    """Windows of the test orbits, or of a fault, on which detectors are judged; see
    `pair_windows`.
    """
    part, number = ("test", NUM_TEST) if fault is None else ("fault", NUM_FAULT)
    return pair_windows(runs, part, number, seed, fault, is_planned)


def coarse_windows(run: np.ndarray, number: int) -> np.ndarray:
    """Cuts windows out of a run of the coarse simulator, shape `(number, WINDOW, 3)`; see
    `pair_windows`.
    """
    return cut([run], _starts(run, number), WINDOW)


def _starts(run: np.ndarray, number: int) -> np.ndarray:
    """First samples of windows that are spread evenly over a run, behind its first orbit and behind
    the onset of a fault.
    """
    begin = ORBIT_SAMPLES + _AFTER_ONSET
    return begin + evenly_spaced_starts([run[begin:]], WINDOW, number)
