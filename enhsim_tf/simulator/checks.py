"""Checks of the arguments that the methods of the enhanced simulator and its training share."""

import operator
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError

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
