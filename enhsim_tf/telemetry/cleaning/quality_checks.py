"""Quality checks of a cleaned channel, for its report: quantised, stuck, constant or drifting values. The values are not changed."""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.telemetry.cleaning.report import CleaningLog
from enhsim_tf.telemetry.cleaning.resampling import Part

_NUM_STRETCHES = 10  # consecutive stretches whose level and amplitude are compared
_MAX_LEVELS = 4_096  # a channel with more distinct values does not count as quantised
_STUCK = 20  # a shorter run of one value, in samples, does not count as stuck


def describe_values(parts: Sequence[Part], log: CleaningLog) -> None:
    """Adds findings about the values of a channel to the cleaning log.

    Args:
        parts: The regular parts of one channel.
        log: The cleaning log.
    """
    values = np.concatenate([part.values for part in parts])
    numbers = np.concatenate([part.source_row for part in parts])
    if np.ptp(values) == 0:
        log.add("constant", (), f"the channel is {values[0]:g} throughout", count=len(values))
        return
    _log_resolution(values, log)
    _log_levels(values, log)
    _log_stuck(values, numbers, log)
    _log_drift(values, log)


def _log_resolution(values: np.ndarray, log: CleaningLog) -> None:
    rounded = values.astype(np.float32).astype(np.float64)
    error, spread = float(np.abs(rounded - values).max()), float(values.std())
    if error > 1e-3 * spread:
        text = f"float32 rounds the values by up to {error:.3g}, while their standard deviation is {spread:.3g}: subtract their mean first"
        log.add("resolution", (), text, count=int((rounded != values).sum()), details={"error": error})


def _log_levels(values: np.ndarray, log: CleaningLog) -> None:
    levels = np.unique(values)
    if not 2 <= len(levels) <= min(_MAX_LEVELS, len(values) // 10):
        return
    steps = np.diff(levels)
    step = float(steps.min())
    multiples = (levels - levels[0]) / step
    even = float(np.abs(multiples - np.round(multiples)).max()) < 0.05
    how = f"in steps of {step:.4g}" if even else f"at least {step:.4g} apart"
    text = f"quantised values, {{count}} levels {how}: noise smaller than a step cannot be learnt"
    log.add("quantised", (), text, count=len(levels), details={"step": step, "is_even": even})


def _log_stuck(values: np.ndarray, numbers: np.ndarray, log: CleaningLog) -> None:
    begins = np.flatnonzero(np.diff(values, prepend=values[0] - 1) != 0)
    lengths = np.diff(begins, append=len(values))
    usual = float(np.quantile(lengths, 0.9))
    stuck = lengths >= max(_STUCK, 3 * usual)
    if stuck.any():
        longest = int(lengths.max())
        text = f"stretches of one value, the longest for {longest:,} samples: {{count}}"
        log.add("stuck", numbers[begins[stuck]], text, details={"longest": longest})


def _log_drift(values: np.ndarray, log: CleaningLog) -> None:
    if len(values) < 10 * _NUM_STRETCHES:
        return
    low, middle, high = np.array([np.quantile(stretch, (0.05, 0.5, 0.95)) for stretch in np.array_split(values, _NUM_STRETCHES)]).T
    spans = high - low
    usual = float(np.median(spans))
    moves, swells = np.ptp(middle) > 0.5 * usual, spans.max() > 1.5 * max(spans.min(), 1e-12)
    if moves or swells:
        text = (
            f"level or amplitude changes: over {_NUM_STRETCHES} consecutive stretches the median ranges from {middle.min():.4g} to "
            f"{middle.max():.4g}, and the 5 % to 95 % range from {spans.min():.4g} to {spans.max():.4g}"
        )
        log.add("changing level", (), text, count=_NUM_STRETCHES, details={"low": low.tolist(), "high": high.tolist()})
