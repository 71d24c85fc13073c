"""Error of every enhancer on held-out nominal orbits and on faults, and what the trust score says about each fault."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enhsim_tf.detection.metrics import threshold
from enhsim_tf.enhancer.candidates import choose_enhancer, fit_enhancer
from enhsim_tf.enhancer.names import COARSE, LEVEL_AND_GAIN, NETWORK, RIDGE, RIDGE_AND_FEATURES
from enhsim_tf.enhancer.out_of_range import OutOfRange
from studies.battery.faults import ALL, Fault
from studies.battery.record import Recorded
from studies.battery.windows import NUM_FAULT, NUM_TEST, PairWindows, coarse_windows, judged_windows
from studies.common.nearest_windows import fit_nearest_windows

Predict = Callable[[np.ndarray], np.ndarray]

ENHANCERS = {
    "coarse itself": (COARSE, 3),
    "level and gain": (LEVEL_AND_GAIN, 1),
    "nearest windows": ("nearest", 3),
    "paper's network": (NETWORK, 1),
    "ridge, voltage": (RIDGE, 1),
    "ridge, voltage and current": (RIDGE, 2),
    "ridge, all columns": (RIDGE, 3),
    "ridge and random features": (RIDGE_AND_FEATURES, 3),
}
"""For each enhancer its kind and how many of the coarse columns voltage, current and temperature it receives."""
FLOOR = "fine itself"
"""The fine simulator without the sensor: the error that no enhancer can be below, except by chance."""
NUM_WINDOWS = 1_500
"""Windows for fitting."""
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

    def fitted(kind: str, columns: int) -> Predict:
        epochs = {"epochs": paper_epochs} if kind == NETWORK else {}
        enhancer = fit_enhancer(kind, pairs.coarse[:, :, :columns], pairs.telemetry, pairs.starts, seed, **epochs)
        return lambda windows: enhancer.predict(windows[:, :, :columns])[:, :, 0]

    found = {}
    for name in names:
        kind, columns = ENHANCERS[name]
        if kind == "nearest":
            found[name] = fit_nearest_windows(pairs.coarse, pairs.telemetry, pairs.starts)
        elif kind == COARSE:
            found[name] = lambda windows: windows[:, :, 0]
        else:
            found[name] = fitted(kind, columns)
    return found


def choice_rows(pairs: PairWindows, seed: int) -> list[dict[str, Any]]:
    """Chooses an enhancer of all coarse columns as `fit` does, with a row for each candidate that was tried."""
    choice = choose_enhancer(pairs.coarse, pairs.telemetry, pairs.starts, seed=seed)
    return [
        {"candidate": each.name, "error": each.error, "standard_error": each.standard_error, "is_chosen": each.name == choice.enhancer.name}
        for each in choice.judged
    ]


def error_rows(recorded: Recorded, enhancers: Mapping[str, Predict], seed: int) -> list[dict[str, Any]]:
    """Measures the error of enhancers on the test orbits and on every fault.

    All errors are root-mean-square errors divided by the standard deviation of the fine simulator's voltage over the test
    windows (NRMSE), so that errors on faults are in the same unit.

    Args:
        recorded: The runs.
        enhancers: Functions from coarse windows to enhanced windows, by name.
        seed: Seed of the sensor's noise.

    Returns:
        Rows with `enhancer`, `fault`, `severity` (0 for nominal), `nrmse` against the telemetry and `nrmse_true` against the fine
        simulator without noise.
    """
    rows, unit = [], 0.0
    for fault in (None, *ALL):
        pairs = judged_windows(recorded, fault, seed)
        unit = unit or float(np.std(pairs.fine, dtype=np.float64))
        for name, predict in (*enhancers.items(), (FLOOR, None)):
            enhanced = pairs.fine if predict is None else predict(pairs.coarse)
            errors = {key: _rms(enhanced - wanted) / unit for key, wanted in (("nrmse", pairs.telemetry), ("nrmse_true", pairs.fine))}
            rows.append(about(fault) | {"enhancer": name} | errors)
    return rows


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
    centre, scale = (np.asarray(measure(pairs.coarse, axis=(0, 1), dtype=np.float64)) for measure in (np.mean, np.std))

    def in_unit(windows: np.ndarray) -> np.ndarray:
        return ((windows - centre) / scale).reshape(len(windows), -1).astype(np.float32)

    score = OutOfRange().fit(in_unit(pairs.coarse))
    limit = threshold(score.score(in_unit(coarse_windows(recorded, "coarse", NUM_WINDOWS))), _RATE)
    rows = []
    for fault in (None, *ALL):
        part, number = ("test", NUM_TEST) if fault is None else ("fault", NUM_FAULT)
        windows = coarse_windows(recorded, part, number, fault)
        rows.append(about(fault) | {"out_of_range": float(np.mean(score.score(in_unit(windows)) > limit))})
    return rows


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
