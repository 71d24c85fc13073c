"""Chooses the enhancer of a simulator of square waves on held-out time, from the ladder of `enhancer.ladder`.

The paper trains its network in any case. Here, ridge regression aligns the windows first, because it is fitted in seconds; then
all rungs are judged on the same aligned windows.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.enhancer.ladder import COARSE, LEVEL_AND_GAIN, RIDGE, RUNGS, fit_ladder, fit_rung
from enhsim_tf.enhancer.scaling import Scaling
from enhsim_tf.enhancer.training_pairs import Pairs, cut_pairs
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import random_window_starts

Simulator, Settings = Any, Any  # an `EnhancedSimulator` and `TrainingSettings`, whose modules import this one
_UNCHANGED = Scaling((0.0,), (1.0,), 0.0, 1.0)  # the simulator itself converts to the units of its enhancer
_ALIGNMENTS = 2  # rounds in which the windows are aligned with the waveform of ridge regression


def choose_enhancer(simulator: Simulator, parts: Sequence[Telemetry], settings: Settings) -> list[dict[str, Any]]:
    """Sets the enhancer of a simulator to the chosen rung.

    Args:
        simulator: The simulator, with an untrained enhancer.
        parts: Telemetry to learn from.
        settings: Settings of the training. `enhancer` is the rung that was asked for, or `best`.

    Returns:
        For each rung, its `name`, `error` and `standard_error` on held-out time (NRMSE), `is_within`, whether it is within one
        standard error of the best, and `is_chosen`. Empty for a constant level, which needs no enhancer.

    Raises:
        InputError: If the telemetry is too short to hold out blocks of it.
    """
    starts = random_window_starts(parts, settings.window, settings.num_windows, np.random.default_rng(settings.seed))
    pairs = cut_pairs(parts, simulator.coarse, starts, settings.window, settings.follow)
    pairs = pairs.drop_flat() if settings.follow else pairs
    if getattr(simulator.coarse, "is_constant", False):  # nothing can be learnt from windows that are all the same
        simulator.enhancer = fit_rung(COARSE, *_windows(simulator, pairs), scaling=_UNCHANGED).network
        return []
    if settings.follow:
        for _ in range(_ALIGNMENTS):
            simulator.enhancer = fit_rung(RIDGE, *_windows(simulator, pairs), scaling=_UNCHANGED).network
            pairs = simulator.align_to_enhanced(pairs).drop_flat()
    rungs = [name for name in RUNGS if name != LEVEL_AND_GAIN or not settings.follow]  # aligned windows have their level and gain
    wanted = None if settings.enhancer == "best" else settings.enhancer
    windows = _windows(simulator, pairs)
    ladder = fit_ladder(*windows, rungs, settings.seed, settings.epochs, refit="chosen", wanted=wanted, scaling=_UNCHANGED)
    simulator.enhancer = ladder.rungs[ladder.chosen].network
    return [
        {
            "name": each.name,
            "error": each.error,
            "standard_error": each.standard_error,
            "is_within": bool(each.is_within),
            "is_chosen": each.name == ladder.chosen,
        }
        for each in ladder.judged
    ]


def _windows(simulator: Simulator, pairs: Pairs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns coarse windows and targets in the units of the enhancer, and the starts in samples."""
    inputs, targets = ((windows - simulator.offset) / simulator.scale for windows in (pairs.coarse, pairs.target_in_unit))
    return inputs, targets, np.round(pairs.time_s / simulator.interval_s).astype(np.int64)
