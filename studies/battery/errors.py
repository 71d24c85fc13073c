"""Errors of the enhancers on nominal orbits and on faults, what the trust score says about each fault, and the time that all need."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enhsim_tf.detection.metrics import threshold
from enhsim_tf.enhancer.candidates import choose_enhancer, fit_enhancer
from enhsim_tf.enhancer.names import COARSE, NETWORK, RIDGE, RIDGE_AND_FEATURES
from enhsim_tf.enhancer.out_of_range import OutOfRange
from studies.battery.faults import ALL, Fault, columns_of
from studies.battery.orbits import ORBIT_SAMPLES, Regime, battery_current, draw_load
from studies.battery.record import NUM_FAULT, NUM_TEST, WINDOW, PairWindows, Recorded, coarse_windows, judged_windows
from studies.battery.simulate import MODELS, Model, simulate

Predict = Callable[[np.ndarray], np.ndarray]
Rows = list[dict[str, Any]]

ENHANCERS = {
    "coarse itself": (COARSE, 3),
    "paper's network": (NETWORK, 1),
    "ridge, voltage and current": (RIDGE, 2),
    "ridge, all columns": (RIDGE, 3),
    "ridge and random features": (RIDGE_AND_FEATURES, 3),
}
"""For each enhancer its kind and how many of the coarse columns voltage, current and temperature it receives."""
NUM_WINDOWS = 1_500
"""Windows for fitting."""
_RATE = 0.01  # of nominal windows that the trust score may call out of range
_SPEED_ORBITS, _SPEED_REPEATS, _SPEED_WINDOWS = 8, 4, 400


def fit_enhancers(pairs: PairWindows, names: tuple[str, ...], seed: int, paper_epochs: int) -> dict[str, Predict]:
    """Fits some of `ENHANCERS` to nominal windows, the paper's network in `paper_epochs` passes.

    Returns:
        For each name a function from coarse windows of all columns to enhanced windows.
    """

    def fitted(kind: str, columns: int) -> Predict:
        if kind == COARSE:
            return lambda windows: windows[:, :, 0]
        epochs = {"epochs": paper_epochs} if kind == NETWORK else {}
        enhancer = fit_enhancer(kind, pairs.coarse[:, :, :columns], pairs.telemetry, pairs.starts, seed, **epochs)
        return lambda windows: enhancer.predict(windows[:, :, :columns])[:, :, 0]

    return {name: fitted(*ENHANCERS[name]) for name in names}


def choice_rows(pairs: PairWindows, seed: int) -> Rows:
    """Chooses an enhancer of all coarse columns as `fit` does, with a row for each candidate that was tried."""
    choice = choose_enhancer(pairs.coarse, pairs.telemetry, pairs.starts, seed=seed)
    return [
        {"candidate": each.name, "error": each.error, "standard_error": each.standard_error, "is_chosen": each.name == choice.enhancer.name}
        for each in choice.judged
    ]


def error_rows(recorded: Recorded, enhancers: Mapping[str, Predict], seed: int) -> Rows:
    """Measures the root-mean-square error of enhancers on the test orbits and on every fault.

    The unit is the standard deviation of the fine simulator's voltage over the test windows (NRMSE), on faults too.
    """
    rows, unit = [], float(np.std(judged_windows(recorded, None, seed).fine, dtype=np.float64))
    for fault in (None, *ALL):
        pairs = judged_windows(recorded, fault, seed)
        for name, predict in enhancers.items():
            squares = np.square(predict(pairs.coarse) - pairs.telemetry, dtype=np.float64)
            rows.append(columns_of(fault) | {"enhancer": name, "nrmse": float(np.sqrt(np.mean(squares))) / unit})
    return rows


def trust_rows(recorded: Recorded, pairs: PairWindows) -> Rows:
    """Measures which share of the windows of each fault the trust score calls out of range, from coarse windows alone.

    The limit is the conformal threshold of 1 % on nominal coarse windows of other orbits. Enhancers are fitted to `pairs`.
    """
    centre, scale = (np.asarray(measure(pairs.coarse, axis=(0, 1), dtype=np.float64)) for measure in (np.mean, np.std))

    def in_unit(windows: np.ndarray) -> np.ndarray:
        return ((windows - centre) / scale).reshape(len(windows), -1).astype(np.float32)

    def windows_of(fault: Fault | None) -> np.ndarray:
        part, number = ("test", NUM_TEST) if fault is None else ("fault", NUM_FAULT)
        return coarse_windows(recorded.get(part, "coarse", fault), number)

    score = OutOfRange().fit(in_unit(pairs.coarse))
    limit = threshold(score.score(in_unit(coarse_windows(recorded.get("coarse", "coarse"), NUM_WINDOWS))), _RATE)
    return [columns_of(fault) | {"out_of_range": float(np.mean(score.score(in_unit(windows_of(fault))) > limit))} for fault in (None, *ALL)]


def speed_rows(recorded: Recorded, enhancers: Mapping[str, Predict], regime: Regime, seed: int) -> Rows:
    """Measures the processor time for an orbit of each simulator and of each enhancer, in seconds.

    A simulator's time is that of running a built model again. An enhancer's is the time for the test windows, of which an
    orbit needs `ORBIT_SAMPLES / WINDOW`, without the coarse simulator. Both exclude the first run, which compiles. Processor
    time is used because the load of the machine does not affect it.
    """
    current = battery_current(draw_load(_SPEED_ORBITS, regime, np.random.default_rng([seed, 100])), regime)
    seconds = {f"{name} simulator": _solving_time(model, current, regime) / _SPEED_ORBITS for name, model in MODELS.items()}
    windows = coarse_windows(recorded.get("test", "coarse"), _SPEED_WINDOWS)
    for name, predict in enhancers.items():
        predict(windows)
        began = time.process_time()
        for _ in range(_SPEED_REPEATS):
            predict(windows)
        seconds[name] = (time.process_time() - began) / _SPEED_REPEATS / len(windows) * ORBIT_SAMPLES / WINDOW
    return [{"what": what, "seconds": value} for what, value in seconds.items()]


def _solving_time(model: Model, current: np.ndarray, regime: Regime) -> float:
    """Processor time of a further run of a built model, in seconds: building and the first run cancel in a difference."""
    spent = []
    for number in (1, 1 + _SPEED_REPEATS):
        began = time.process_time()
        simulate(model, current, regime, [None] * number)
        spent.append(time.process_time() - began)
    return (spent[1] - spent[0]) / _SPEED_REPEATS
