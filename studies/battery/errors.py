"""Error of every enhancer on held-out nominal orbits and on faults, and what the trust score says about each fault."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enhsim_tf.detection.metrics import threshold
from enhsim_tf.enhancer.ladder import COARSE, LEVEL_AND_GAIN, NETWORK, RIDGE, RIDGE_AND_NETWORK, Ladder, fit_ladder, fit_rung
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.enhancer.ridge import choose_num_neighbours, nearest_windows
from enhsim_tf.enhancer.scaling import Scaling
from studies.battery.faults import ALL, Fault
from studies.battery.record import Recorded
from studies.battery.windows import PairWindows, coarse_windows, pair_windows

Predict = Callable[[np.ndarray], np.ndarray]

LADDER = (COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_NETWORK)
"""The rungs that are chosen among, with every coarse column as input, the simplest first."""
ENHANCERS = {
    "coarse itself": (COARSE, 3),
    "level and gain": (LEVEL_AND_GAIN, 1),
    "nearest windows": ("nearest", 3),
    "paper's network": (NETWORK, 1),
    "ridge, voltage": (RIDGE, 1),
    "ridge, voltage and current": (RIDGE, 2),
    "ridge, all columns": (RIDGE, 3),
    "ridge and network": (RIDGE_AND_NETWORK, 3),
}
"""For each enhancer the rung and how many of the coarse columns voltage, current and temperature it receives."""
FLOOR = "fine itself"
"""The fine simulator without the sensor: the error that no enhancer can be below, except by chance."""
WITHOUT_NETWORKS = tuple(name for name, (rung, _) in ENHANCERS.items() if rung not in (NETWORK, RIDGE_AND_NETWORK))
NUM_WINDOWS, NUM_TEST, NUM_FAULT = 1_500, 400, 40
"""Windows for fitting, of the test orbits, and of each fault at each severity."""
_RATE = 0.01  # of nominal windows that the trust score may call out of range


def fit_enhancers(pairs: PairWindows, names: tuple[str, ...], seed: int, paper_epochs: int) -> dict[str, Predict]:
    """Fits enhancers to nominal windows.

    Args:
        pairs: The windows.
        names: Keys of `ENHANCERS`.
        seed: Seed of the networks.
        paper_epochs: Passes of the paper's network over the windows.

    Returns:
        For each name a function from coarse windows of all columns to enhanced windows.
    """

    def with_columns(predict: Predict, columns: int) -> Predict:
        return lambda inputs: predict(inputs[:, :, :columns])

    found = {}
    for name in names:
        rung, columns = ENHANCERS[name]
        inputs = pairs.coarse[:, :, :columns]
        if rung == "nearest":
            number = choose_num_neighbours(inputs, pairs.telemetry, pairs.starts)
            found[name] = lambda windows, number=number: nearest_windows(pairs.coarse, pairs.telemetry, windows, number)
        elif rung == COARSE:
            found[name] = lambda windows: windows[:, :, 0]
        else:
            epochs = {"epochs": paper_epochs} if rung == NETWORK else {}
            found[name] = with_columns(fit_rung(rung, inputs, pairs.telemetry, pairs.starts, seed, **epochs).predict, columns)
    return found


def choose(pairs: PairWindows, seed: int) -> Ladder:
    """Chooses an enhancer on held-out blocks of the orbits that it is fitted to; see `enhancer.ladder`."""
    return fit_ladder(pairs.coarse, pairs.telemetry, pairs.starts, LADDER, seed, refit="chosen")


def error_rows(recorded: Recorded, enhancers: Mapping[str, Predict], seed: int, target: str = "volts") -> list[dict[str, Any]]:
    """Measures the error of enhancers on the test orbits and on every fault.

    All errors are root-mean-square errors divided by the standard deviation of the fine simulator's quantity over the test
    windows (NRMSE), so that errors on faults are in the same unit.

    Args:
        recorded: The runs.
        enhancers: Functions from coarse windows to enhanced windows, by name.
        seed: Seed of the sensor's noise.
        target: The quantity.

    Returns:
        Rows with `enhancer`, `fault`, `severity` (0 for nominal), `target`, `nrmse` against the telemetry and `nrmse_true`
        against the fine simulator without noise.
    """
    rows, unit = [], 0.0
    for fault in (None, *ALL):
        pairs = fault_windows(recorded, fault, seed, target)
        unit = unit or float(np.std(pairs.fine, dtype=np.float64))
        for name, predict in (*enhancers.items(), (FLOOR, None)):
            enhanced = pairs.fine if predict is None else predict(pairs.coarse)
            errors = {key: _rms(enhanced - wanted) / unit for key, wanted in (("nrmse", pairs.telemetry), ("nrmse_true", pairs.fine))}
            rows.append(about(fault) | {"enhancer": name, "target": target} | errors)
    return rows


def fault_windows(recorded: Recorded, fault: Fault | None, seed: int, target: str = "volts", is_planned: bool = False) -> PairWindows:
    """Windows of the test orbits, or of a fault, on which enhancers and detectors are judged."""
    part, number = ("test", NUM_TEST) if fault is None else ("fault", NUM_FAULT)
    return pair_windows(recorded, part, number, seed, fault, target, is_planned)


def about(fault: Fault | None) -> dict[str, Any]:
    """The columns of a table that name a fault."""
    return {"fault": "nominal" if fault is None else fault.kind, "severity": 0.0 if fault is None else fault.severity}


def trust_rows(recorded: Recorded, pairs: PairWindows) -> list[dict[str, Any]]:
    """Measures which share of the windows of each fault the trust score calls out of range, from coarse windows alone.

    The limit is the conformal threshold of 1 % on nominal coarse windows of other orbits.

    Args:
        recorded: The runs.
        pairs: The windows that the enhancers are fitted to.
    """
    scaling = Scaling.fit(pairs.coarse, pairs.telemetry)
    score = OutOfRange().fit(scaling.scale_inputs(pairs.coarse))
    nominal, _ = coarse_windows(recorded, "coarse", NUM_WINDOWS)
    limit = threshold(score.score(scaling.scale_inputs(nominal)), _RATE)
    rows = []
    for fault in (None, *ALL):
        part, number = ("test", NUM_TEST) if fault is None else ("fault", NUM_FAULT)
        windows, _ = coarse_windows(recorded, part, number, fault)
        rows.append(about(fault) | {"out_of_range": float(np.mean(score.score(scaling.scale_inputs(windows)) > limit))})
    return rows


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
