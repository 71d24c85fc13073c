"""Checks of the arguments that the methods of the enhanced simulator and its training share."""

import operator
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry, check_telemetry

_LEAST_SPAN, _MOST_SIZE = 1e-12, 1e15  # beyond them, squares of the noise or of the values leave the range of float32


def check_counts(**counts: tuple[Any, int]) -> None:
    """Checks that counts are whole numbers and large enough.

    Args:
        **counts: For each argument, its name with a tuple `(value, minimum)`.

    Raises:
        InputError: If a value is not a whole number or is below its minimum.
    """
    for name, (count, minimum) in counts.items():
        try:
            is_large_enough = operator.index(count) >= minimum
        except TypeError:
            is_large_enough = False
        if not is_large_enough:
            raise InputError(f"Expected {name} to be a whole number, at least {minimum}. Received: {name}={count!r}.")


def check_parts(telemetry: Telemetry | Sequence[Telemetry]) -> list[Telemetry]:
    """Checks a series, or the parts between its gaps, and returns a list of parts.

    Args:
        telemetry: One series, or the parts of one series on a common clock.

    Returns:
        The parts; a single series becomes a list of one part.

    Raises:
        InputError: If a part is not valid telemetry, or if the parts have different sampling intervals.
    """
    parts = [telemetry] if isinstance(telemetry, Telemetry) or not isinstance(telemetry, Sequence) else list(telemetry)
    for part in parts:
        check_telemetry(part)
    intervals = {part.interval_s for part in parts}
    if len(intervals) != 1:
        raise InputError(f"Expected all parts to have the same sampling interval. Received: {sorted(intervals)}.")
    return parts


def check_coarse(coarse: Any, follow: bool) -> None:
    """Checks that a coarse simulator has what `EnhancedSimulator` needs. Simulators of other kinds get a run model.

    Args:
        coarse: The coarse simulator.
        follow: Whether it is aligned with each window of telemetry.

    Raises:
        InputError: If it lacks a method.
    """
    needed = ("simulate", "levels", *(("synchronise",) if follow else ()))
    missing = [name for name in needed if not hasattr(coarse, name)]
    if missing:
        raise InputError(
            f"Expected square waves, or a simulator with `{missing[0]}`. Received: {type(coarse).__name__}. "
            "Fit another simulator with fit_run_model, which needs only `columns` and `run`."
        )


def config_of(coarse: Any) -> dict[str, Any]:
    """Returns the configuration of a coarse simulator for saving.

    Args:
        coarse: The coarse simulator.

    Raises:
        InputError: If it has no configuration, as a user's own class.
    """
    if not hasattr(coarse, "get_config"):
        raise InputError(
            f"Expected square waves, which can be saved. Received: {type(coarse).__name__}, whose code is not saved. "
            "Fit it with fit_run_model, whose models can be saved without it."
        )
    return coarse.get_config()


def check_size(values: np.ndarray, what: str) -> None:
    """Checks that the values of a channel are neither too large nor too small for networks, which compute in float32.

    Args:
        values: The values, float32.
        what: Name of the channel.

    Raises:
        InputError: If a value is beyond 1e15, or if all lie within 1e-12.
    """
    low, high = float(np.min(values)), float(np.max(values))
    if not (max(-low, high) <= _MOST_SIZE and high - low >= _LEAST_SPAN):
        raise InputError(
            f"Expected values up to {_MOST_SIZE:g} that span at least {_LEAST_SPAN:g}. Received: {what}, from {low:g} to {high:g}. "
            "Give it in another unit."
        )


def is_finite(arrays: Iterable[np.ndarray]) -> bool:
    """Whether all values of all arrays are finite.

    Args:
        arrays: Arrays, such as the weights of a network.
    """
    return all(np.isfinite(each).all() for each in arrays)


def check_finite(windows: np.ndarray) -> np.ndarray:
    """Checks generated telemetry and returns it.

    Args:
        windows: Generated windows or a generated series.

    Raises:
        InputError: If a value is not finite.
    """
    if not np.isfinite(windows).all():
        bad = int(np.size(windows) - np.count_nonzero(np.isfinite(windows)))
        raise InputError(
            f"Expected a simulator that generates finite values. Received: {bad:,} of {np.size(windows):,} values that are not. Fit it again."
        )
    return windows
