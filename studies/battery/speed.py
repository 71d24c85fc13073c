"""The time that the simulators and the enhancers need for an orbit."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from studies.battery.orbits import ORBIT_SAMPLES, Regime, battery_current, draw_load
from studies.battery.record import Recorded
from studies.battery.simulate import MODELS, Model, simulate
from studies.battery.windows import WINDOW, coarse_windows

_SPEED_ORBITS, _SPEED_REPEATS, _SPEED_WINDOWS = 8, 4, 400


def speed_rows(
    recorded: Recorded, enhancers: Mapping[str, Callable[[np.ndarray], np.ndarray]], regime: Regime, seed: int
) -> list[dict[str, Any]]:
    """Measures the processor time for an orbit of each simulator and of each enhancer, in seconds.

    A simulator's time is that of running a built model again. An enhancer's is the time for the test windows, of which an
    orbit needs `ORBIT_SAMPLES / WINDOW`, without the coarse simulator. Both exclude the first run, which compiles. Processor
    time is used because the load of the machine does not affect it.

    Args:
        recorded: The runs.
        enhancers: Functions from coarse windows to enhanced windows, by name.
        regime: How hard the battery is used.
        seed: Seed of the simulated orbits.
    """
    current = battery_current(draw_load(_SPEED_ORBITS, regime, np.random.default_rng([seed, 100])), regime)
    rows = [
        {"what": f"{name} simulator", "seconds": _solving_time(model, current, regime) / _SPEED_ORBITS} for name, model in MODELS.items()
    ]
    windows = coarse_windows(recorded, "test", _SPEED_WINDOWS)
    for name, predict in enhancers.items():
        predict(windows)
        began = time.process_time()
        for _ in range(_SPEED_REPEATS):
            predict(windows)
        seconds = (time.process_time() - began) / _SPEED_REPEATS
        rows.append({"what": name, "seconds": seconds / len(windows) * ORBIT_SAMPLES / WINDOW})
    return rows


def _solving_time(model: Model, current: np.ndarray, regime: Regime) -> float:
    """Processor time of a further run of a built model, in seconds: building and the first run cancel in a difference."""
    spent = []
    for number in (1, 1 + _SPEED_REPEATS):
        began = time.process_time()
        simulate(model, current, regime, [None] * number)
        spent.append(time.process_time() - began)
    return (spent[1] - spent[0]) / _SPEED_REPEATS
